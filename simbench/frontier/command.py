"""`simbench frontier`: check everything before anything runs, search along every axis, write."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from shlex import join
from typing import Any

import click

from scenarios.errors import Where
from scenarios.seeding import stream
from simbench.campaign.lock import only_one
from simbench.case import ORACLE, Boxes, Job
from simbench.files import prepare_folder, write_text
from simbench.frontier.question import Question, margins_of, questions
from simbench.frontier.requirements import Requirement, as_csv, as_yaml
from simbench.frontier.search import Goal, Margins, search
from simbench.isolate.ask import check_pipeline_name
from simbench.limits import parse_limits
from simbench.outcome import exit_code
from simbench.report.frontier_page import write_page
from simbench.report.stress_page import at
from simbench.stage import stage
from simbench.stress.axes import Axis, Point, parse_axes
from simbench.stress.ledger import Ledger, Outcome
from simbench.stress.plan import Plan, jobs_of
from simbench.stress.run import measure
from simbench.stress.table import as_csv as runs_as_csv

OPTION = "--along"


def run_frontier(
    scenario: str,
    axes: tuple[str, ...],
    limits: tuple[str, ...],
    goal: Goal,
    *,
    system: str | None,
    pipelines: tuple[str, ...],
    faults: tuple[str, ...],
    changes: tuple[str, ...],
    boxes: Boxes | None,
    seeds: tuple[int, ...],
    workers: int | None,
    out: Path,
) -> int:
    """The exit code: 0 all well, 1 a pipeline failed somewhere, 3 the bench did. Raises BadInput."""
    from scenarios.load import load_scenario

    parsed = parse_along(axes)
    deciding, asked = questions(pipelines, parse_limits(limits), goal.functional)
    for name in pipelines:
        check_pipeline_name(name)
    family = load_scenario(scenario, changes)
    template = Job(
        scenario=scenario, system=system or family.system_names[0], seed=0, pipelines=pipelines,
        faults=faults, boxes=boxes, changes=changes,
    )  # fmt: skip
    for axis in parsed:  # a bad combination costs one sentence and no time
        for _, job in jobs_of(_plan(axis, axis.ends), template, seeds[:1]):
            stage(job)
    prepare_folder(out)
    about = {
        "scenarios": [family.name], "system": template.system, "seeds": _ranges(seeds),
        "faults": list(faults), "changes": list(changes), "boxes": boxes or "model",
    }  # fmt: skip
    begun, found, statuses, count = time.perf_counter(), [], set[str](), 0
    with only_one(out), ExitStack() as held:
        for axis in parsed:
            bench = _Bench(
                axis, template, sorted(seeds), asked, _folder(out, axis), workers or os.cpu_count() or 1
            )
            held.enter_context(bench.ledger)
            answers = search(
                bench.measure,
                [question.key for question in deciding],
                goal,
                lambda key, name=axis.name: stream(0, "frontier", name, key),  # type: ignore[misc]
            )
            found += [
                Requirement(
                    axis=axis, question=q, goal=goal, found=answers[q.key], seeds=tuple(sorted(seeds))
                )
                for q in asked
            ]
            for item in found[-len(asked) :]:
                _tell(item)
            statuses |= {outcome.status for outcome in bench.outcomes}
            count += len(bench.outcomes) // (len(pipelines) + 1)
            write_text(bench.folder / "runs.csv", runs_as_csv((axis,), bench.outcomes))
    write_text(out / "requirements.yaml", as_yaml(found, about))
    write_text(out / "requirements.csv", as_csv(found, about))
    page = write_page(
        found, out, title=f"{family.name}, {template.system}", command=join(["simbench", *sys.argv[1:]]),
        cost=f"{count} recordings, {time.perf_counter() - begun:.0f} s now.",
    )  # fmt: skip
    click.echo(f"report: {page}")
    return exit_code(statuses)


def parse_along(arguments: Sequence[str]) -> tuple[Axis, ...]:
    """The axes that `--along` asks for: ranges that begin at 0 or above. BadInput: anything else."""
    where = Where(file=OPTION)
    for argument in arguments:
        if argument.count(":") > 1:
            raise where.error("the search chooses its levels: give NAME=LOW:HIGH, without a count")
    axes = parse_axes(arguments, OPTION)
    for axis in axes:
        if not axis.spread:
            raise where.error(
                f"{axis.name} is a list: a frontier needs numbers with others in between, LOW:HIGH"
            )
        if axis.ends[0] < 0.0:
            raise where.error(f"{axis.name} begins below 0: a frontier goes up from no error, as in 0:HIGH")
    return axes


def _ranges(seeds: Sequence[int]) -> str:
    """Seeds as `--seeds` takes them: 0-19 or 0-3,7."""
    parts: list[list[int]] = []
    for seed in sorted(seeds):
        if parts and seed == parts[-1][1] + 1:
            parts[-1][1] = seed
        else:
            parts.append([seed, seed])
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in parts)


def _tell(item: Requirement) -> None:
    click.echo(f"{item.axis.name}, {item.question.limit}: {item.sentence}")
    for words in (item.again, item.note):
        if words:
            click.echo(f"  {words}")


def _plan(axis: Axis, values: Sequence[float]) -> Plan:
    return Plan(axes=(axis,), points=tuple((value,) for value in values), design="grid")


def _folder(out: Path, axis: Axis) -> Path:
    folder = out / re.sub(r"[^A-Za-z0-9_.-]", "-", axis.name)
    prepare_folder(folder)
    return folder


class _Bench:
    """Measures levels of one axis, into its ledger."""

    def __init__(
        self, axis: Axis, template: Job, seeds: Sequence[int], asked: Sequence[Question], folder: Path,
        workers: int,
    ) -> None:  # fmt: skip
        self.axis, self.folder = axis, folder
        self.outcomes: list[Outcome] = []
        self._template, self._seeds, self._asked, self._workers = template, seeds, asked, workers
        what: dict[str, Any] = {
            "scenario": template.scenario, "system": template.system, "along": axis.name,
            "pipelines": list(template.pipelines), "faults": list(template.faults),
            "changes": list(template.changes), "boxes": template.boxes,
        }  # fmt: skip
        self.ledger = Ledger(folder, what)

    def measure(self, levels: Sequence[float]) -> Sequence[Margins]:
        """The margins of all runs at some levels (0 to 1 of the range)."""
        low, high = self.axis.ends
        plan = _plan(self.axis, [float(f"{low + level * (high - low):.6g}") for level in levels])
        tasks = jobs_of(plan, self._template, self._seeds)
        fresh = self.ledger.missing(tasks)
        if fresh < len(tasks):
            click.echo(f"{len(tasks) - fresh} of {len(tasks)} recordings are there already", err=True)
        begun, told = time.perf_counter(), [0]

        def done(outcomes: tuple[Outcome, ...]) -> None:
            told[0] += 1
            left_s = (time.perf_counter() - begun) / told[0] * (fresh - told[0])
            statuses = ", ".join(sorted({outcome.status for outcome in outcomes}))
            words = f"{at(plan.axes, outcomes[0].point)}, seed {outcomes[0].seed}: {statuses}"
            click.echo(f"[{told[0]}/{fresh}] {words} ({left_s / 60:.1f} min left in this round)", err=True)

        outcomes = measure(tasks, self.ledger, self._workers, done)
        self.outcomes += outcomes
        by_point: dict[Point, list[Outcome]] = {point: [] for point in plan.points}
        for outcome in outcomes:
            if outcome.pipeline != ORACLE or ORACLE in self._template.pipelines:
                by_point[outcome.point].append(outcome)
        return [margins_of(self._asked, by_point[point]) for point in plan.points]
