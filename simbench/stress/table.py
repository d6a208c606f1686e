"""A stress test's outcomes as numbers: combined over seeds by point, and one line each as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.seeding import stream
from simbench.score.statistics import Summary, summarize
from simbench.stress.axes import Axis, Point, shown
from simbench.stress.ledger import Outcome

METRICS = ("tpr", "precision", "recall", "mae_m.smooth", "gross_rate.smooth", "coverage.smooth")
"""What the page shows; the CSV has all."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One metric of one pipeline at one point. failed: runs without a score, which count as no success."""

    point: Point
    pipeline: str
    metric: str
    summary: Summary
    failed: int


def cells(outcomes: Sequence[Outcome], metrics: Sequence[str] = METRICS) -> tuple[Cell, ...]:
    """Every point x pipeline x metric, in the order in which they were measured."""
    groups: dict[tuple[Point, str], list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault((outcome.point, outcome.pipeline), []).append(outcome)
    found = []
    for (point, pipeline), members in groups.items():
        failed = sum(member.status != "ok" for member in members)
        for metric in metrics:
            values = {member.seed: member.values.get(metric) for member in members}
            rng = stream(0, "stress", pipeline, metric, *(shown(value) for value in point))
            found.append(
                Cell(
                    point=point,
                    pipeline=pipeline,
                    metric=metric,
                    summary=summarize(values, rng),
                    failed=failed,
                )
            )
    return tuple(found)


def worst(outcomes: Sequence[Outcome], pipeline: str, count: int = 5) -> tuple[Outcome, ...]:
    """A pipeline's worst runs: those that failed first, then by precision, then by the error of its path."""

    def badness(outcome: Outcome) -> tuple[bool, float, float]:
        precision, error = outcome.values.get("precision"), outcome.values.get("mae_m.smooth")
        return (
            outcome.status == "ok",
            -1.0 if precision is None else precision,
            -float("inf") if error is None else -error,
        )

    return tuple(sorted((o for o in outcomes if o.pipeline == pipeline), key=badness)[:count])


def as_csv(axes: Sequence[Axis], outcomes: Sequence[Outcome]) -> str:
    """One line per outcome and metric."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*(axis.name for axis in axes), "seed", "pipeline", "status", "metric", "value"])
    for outcome in outcomes:
        for metric, value in outcome.values.items():
            number = "" if value is None else repr(value)
            writer.writerow(
                [*map(shown, outcome.point), outcome.seed, outcome.pipeline, outcome.status, metric, number]
            )
    return text.getvalue()
