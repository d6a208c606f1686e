"""The table that is explained: one loss for every set of causes and every run, measured as it is asked
for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64

from simbench.explain.causes import Question
from simbench.explain.dividends import members
from simbench.score.metrics import METRICS as DEFINED
from simbench.stress.ledger import Ledger, Outcome
from simbench.stress.run import measure

METRICS = ("precision", "mae_m.smooth", "mae_m.raw", "mae_m.smooth.gnss", "gross_rate.smooth")
BETTER = {metric.name: metric.better for metric in DEFINED}
WORST = {"precision": 0.0, "gross_rate.smooth": 1.0}
"""What a pipeline that failed counts as; an error in metres has no worst."""


class Measured:
    """What was measured so far. A point of the ledger is the names of the causes that are on."""

    def __init__(
        self,
        question: Question,
        ledger: Ledger,
        workers: int = 1,
        done: Callable[[tuple[Outcome, ...]], None] = lambda _: None,
    ) -> None:
        self.question = question
        self._ledger, self._workers, self._done = ledger, workers, done
        self._found: dict[tuple[int, int, str], Outcome] = {}

    def missing(self, masks: Sequence[int]) -> int:
        """How many recordings these sets need that the ledger does not hold."""
        points = [members(mask, self.question.causes) for mask in masks]
        return self._ledger.missing((p, self.question.job(s, p)) for p in points for s in self.question.seeds)

    def measure(self, masks: Sequence[int]) -> None:
        """Run these sets with every seed, where that is not known yet."""
        fresh = [
            mask for mask in dict.fromkeys(masks) if (mask, self.question.seeds[0], "") not in self._found
        ]
        sets = {members(mask, self.question.causes): mask for mask in fresh}
        tasks = [(p, self.question.job(seed, p)) for p in sets for seed in self.question.seeds]
        for outcome in measure(tasks, self._ledger, self._workers, self._done):
            active = tuple(str(name) for name in outcome.point)
            self._found[(sets[active], outcome.seed, outcome.pipeline)] = outcome
            self._found[(sets[active], outcome.seed, "")] = outcome

    @property
    def masks(self) -> tuple[int, ...]:
        """The sets that were measured."""
        return tuple(sorted({mask for mask, _, _ in self._found}))

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """All of them, once."""
        return tuple(outcome for (_, _, name), outcome in self._found.items() if name)

    def losses(self, pipeline: str, metric: str, masks: Sequence[int]) -> Float64[np.ndarray, "m r"]:
        """Row by set, column by seed; higher is worse; NaN without a value."""
        sign = -1.0 if BETTER[metric] == "higher" else 1.0
        return np.array(
            [
                [
                    sign * _number(value_of(self._found[(mask, seed, pipeline)], metric))
                    for seed in self.question.seeds
                ]
                for mask in masks
            ]
        ).reshape(len(masks), len(self.question.seeds))

    def raw(self, pipeline: str, metric: str, mask: int) -> dict[int, float | None]:
        """A metric as it is, by seed, for one set."""
        return {s: value_of(self._found[(mask, s, pipeline)], metric) for s in self.question.seeds}


def value_of(outcome: Outcome, metric: str) -> float | None:
    """A failed pipeline has the worst value where there is one; a recording that the bench made wrongly
    none."""
    if outcome.status in ("pipeline_error", "timeout"):
        return WORST.get(metric)
    return outcome.values.get(metric) if outcome.status == "ok" else None


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
