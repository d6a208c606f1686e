"""Synthetic curves whose first crossing is known, and what a dense grid makes of the same runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.special import expit, ndtri

from scenarios.seeding import stream
from simbench.frontier.crossing import Answer
from simbench.frontier.curve import Functional
from simbench.frontier.search import Goal, Margins, search

LIMIT, SD, SHARE = 0.9, 0.03, 0.9
ALONE = 0.2  # share of a run's variance that no other level of its seed has
TURN = 0.5 * np.pi / 2  # how much what a seed does changes from one end to the other, in rad
QUESTION = "limit"

CURVES: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "monotone": lambda x: 1.0 - 0.25 * x**2,
    "dip": lambda x: 0.98 - 0.2 * np.exp(-(((x - 0.45) / 0.1) ** 2)),
    "plateau": lambda x: 0.99 - 0.03 * expit((x - 0.25) / 0.05) - 0.2 * expit((x - 0.75) / 0.05),
    "never crosses": lambda x: 0.99 - 0.02 * x,
}
"""The mean of a metric of which more is better, along the range from 0 to 1."""


def truth(curve: str, functional: Functional) -> float | None:
    """Where the functional first falls below its limit; None: nowhere."""
    x = np.linspace(0.0, 1.0, 1_000_001)
    least = LIMIT + (SD * float(ndtri(SHARE)) if functional == "share" else 0.0)
    below = np.flatnonzero(CURVES[curve](x) < least)
    return float(x[below[0]]) if len(below) else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """n runs a level: normal around the curve with the same SD everywhere, most of it the seed's own."""

    curve: str
    seed: int
    parts: Float64[np.ndarray, "2 n"]

    def values(self, levels: Sequence[float]) -> Float64[np.ndarray, "k n"]:
        x = np.asarray(levels, dtype=np.float64)[:, None]
        own = np.cos(TURN * x) * self.parts[0] + np.sin(TURN * x) * self.parts[1]
        alone = np.stack([self._alone(level) for level in levels])
        scatter = np.sqrt(1.0 - ALONE) * own + np.sqrt(ALONE) * alone
        return CURVES[self.curve](x) + SD * np.asarray(scatter)

    def measure(self, levels: Sequence[float]) -> Sequence[Margins]:
        return [{QUESTION: row.tolist()} for row in self.values(levels) - LIMIT]

    def _alone(self, level: float) -> Float64[np.ndarray, " n"]:
        rng = stream(self.seed, "frontier", "alone", f"{level:.6g}")
        return np.asarray(rng.normal(size=self.parts.shape[1]))


def bench(curve: str, trial: int, runs: int) -> Bench:
    """The runs of a trial: the same ones whatever is asked."""
    parts = stream(trial, "frontier", "seeds", curve).normal(size=(2, runs))
    return Bench(curve=curve, seed=trial, parts=parts)


def trial_of(curve: str, goal: Goal, trial: int, runs: int) -> tuple[Answer, Sequence[float]]:
    """What the search answers, and from which levels."""
    found = search(
        bench(curve, trial, runs).measure,
        (QUESTION,),
        goal,
        lambda question: stream(trial, "frontier", "bootstrap", question),
    )[QUESTION]
    return found.answer, found.levels.tolist()


def on_a_grid(curve: str, functional: Functional, trial: int, runs: int, count: int) -> float:
    """Without a model: the first of `count` even levels that breaks the limit, and the line to the one
    before; 1.0 where none does."""
    levels = np.linspace(0.0, 1.0, count)
    values = bench(curve, trial, runs).values(levels.tolist())
    if functional == "share":
        margin = (values >= LIMIT).mean(axis=1) - SHARE
    else:
        margin = values.mean(axis=1) - LIMIT
    below = np.flatnonzero(margin < 0.0)
    if len(below) == 0:
        return 1.0
    i = int(below[0])
    if i == 0:
        return 0.0
    return float(levels[i - 1] + (levels[i] - levels[i - 1]) * margin[i - 1] / (margin[i - 1] - margin[i]))
