"""Running jobs for a person who waits: check all, run, write, print the means, end by the worst."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from simbench.case import Images, Job, JobResult


def execute(planned: list[Job], out: Path, images: Images, workers: int | None, as_json: bool) -> None:
    """Check every job before any runs, run them, write everything, exit by the worst status."""
    import os

    from simbench import results as result_files
    from simbench.campaign.jobs import run_jobs
    from simbench.environment import environment
    from simbench.files import prepare_folder
    from simbench.formats.targets import is_recorded
    from simbench.outcome import exit_code
    from simbench.report.page import write_report
    from simbench.result_file import print_result
    from simbench.sensors import ray_kernel
    from simbench.sensors.compiled import is_compiled
    from simbench.stage import stage

    first: dict[tuple[str, str, tuple[str, ...]], Job] = {}
    simulated = [job for job in planned if not is_recorded(job.scenario)]
    for job in simulated:
        first.setdefault((job.scenario, job.system, job.faults), job)
    if simulated and not is_compiled(ray_kernel._cast_fans):
        click.echo("compiling the ray kernels, once: this takes up to a minute", err=True)
    for job in first.values():
        stage(job)  # bad input shows before anything runs
    prepare_folder(out)
    with _Progress(len(planned)) as done:
        found = run_jobs(planned, workers or os.cpu_count() or 1, done)
    where = environment(images)
    result_files.write(found, out, where)
    command = "simbench " + " ".join(quote(word) for word in sys.argv[1:])
    if images != "none":
        _video(found, out, images)
    page = write_report(found, out, command=command, images=images, environment=where)
    if as_json:
        print_result(out)
    else:
        _print_summary(found)
        click.echo(f"report: {page}")
    code = exit_code(case.status for result in found for case in result.cases)
    if code:
        raise SystemExit(code)


def _video(found: tuple[JobResult, ...], out: Path, images: Images) -> None:
    """One video: the first recording with a target, one with faults if there is one."""
    from simbench.report.video import moves, write_video

    shown = [r for r in found if moves(r) and all(c.status == "ok" for c in r.cases)]
    for result in sorted(shown, key=lambda r: len(r.faults) == 0)[:1]:
        write_video(result, out, images)


class _Progress:
    """A bar on a terminal, plain lines on stderr otherwise."""

    def __init__(self, total: int) -> None:
        self._total, self._count = total, 0
        self._advance: Callable[[], None] | None = None
        self._stop: Callable[[], None] = lambda: None

    def __enter__(self) -> Callable[[JobResult], None]:
        if not sys.stderr.isatty():
            click.echo(f"{self._total} recordings to make", err=True)
            return self._done
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        bar = Progress(*columns, console=Console(stderr=True))
        task = bar.add_task("recordings", total=self._total)
        self._advance, self._stop = lambda: bar.advance(task), bar.stop
        bar.start()
        return self._done

    def _done(self, result: JobResult) -> None:
        self._count += 1
        if self._advance is not None:
            self._advance()
            return
        states = ", ".join(sorted({case.status for case in result.cases})) or "no pipelines"
        click.echo(
            f"[{self._count}/{self._total}] {result.scenario.name} {result.job.system} "
            f"seed {result.job.seed} faults {result.faults.label}: {states} "
            f"({sum(result.timings_s.values()):.1f} s)",
            err=True,
        )

    def __exit__(self, *exc: object) -> None:
        self._stop()


def _print_summary(found: tuple[JobResult, ...]) -> None:
    """Means over runs, one line per group and pipeline."""
    from statistics import fmean

    shown = ("tpr", "precision", "recall", "mae_m.raw", "mae_m.smooth", "coverage.smooth")
    groups: dict[str, list[Any]] = {}
    for result in found:
        for case in result.cases:
            told = ("calibration-found",) if result.job.told == "found" else ()
            words = (result.scenario.name, result.job.system, result.faults.label, *told, case.pipeline)
            groups.setdefault(" ".join(words), []).append(case)
    width = max((len(name) for name in groups), default=0) + 2
    click.echo(" " * width + "".join(f"{name:>16s}" for name in shown))
    for key, cases in groups.items():
        cells = []
        for name in shown:
            values = [r.value for c in cases for r in c.rows if r.metric == name and r.value is not None]
            cells.append(f"{fmean(values):16.3f}" if values else f"{'-':>16s}")
        click.echo(f"{key:{width}s}" + "".join(cells))
    _print_objects(found)
    bad = [(r, c) for r in found for c in r.cases if c.status != "ok"]
    for result, case in bad:
        click.echo(f"{case.status}: {case.pipeline}, {result.job.system} seed {result.job.seed}: {case.why}")


def _print_objects(found: tuple[JobResult, ...]) -> None:
    """Recorded data: what became of every labelled object."""
    from simbench.report.objects import as_text, object_tables

    for table in object_tables(found):
        click.echo("\n" + as_text(table))
