"""The command line: `simbench demo | run | stress | frontier | explain | calibrate | list | describe |
timeline | doctor | learn | check | score`.

Exit codes: 0 good, 1 a pipeline failed, 2 usage or bad input, 3 the bench itself failed (a receipt does not
match, a crash of ours), 5 nothing selected.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from simbench.commands.check import check
from simbench.commands.explain import explain
from simbench.commands.frontier import frontier
from simbench.commands.options import DEFAULT, OF_THE_PAPER, cluster_option, isolation, seeds_of
from simbench.commands.score import score

if TYPE_CHECKING:
    from simbench.case import Boxes, Images, Job, JobResult

BAD_INPUT, NOTHING = 2, 5


class _Cli(click.Group):
    """Turns usage errors and bad input into one sentence on stderr and exit code 2."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        try:
            code = super().main(*args, **{**kwargs, "standalone_mode": False})
        except click.exceptions.NoArgsIsHelpError as help_page:
            help_page.show()
            raise SystemExit(BAD_INPUT) from None
        except click.ClickException as error:
            click.echo(f"simbench: {error.format_message()}", err=True)
            raise SystemExit(BAD_INPUT) from None
        except click.Abort:
            raise SystemExit(130) from None
        except Exception as error:
            if not _is_users(error):
                raise
            click.echo(f"simbench: {error}", err=True)
            raise SystemExit(BAD_INPUT) from None
        raise SystemExit(code if isinstance(code, int) else 0)


def _is_users(error: Exception) -> bool:
    """Whether an error is about what the user gave or what the machine lacks."""
    from scenarios.errors import BadInput

    if isinstance(error, BadInput):
        return True
    module = sys.modules.get("simbench.sensors.gl")
    return module is not None and isinstance(error, module.RenderingUnavailable)


@click.group(cls=_Cli, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="simbench")
def main() -> None:
    """Test bench for LiDAR-camera fusion: inject errors into a simulated drive, score what is recovered."""


