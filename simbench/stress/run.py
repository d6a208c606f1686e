"""Running a plan: what a worker gives back of each recording is a few numbers, not the recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from scenarios.faults.motion import SHAKERS
from simbench.campaign.executor import open_executor
from simbench.campaign.ledger import Done
from simbench.campaign.run import campaign
from simbench.case import Job, JobResult
from simbench.results import reproduce
from simbench.run import run_job
from simbench.stress.axes import Point
from simbench.stress.ledger import Ledger, Outcome, Task, as_text, key_of

SHAKING = tuple(spec.name for spec in SHAKERS)


def outcomes_of(task: Task) -> tuple[Outcome, ...]:
    """All pipelines and the oracle on one recording."""
    point, job = task
    return summarised(point, run_job(job))


def row_of(task: Task) -> str:
    """The same as the text that the ledger keeps."""
    return as_text(outcomes_of(task))


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
    tasks: Sequence[Task],
    ledger: Ledger,
    workers: int,
    done: Callable[[tuple[Outcome, ...]], None] = lambda _: None,
    cluster: str | None = None,
) -> tuple[Outcome, ...]:
    """Run what the ledger does not hold yet; the outcomes of all tasks, in their order."""
    ordered = sorted(tasks, key=lambda task: _drive(task[1]))
    keys = {key_of(task): task for task in ordered}

    def told(row: Done) -> None:
        done(ledger.outcomes(keys[row.key], row))

    useful = max(1, min(workers, ledger.missing(ordered)))
    with open_executor(useful, cluster if ledger.missing(ordered) else None) as executor:
        rows = {row.key: row for row in campaign(row_of, ordered, key_of, executor, ledger.rows, told)}
    return tuple(outcome for task in tasks for outcome in ledger.outcomes(task, rows[key_of(task)]))
