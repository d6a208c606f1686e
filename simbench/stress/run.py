"""Running a plan: what a worker gives back of each recording is a few numbers, not the recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from scenarios.faults.motion import SHAKERS
from simbench.campaign import each_of
from simbench.case import Job, JobResult
from simbench.results import reproduce
from simbench.run import run_job
from simbench.stress.axes import Point
from simbench.stress.ledger import Ledger, Outcome

SHAKING = tuple(spec.name for spec in SHAKERS)


def outcomes_of(task: tuple[Point, Job]) -> tuple[Outcome, ...]:
    """All pipelines and the oracle on one recording."""
    point, job = task
    return summarised(point, run_job(job))


def summarised(point: Point, result: JobResult) -> tuple[Outcome, ...]:
    """The numbers of a result."""
    job = result.job
    return tuple(
        Outcome(
            point=point,
            seed=job.seed,
            pipeline=case.pipeline,
            status=case.status,
            why=case.why,
            values={row.metric: row.value for row in case.rows},
            command=reproduce(job, job.pipelines if case.pipeline == "oracle" else (case.pipeline,)),
            seconds=dict(result.timings_s),
        )
        for case in result.cases
    )


def _drive(job: Job) -> tuple[int, tuple[str, ...], tuple[str, ...]]:
    """What makes the sweeps of a job (`simbench/reuse.py`): jobs that share them come one after the other."""
    return job.seed, job.changes, tuple(text for text in job.faults if text.startswith(SHAKING))


def measure(
    tasks: Sequence[tuple[Point, Job]],
    ledger: Ledger,
    workers: int,
    done: Callable[[tuple[Outcome, ...]], None] = lambda _: None,
) -> tuple[Outcome, ...]:
    """Run what the ledger does not hold yet; the outcomes of all tasks, in their order."""
    missing = sorted(
        (task for task in tasks if (task[0], task[1].seed) not in ledger.done),
        key=lambda task: _drive(task[1]),
    )
    for outcomes in each_of(outcomes_of, missing, workers):
        ledger.add(outcomes)
        done(outcomes)
    return tuple(outcome for point, job in tasks for outcome in ledger.done[(point, job.seed)])