def _span(_: click.Context, __: click.Parameter, text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    first, dash, last = text.partition("-")
    numbers = (first, last if dash else first)
    if not all(word.isascii() and word.isdigit() and len(word) < 10 for word in numbers):
        raise click.BadParameter(f"'{text}' is not a range of frames; allowed: 0-99")
    low, high = int(numbers[0]), int(numbers[1])
    if high < low:
        raise click.BadParameter(f"'{text}' is not a range of frames from low to high")
    return low, high


def _size(_: click.Context, __: click.Parameter, text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    width, cross, height = text.partition("x")
    if not cross or not (width + height).isascii() or not width.isdigit() or not height.isdigit():
        raise click.BadParameter(f"'{text}' is not an image size; allowed: 960x600")
    if not (64 <= int(width) <= 2048 and 64 <= int(height) <= 2048):
        raise click.BadParameter(f"'{text}' is out of range; allowed: 64x64 to 2048x2048")
    return int(width), int(height)


def _common(folder: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The options that `demo` and `run` share; `folder`: where results go unless told."""
    options = (
        click.option("--seeds", default="0-1", callback=seeds_of, help="Runs to make: 0-3 or 0,2,5."),
        click.option(
            "--images",
            type=click.Choice(["none", "raycast", "gl"]),
            default="raycast",
            show_default=True,
            help="Take pictures by rays, by OpenGL, or not at all.",
        ),
        click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores)."),
        click.option(
            "--out",
            type=click.Path(path_type=Path),
            default=Path(folder),
            show_default=True,
            help="Folder for result.json, report.html and the video.",
        ),
        click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout."),
        click.option("--size", callback=_size, default=None, help="Image size in pixels, e.g. 960x600."),
    )

    def add(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(options):
            command = option(command)
        return command

    return add


@main.command()
@_common("out/demo")
def demo(
    seeds: tuple[int, ...],
    images: Images,
    jobs: int | None,
    out: Path,
    as_json: bool,
    size: tuple[int, int] | None,
) -> None:
    """A car overtakes an e-scooter; cameras are 50 ms late, the body shakes; both rigs, one page.

    Example: simbench demo --out out/demo
    """
    from simbench.case import Job

    planned = [
        Job(
            scenario="overtake-approach", system=system, seed=seed, pipelines=OF_THE_PAPER, faults=(faults,),
            images=images if faults == "demo" else "none", size_px=size,
        )
        for system in ("car", "wearable")
        for seed in seeds
        for faults in ("none", "demo")
    ]  # fmt: skip
    _execute(planned, out, images, jobs, as_json)


@main.command()
@click.argument("targets", nargs=-1, metavar="TARGET...")
@click.option("--system", type=click.Choice(["car", "wearable", "both"]), default="both", help="Which rig.")
@click.option(
    "--pipeline", "pipelines", multiple=True, metavar="NAME",
    help="May be repeated. Default: the raw box (with and without ground), the paper's method and 'robust'.",
)  # fmt: skip
@click.option(
    "--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE|KEY@SEVERITY",
    help="Replaces the scenario's same fault, adds the others; 'none' clears. May be repeated.",
)  # fmt: skip
@click.option(
    "--set", "changes", multiple=True, metavar="PATH=VALUE",
    help="Replaces a value of the scenario file, as systems.car.duration_s=3. May be repeated.",
)  # fmt: skip
@click.option(
    "--off", "off", multiple=True, metavar="NAME",
    help="Leave a part of the bench out: bench.rolling_scan, bench.spin_phase, bench.reference_rate.",
)  # fmt: skip
@click.option("--alone", is_flag=True, help="Leave out the same drives with errors off.")
@click.option(
    "--boxes", type=click.Choice(["labels", "model"]), default=None,
    help="Detections: the exact boxes of all objects (default for recorded data), or what the detector model "
    "makes of them (default for simulated drives).",
)  # fmt: skip
@click.option(
    "--frames", "span", callback=_span, default=None, metavar="FIRST-LAST",
    help="Recorded sequences: only these frames.",
)  # fmt: skip
@click.option(
    "--calibration", default="true", show_default=True, metavar="true|found[:FILE]",
    help="What the pipelines are told: the truth, or what 'simbench calibrate' finds (or wrote to FILE).",
)  # fmt: skip
@isolation
@_common("out/run")
def run(
    targets: tuple[str, ...], system: str, pipelines: tuple[str, ...], faults: tuple[str, ...],
    changes: tuple[str, ...], off: tuple[str, ...], alone: bool,
    boxes: Boxes | None, span: tuple[int, int] | None, calibration: str, seeds: tuple[int, ...],
    images: Images, jobs: int | None, out: Path, as_json: bool, size: tuple[int, int] | None,
    apart: dict[str, Any],
) -> None:  # fmt: skip
    """Run scenarios (names or .yaml files) through pipelines; write result.json and report.html.

    Where errors are injected, the same drives are also run with errors off. A target kitti:FOLDER is recorded
    data: every frame (object layout), sequence or drive is a run, called by its number; --seeds picks some.

    Example: simbench run overtake-approach --system car --faults timing.trigger_offset_ms=50 --seeds 0-1
    """
    from dataclasses import replace

    from scenarios.fault_set import parse_fault_arguments
    from scenarios.load import load_scenario
    from simbench.calibration.find import found_for
    from simbench.case import Job
    from simbench.formats.kitti import is_recorded
    from simbench.isolate.ask import check_pipeline_name
    from simbench.stage import faults_of

    if not targets:
        click.echo("simbench: nothing selected: name at least one scenario (see 'simbench list').", err=True)
        raise SystemExit(NOTHING)
    chosen = tuple(dict.fromkeys(pipelines)) or DEFAULT
    for name in chosen:
        check_pipeline_name(name)
    recorded = [target for target in dict.fromkeys(targets) if is_recorded(target)]
    planned = []
    if recorded and changes:
        raise click.UsageError("--set is for simulated drives: what was recorded has happened")
    if recorded and off:
        raise click.UsageError("--off is for simulated drives: what was recorded has happened")
    if recorded and calibration != "true":
        raise click.UsageError("--calibration is for simulated drives: recorded data bring their own")
    if recorded:
        given = click.get_current_context().get_parameter_source("seeds") != ParameterSource.DEFAULT
        template = Job(
            scenario="", system=system, seed=0, pipelines=chosen, faults=faults, images=images, size_px=size,
            boxes=boxes, frames=span, **apart,
        )  # fmt: skip
        planned += _recorded_jobs(recorded, template, seeds if given else None, alone)
    if len(recorded) < len(dict.fromkeys(targets)):
        parse_fault_arguments(faults)
        if span is not None:
            raise click.UsageError("--frames is for recorded data (kitti:FOLDER)")
    for target in dict.fromkeys(targets):
        if target in recorded:
            continue
        family = load_scenario(target, changes)
        for name in family.system_names if system == "both" else (system,):
            if calibration == "found":
                click.echo(f"calibrating the rig of {name}: this takes about a minute", err=True)
            found_in = found_for(calibration, out, family, name, size)
            for seed in seeds:
                job = Job(
                    scenario=target, system=name, seed=seed, pipelines=chosen, faults=faults,
                    images=images, size_px=size, boxes=boxes, changes=changes, calibration=calibration,
                    found_in=found_in, off=tuple(dict.fromkeys(off)), **apart,
                )  # fmt: skip
                # The same drive with errors off: what every loss is measured against.
                if not alone and len(faults_of(job, family, family.resolve(seed))) > 0:
                    planned.append(replace(job, faults=("none",), images="none"))
                planned.append(job)
    _execute(planned, out, images, jobs, as_json)


def _recorded_jobs(
    targets: list[str], template: Job, numbers: tuple[int, ...] | None, alone: bool
) -> list[Job]:
    from dataclasses import replace

    from simbench.formats.jobs import plan

    if len(targets) > 1:  # they would share their names and numbers in every table
        raise click.UsageError(f"one kitti: folder at a time, not {len(targets)}")
    return plan(replace(template, scenario=targets[0]), numbers, alone=alone)


def _execute(planned: list[Job], out: Path, images: Images, workers: int | None, as_json: bool) -> None:
    """Check every job before any runs, run them, write everything, exit by the worst status."""
    import json
    import os

    from simbench import results as result_files
    from simbench.campaign.jobs import run_jobs
    from simbench.environment import environment
    from simbench.files import prepare_folder
    from simbench.formats.kitti import is_recorded
    from simbench.outcome import exit_code
    from simbench.report.page import write_report
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
    content = result_files.write(found, out, where)
    command = "simbench " + " ".join(_quoted(word) for word in sys.argv[1:])
    if images != "none":
        _video(found, out, images)
    page = write_report(found, out, command=command, images=images, environment=where)
    if as_json:
        click.echo(json.dumps(content, indent=1, allow_nan=False))
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


def _quoted(word: str) -> str:
    import shlex

    return shlex.quote(word)


@main.command()
@click.argument("scenario")
@click.option(
    "--vary", "axes", multiple=True, required=True, metavar="NAME=LOW:HIGH:COUNT|NAME=A,B",
    help="A fault's field or a value of the scenario file. May be repeated.",
)  # fmt: skip
@click.option("--design", type=click.Choice(["grid", "lhs", "sobol"]), default="grid", show_default=True)
@click.option(
    "--points", type=click.IntRange(2, 100000), default=30, show_default=True, help="Of lhs and sobol."
)
@click.option("--system", type=click.Choice(["car", "wearable"]), help="Which rig (default: the first).")
@click.option(
    "--pipeline", "pipelines", multiple=True, metavar="NAME", help="May be repeated. Default: as run."
)
@click.option("--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE", help="At all points.")
@click.option("--set", "changes", multiple=True, metavar="PATH=VALUE", help="At all points.")
@click.option("--boxes", type=click.Choice(["labels", "model"]), default=None, help="As for run.")
@click.option("--seeds", default="0-3", callback=seeds_of, show_default=True, help="Runs at every point.")
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
@cluster_option
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/stress"), show_default=True)
def stress(
    scenario: str, axes: tuple[str, ...], design: str, points: int, system: str | None,
    pipelines: tuple[str, ...], faults: tuple[str, ...], changes: tuple[str, ...], boxes: Boxes | None,
    seeds: tuple[int, ...], jobs: int | None, cluster: str | None, out: Path,
) -> None:  # fmt: skip
    """Run a scenario over a grid of errors, or of anything in its file; write stress.html and stress.csv.

    A ledger in the folder keeps every recording as it is done: the same command again goes on where it
    stopped.

    Example: simbench stress overtake-approach --vary timing.trigger_offset_ms=0:150:4 --seeds 0-1
    """
    from simbench.stress.command import run_stress

    code = run_stress(
        scenario, axes, design=design, points=points, system=system,
        pipelines=tuple(dict.fromkeys(pipelines)) or DEFAULT, faults=faults, changes=changes, boxes=boxes,
        seeds=seeds, workers=jobs, cluster=cluster, out=out,
    )  # fmt: skip
    raise SystemExit(code)


@main.command()
@click.argument("rig")
@click.option("--cameras", default="", metavar="NAME,...", help="Only these cameras. Default: all.")
@click.option("--poses", type=int, default=20, show_default=True, help="Poses of the board a camera.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of all that is drawn.")
@click.option(
    "--click-noise-px", type=float, default=1.0, show_default=True, help="Of a click in the picture, 1 SD."
)
@click.option(
    "--corner-noise-mm", type=float, default=10.0, show_default=True,
    help="Of a corner picked among LiDAR points, 1 SD, every axis.",
)  # fmt: skip
@click.option(
    "--volume", default="3,6,0.6", show_default=True, metavar="NEAR,FAR,RADIUS",
    help="Where boards are held: metres from the camera, share of the half diagonal.",
)  # fmt: skip
@click.option("--fit-distortion", is_flag=True, help="Fit the lens's distortion (the paper does not).")
@click.option("--size", callback=_size, default=None, help="Image size in pixels, e.g. 960x600.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="A YAML file for what is found.")
def calibrate(
    rig: str, cameras: str, poses: int, seed: int, click_noise_px: float, corner_noise_mm: float,
    volume: str, fit_distortion: bool, size: tuple[int, int] | None, out: Path | None,
) -> None:  # fmt: skip
    """Calibrate a rig as the paper does, with a checkerboard that the bench shows to camera and LiDAR.

    Prints, against the truth: reprojection error, extrinsic error, and the TPR of a static board by pair (the
    paper's Table I) and inside and outside the calibrated zone.

    Example: simbench calibrate car-six-cameras --out out/calibration.yaml
    """
    from simbench.calibration.file import write_calibration
    from simbench.calibration.study import PairStudy, Settings, calibrate_rig
    from simbench.calibration.text import lines
    from simbench.calibration.volume import parse_volume
    from simbench.files import prepare_folder

    if out is not None:
        prepare_folder(out.parent)
    settings = Settings(
        rig=rig, cameras=tuple(dict.fromkeys(filter(None, cameras.split(",")))), poses=poses, seed=seed,
        click_noise_px=click_noise_px, corner_noise_m=1e-3 * corner_noise_mm, volume=parse_volume(volume),
        fit_distortion=fit_distortion, size_px=size,
    )  # fmt: skip

    def done(pair: PairStudy) -> None:
        click.echo(f"{pair.camera}: done", err=True)

    study = calibrate_rig(settings, done)
    for line in lines(study):
        click.echo(line)
    if out is not None:
        write_calibration(study, out)
        click.echo(f"\nwrote {out}")


@main.command("list")
@click.argument(
    "kind",
    default="scenarios",
    type=click.Choice(["scenarios", "rigs", "sensors", "faults", "pipelines", "metrics"]),
)
def list_(kind: str) -> None:
    """List what there is: scenarios, rigs, sensors, faults, pipelines or metrics.

    Example: simbench list faults
    """
    if kind == "pipelines":
        from simbench.plugins import pipeline_names

        lines = [(name, "") for name in pipeline_names()]
    elif kind == "metrics":
        from simbench.score.metrics import METRICS

        lines = [(metric.name, metric.definition) for metric in METRICS]
    elif kind == "faults":
        from scenarios.fault_set import describe_faults

        lines = [(str(f["name"]), str(f["summary"])) for f in describe_faults()]
    elif kind == "scenarios":
        from scenarios.load import list_scenarios, load_scenario

        lines = [(name, load_scenario(name).description) for name in list_scenarios()]
    elif kind == "rigs":
        from scenarios.load import list_rigs, load_rig

        lines = [(name, load_rig(name).description) for name in list_rigs()]
    else:
        from scenarios.load import list_sensors, load_sensor

        lines = [(name, load_sensor(name).kind) for name in list_sensors()]
    width = max([28, *(len(name) for name, _ in lines)])
    for name, text in lines:
        click.echo(f"{name:{width}s} {text}".rstrip())


@main.command()
@click.argument("words", nargs=-1, required=True, metavar="SCENARIO | fault NAME | faults")
@click.option("--seed", type=click.IntRange(0), default=0, help="Which of the scenario's family.")
@click.option(
    "--picture", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE.svg|png|jpg",
    help="Of a fault: draw what it does instead, without it and with it.",
)  # fmt: skip
@click.option(
    "--pictures", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER",
    help="With the word 'faults': draw all of them.",
)  # fmt: skip
@click.option("--level", type=click.IntRange(1, 5), default=4, show_default=True, help="Severity to draw.")
def describe(
    words: tuple[str, ...], seed: int, picture: Path | None, pictures: Path | None, level: int
) -> None:
    """Print the concrete scenario of a seed, every number fixed; or a fault: its formula, fields and
    severities. Or draw what a fault does.

    Example: simbench describe overtake-approach --seed 3
    """
    if picture is not None or pictures is not None:
        _draw_faults(words, picture, pictures, level)
        return
    if words[0] == "fault" and len(words) == 2:
        from scenarios.describe_fault import describe_fault

        click.echo(describe_fault(words[1]))
        return
    if len(words) != 1:
        raise click.UsageError("one scenario, or the word 'fault' and the name of one")
    from scenarios.describe import describe as text
    from scenarios.load import load_scenario

    click.echo(text(load_scenario(words[0]).resolve(seed)), nl=False)


def _draw_faults(words: tuple[str, ...], picture: Path | None, pictures: Path | None, level: int) -> None:
    """One fault into a file, or all of them into a folder."""
    from simbench.report.fault_pictures.command import write_picture, write_pictures

    if picture is not None and pictures is None and words[0] == "fault" and len(words) == 2:
        write_picture(words[1], level, picture)
        click.echo(f"wrote {picture}")
    elif pictures is not None and picture is None and words == ("faults",):
        for path in write_pictures(pictures, level):
            click.echo(f"wrote {path}")
    else:
        raise click.UsageError("'fault NAME' goes with --picture FILE, 'faults' with --pictures FOLDER")


@main.command()
@click.argument("target", metavar="RUN|SCENARIO")
@click.option("--system", type=click.Choice(["car", "wearable"]), help="Which rig (default: the first).")
@click.option("--seed", type=click.IntRange(0), help="Which of the family (default: 0, or a run's first).")
@click.option(
    "--faults", "faults", multiple=True, metavar="NAME|FILE|KEY=VALUE",
    help="In place of or on top of those of the run or scenario; 'none' clears. May be repeated.",
)  # fmt: skip
@click.option("--at", "at_s", type=float, default=0.2, show_default=True, help="Seconds into the run.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("out/timeline"),
    show_default=True,
    help="Folder for the picture.",
)
def timeline(
    target: str, system: str | None, seed: int | None, faults: tuple[str, ...], at_s: float, out: Path
) -> None:
    """Draw when every sensor measures, what its stamps claim and when it delivers, over two sweeps.

    Of a scenario (name or .yaml file) or of the folder of a run. The table says how far the LiDAR's firing
    along each camera's axis is from the camera's exposure and from its stamp.

    Example: simbench timeline overtake-approach --system wearable
    """
    from rich.console import Console

    from simbench.files import prepare_folder, write_text
    from simbench.report.timeline import svg
    from simbench.report.timeline_text import text
    from simbench.timeline import timeline as read

    found = read(target, system, seed, faults, at_s)
    prepare_folder(out)
    console = Console()
    console.print(text(found, console.width))
    write_text(out / "timeline.svg", svg(found))
    click.echo(f"\npicture: {out / 'timeline.svg'}")


@main.command()
@click.argument("names", nargs=-1, metavar="[FAULT...]")
@click.option("--faults", is_flag=True, help="Prove the faults of the catalogue instead, or those named.")
@click.option("--quick", is_flag=True, help="10 honest draws a fault instead of 5,000.")
@click.option("--draws", type=click.IntRange(2), default=None, help="So many honest draws.")
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
def doctor(names: tuple[str, ...], faults: bool, quick: bool, draws: int | None, jobs: int | None) -> None:
    """Say what this machine offers and what is missing.

    With --faults: make every fault do what it should not (nothing, half, double, the wrong sign, sensor or
    unit, twice) and see whether the receipts notice; draw it honestly many times and see that they do not;
    raise its severity and see that its effect grows.

    Example: simbench doctor --faults --quick timing.clock_offset_ms
    """
    if not faults:
        if names or quick or draws is not None:
            raise click.UsageError("fault names, --quick and --draws go with --faults")
        from simbench import doctor as rooms

        raise SystemExit(rooms.main())
    from simbench.proving.command import FULL, QUICK, prove_faults

    raise SystemExit(prove_faults(names, draws or (QUICK if quick else FULL), jobs))


@main.command()
@click.option("--seeds", default="100000-100003", callback=seeds_of, help="From 100000 on.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), required=True, help="The JSON file.")
def learn(seeds: tuple[int, ...], out: Path) -> None:
    """Learn the shape filter's benchmark shapes from the bench (fusion/shapes.json).

    Example: simbench learn --seeds 100000-100003 --out fusion/shapes.json
    """
    from scenarios.errors import BadInput
    from simbench.files import prepare_folder, write_text
    from simbench.learn import FIRST_SEED
    from simbench.learn import learn as learn_shapes

    if min(seeds) < FIRST_SEED:
        raise BadInput(
            f"seed {min(seeds)} is for evaluation", field="--seeds", allowed=f"from {FIRST_SEED} on"
        )
    prepare_folder(out.parent)
    write_text(out, learn_shapes(seeds))
    click.echo(f"wrote {out}")


main.add_command(check)
main.add_command(explain)
main.add_command(frontier)
main.add_command(score)


if __name__ == "__main__":
    main()
