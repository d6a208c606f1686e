"""What is asked of every pipeline, and what a recording's outcomes answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from simbench.frontier.curve import Functional
from simbench.frontier.search import Margins
from simbench.limits import Limit
from simbench.stress.ledger import Outcome


@dataclass(frozen=True, kw_only=True)
class Question:
    """How far a pipeline keeps some limits, all of them at once."""

    pipeline: str
    limits: tuple[Limit, ...]

    @property
    def key(self) -> str:
        return f"{self.pipeline}: {self.limit}"

    @property
    def limit(self) -> str:
        """All limits as they are written."""
        return " and ".join(limit.text for limit in self.limits)

    def margin(self, outcome: Outcome) -> float:
        """By how much a run keeps the limit that it keeps worst. A run that failed keeps none."""
        well = outcome.status == "ok"
        return min(
            limit.margin(outcome.values.get(limit.metric.name) if well else None) for limit in self.limits
        )


def questions(
    pipelines: Sequence[str], limits: Sequence[Limit], functional: Functional
) -> tuple[tuple[Question, ...], tuple[Question, ...]]:
    """Those that choose levels, and all. Of a share: a run must keep all limits at once, and each alone is
    told too. Means are of one metric each: every limit chooses."""
    each = tuple(Question(pipeline=p, limits=(limit,)) for p in pipelines for limit in limits)
    if functional == "mean" or len(limits) == 1:
        return each, each
    together = tuple(Question(pipeline=p, limits=tuple(limits)) for p in pipelines)
    return together, (*together, *each)


def margins_of(asked: Sequence[Question], outcomes: Sequence[Outcome]) -> Margins:
    """The margins of one level's outcomes, in the order of their seeds."""
    runs: Mapping[tuple[str, int], Outcome] = {(o.pipeline, o.seed): o for o in outcomes}
    seeds = sorted({outcome.seed for outcome in outcomes})
    return {q.key: [q.margin(runs[q.pipeline, seed]) for seed in seeds] for q in asked}
