"""`simbench explain`: check everything before anything runs, measure, take apart, write."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from shlex import join

import click

from scenarios.errors import BadInput
from simbench.campaign.lock import only_one
from simbench.case import Boxes
from simbench.explain.answer import answer
from simbench.explain.causes import question_of_scenario
from simbench.explain.runs import question_of_run
from simbench.explain.table import as_csv, as_text
from simbench.explain.values import Measured
from simbench.files import prepare_folder, write_text
from simbench.isolate.ask import check_pipeline_name
from simbench.outcome import exit_code
from simbench.report.explain_page import sentence, write_page
from simbench.stage import stage
from simbench.stress.ledger import Ledger, Outcome

MOST_CAUSES = 16  # of which all sets of two are run


def run_explain(
    target: str,
    *,
    system: str | None,
    pipelines: tuple[str, ...],
    faults: tuple[str, ...],
    changes: tuple[str, ...],
    boxes: Boxes | None,
    seeds: tuple[int, ...] | None,
    chosen: tuple[str, ...],
    workers: int | None,
    out: Path,
    default_pipelines: tuple[str, ...],
) -> int:
    """The exit code: 0 all well, 1 a pipeline failed somewhere, 3 the bench did. Raises BadInput. `seeds`:
    None where none were given: 0-9 of a scenario, all of a run."""
    for name in pipelines:
        check_pipeline_name(name)
    if Path(target).is_dir():
        if faults or changes or boxes is not None:
            raise BadInput(f"{target} is a run: its faults, scenario and boxes are as they were")
        question = question_of_run(
            Path(target), system=system, pipelines=pipelines, seeds=seeds, chosen=chosen
        )
    else:
        question = question_of_scenario(
            target, system=system, pipelines=pipelines or default_pipelines, faults=faults, changes=changes,
            boxes=boxes, seeds=tuple(range(10)) if seeds is None else seeds, chosen=chosen,
        )  # fmt: skip
    if not question.causes:
        raise BadInput("there is nothing to explain: no fault is on")
    if len(question.causes) > MOST_CAUSES:
        raise BadInput(
            f"{len(question.causes)} causes are too many; name some by --cause",
            allowed=f"up to {MOST_CAUSES}",
        )
    for active in ((), question.causes):  # a bad combination costs one sentence and no time
        stage(question.job(question.seeds[0], active))
    prepare_folder(out)
    what = {
        "explain": target, "system": question.title, "causes": list(question.causes),
        "pipelines": list(question.pipelines), "faults": list(faults),
        "changes": list(changes), "boxes": boxes,
    }  # fmt: skip
    progress = _Progress(len(question.seeds))
    begun = time.perf_counter()
    with only_one(out), Ledger(out, what) as ledger:
        measured = Measured(question, ledger, workers or os.cpu_count() or 1, progress.done)
        progress.measured = measured
        found = answer(measured, progress.planned)
    wall_s = time.perf_counter() - begun
    click.echo(f"{question.title}. {sentence(question, found)}\n")
    for line in as_text(found):
        click.echo(line)
    write_text(out / "explain.csv", as_csv(found))
    page = write_page(
        question, found, measured.outcomes, out, command=join(["simbench", *sys.argv[1:]]), wall_s=wall_s,
        fresh=progress.count,
    )  # fmt: skip
    click.echo(f"report: {page}")
    return exit_code(outcome.status for outcome in measured.outcomes)


class _Progress:
    """A line on stderr for every recording, with the time left of its batch."""

    def __init__(self, seeds: int) -> None:
        self.count, self._seeds, self._fresh, self._begun, self._at = 0, seeds, 0, 0.0, 0
        self.measured: Measured | None = None

    def planned(self, masks: Sequence[int]) -> None:
        """Hear of the next batch of sets."""
        assert self.measured is not None
        self._fresh, self._at = self.measured.missing(masks), 0
        self._begun = time.perf_counter()
        there = len(masks) * self._seeds - self._fresh
        if there and self._fresh:
            click.echo(f"{there} of {len(masks) * self._seeds} recordings are there already", err=True)

    def done(self, outcomes: tuple[Outcome, ...]) -> None:
        """Hear of one recording."""
        self.count, self._at = self.count + 1, self._at + 1
        left_s = (time.perf_counter() - self._begun) / self._at * (self._fresh - self._at)
        on = ", ".join(map(str, outcomes[0].point)) or "no cause"
        statuses = ", ".join(sorted({outcome.status for outcome in outcomes}))
        words = f"[{self._at}/{self._fresh}] {on}, seed {outcomes[0].seed}: {statuses}"
        click.echo(f"{words} ({left_s / 60:.1f} min left)", err=True)
