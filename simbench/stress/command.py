"""`simbench stress`: check everything before anything runs, measure, write."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from shlex import join
from typing import cast

import click

from simbench.campaign.executor import check_cluster
from simbench.campaign.lock import only_one
from simbench.case import Boxes, Job
from simbench.files import prepare_folder, write_text
from simbench.isolate.ask import check_pipeline_name
from simbench.outcome import exit_code
from simbench.progress import Progress
from simbench.report.stress_page import at, write_page
from simbench.stage import stage
from simbench.stress.axes import parse_axes
from simbench.stress.ledger import Ledger, Outcome, Task
from simbench.stress.plan import Design, Plan, grid, jobs_of, scattered
from simbench.stress.run import measure
from simbench.stress.table import as_csv


def run_stress(
    scenario: str,
    axes: tuple[str, ...],
    *,
    design: str,
    points: int,
    system: str | None,
    pipelines: tuple[str, ...],
    faults: tuple[str, ...],
    changes: tuple[str, ...],
    boxes: Boxes | None,
    seeds: tuple[int, ...],
    workers: int | None,
    cluster: str | None,
    out: Path,
) -> int:
    """The exit code: 0 all well, 1 a pipeline failed somewhere, 3 the bench did. Raises BadInput."""
    from scenarios.load import load_scenario

    check_cluster(cluster)
    parsed = parse_axes(axes)
    plan = grid(parsed) if design == "grid" else scattered(parsed, points, cast(Design, design))
    for name in pipelines:
        check_pipeline_name(name)
    family = load_scenario(scenario, changes)
    template = Job(
        scenario=scenario, system=system or family.system_names[0], seed=0, pipelines=pipelines,
        faults=faults, boxes=boxes, changes=changes,
    )  # fmt: skip
    tasks = jobs_of(plan, template, seeds)
    for point in (plan.points[0], plan.points[-1]):  # a bad combination costs one sentence and no time
        stage(next(job for other, job in tasks if other == point))
    prepare_folder(out)
    what = {
        "scenario": scenario, "system": template.system, "axes": list(axes), "design": design,
        "points": len(plan.points), "pipelines": list(pipelines), "faults": list(faults),
        "changes": list(changes), "boxes": boxes,
    }  # fmt: skip
    with only_one(out), Ledger(out, what) as ledger:
        return _measured(plan, tasks, ledger, workers or os.cpu_count() or 1, cluster, out, family.name)


def _measured(
    plan: Plan, tasks: Sequence[Task], ledger: Ledger, workers: int, cluster: str | None, out: Path, name: str
) -> int:
    """Measure what is missing, write all; the exit code."""
    fresh = ledger.missing(tasks)
    begun, progress = time.perf_counter(), Progress(total=fresh)
    if fresh < len(tasks):
        click.echo(f"{len(tasks) - fresh} of {len(tasks)} recordings are there already", err=True)

    def done(outcomes: tuple[Outcome, ...]) -> None:
        statuses = ", ".join(sorted({outcome.status for outcome in outcomes}))
        progress.say(f"{at(plan.axes, outcomes[0].point)}, seed {outcomes[0].seed}: {statuses}")

    unused = len(ledger.rows) - (len(tasks) - fresh)
    if unused:
        click.echo(f"{unused} others there are of other seeds, files or code: not used", err=True)
    outcomes = measure(tasks, ledger, workers, done, cluster)
    wall_s = time.perf_counter() - begun
    write_text(out / "stress.csv", as_csv(plan.axes, outcomes))
    page = write_page(
        plan, outcomes, {(point, job.seed): job for point, job in tasks}, out,
        title=f"{name}, {tasks[0][1].system}", command=join(["simbench", *sys.argv[1:]]),
        wall_s=wall_s, fresh=fresh,
    )  # fmt: skip
    click.echo(f"report: {page}")
    return exit_code(outcome.status for outcome in outcomes)
