"""What a stress test has measured so far, in the words of a stress test: a campaign's ledger, one row per
recording."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scenarios.errors import BadInput
from simbench.campaign.job_key import job_key
from simbench.campaign.ledger import NAME as NAME
from simbench.campaign.ledger import Done
from simbench.campaign.ledger import Ledger as Rows
from simbench.case import ORACLE, Job
from simbench.score.metrics import METRICS
from simbench.stress.axes import Point, Value

Task = tuple[Point, Job]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One pipeline on one recording. values: by metric, None where there is none. seconds: of the recording,
    by part of the flow, the same for all of its pipelines."""

    point: Point
    seed: int
    pipeline: str
    status: str
    why: str | None
    values: Mapping[str, float | None]
    command: str
    seconds: Mapping[str, float]


class Ledger:
    """A ledger in a folder. BadInput: the one that lies there belongs to another test, or is damaged."""

    def __init__(self, folder: Path, what: Mapping[str, Any]) -> None:
        self.rows = Rows(folder, what, kind="stress test")

    def __enter__(self) -> Ledger:
        return self

    def __exit__(self, *_: object) -> None:
        self.rows.close()

    def __contains__(self, task: Task) -> bool:
        """Whether it holds a recording, made by this code and of these files."""
        return key_of(task) in self.rows

    def missing(self, tasks: Iterable[Task]) -> int:
        """How many recordings it does not hold."""
        return sum(task not in self for task in tasks)

    def add(self, task: Task, outcomes: tuple[Outcome, ...]) -> None:
        """Keep the outcomes of one recording."""
        self.rows.add(Done(key=key_of(task), value=as_text(outcomes)), len(self.rows))

    def outcomes(self, task: Task, row: Done) -> tuple[Outcome, ...]:
        """What a row says of a recording. One without an answer is a failure of the bench in all of its
        pipelines. BadInput: the row is of something else."""
        if row.value is None:
            return _failed(task, row)
        try:
            return tuple(_outcome(entry) for entry in json.loads(row.value))
        except (ValueError, TypeError, KeyError) as error:
            raise BadInput(f"{self.rows.path}: a row is no outcome of a stress test") from error


def key_of(task: Task) -> str:
    """The key of a recording."""
    point, job = task
    return job_key(job, point=point)


def as_text(outcomes: tuple[Outcome, ...]) -> str:
    """The JSON text of a row."""
    return json.dumps([asdict(outcome) for outcome in outcomes], allow_nan=False)


def _failed(task: Task, row: Done) -> tuple[Outcome, ...]:
    point, job = task
    return tuple(
        Outcome(
            point=point,
            seed=job.seed,
            pipeline=name,
            status="timeout" if row.status == "timeout" else "bench_error",
            why=row.failure,
            values={metric.name: None for metric in METRICS},
            command=_command(job, name),
            seconds={},
        )
        for name in (*job.pipelines, ORACLE)
    )


def _command(job: Job, pipeline: str) -> str:
    from simbench.results import reproduce

    return reproduce(job, job.pipelines if pipeline == ORACLE else (pipeline,))


def _outcome(entry: Mapping[str, Any]) -> Outcome:
    point: tuple[Value, ...] = tuple(entry["point"])
    return Outcome(**{**entry, "point": point})
