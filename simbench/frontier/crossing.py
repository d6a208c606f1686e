"""From a curve to its answer: the first crossing from zero, its bound and interval, and what comes after.

The bound is a test turned round: "safe to" is the first level, walking down from the best estimate, at which
the curve's lower 95 % bound keeps the limit. Bounds are margin - t x error with t the 95 % point of the
studentised bootstrap over seeds at the best estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from simbench.frontier.curve import GRID, Curve
from simbench.score.statistics import MIN_RUNS

LEVEL = 0.95


@dataclass(frozen=True, kw_only=True)
class Answer:
    """How far along an axis (0 to 1) a limit holds.

    best: the first crossing from zero; None: not within the range. safe_to: its lower 95 % bound; None: fewer
    than 6 runs, or not shown anywhere. interval: two-sided 95 %, an upper end of None lies beyond the range.
    again: where the limit holds once more after it was broken, by the best estimate. factors: what times the
    error is taken off the margin for the low and the high end of its 95 % band.
    """

    best: float | None
    safe_to: float | None
    interval: tuple[float, float | None] | None
    again: tuple[tuple[float, float], ...]
    factors: tuple[float, float] | None

    @property
    def broken_at_start(self) -> bool:
        return self.best == 0.0


def answer(curve: Curve, rng: np.random.Generator) -> Answer:
    """The answer of a curve."""
    best = first_below(curve.margin)
    again = met_again(curve.margin)
    if len(curve.influence) < MIN_RUNS:
        return Answer(best=best, safe_to=None, interval=None, again=again, factors=None)
    error = curve.error
    if best is None:
        place = int(np.argmin(curve.margin / np.maximum(error, 1e-300)))
    else:
        place = int(np.argmin(np.abs(GRID - best)))
    pivots, tail = curve.pivots(place, rng), 0.5 * (1.0 - LEVEL)
    one = float(np.quantile(pivots, LEVEL))
    low, high = (float(np.quantile(pivots, q)) for q in (1.0 - tail, tail))
    safe = last_kept(curve.margin - one * error, best)
    floor = last_kept(curve.margin - low * error, best)
    roof = first_below(curve.margin - high * error)
    return Answer(
        best=best,
        safe_to=safe,
        interval=(0.0 if floor is None else floor, roof),
        again=again,
        factors=(low, high),
    )


def first_below(margin: Float64[np.ndarray, " m"]) -> float | None:
    """Where a curve on `GRID` first falls below 0; 0.0 where it starts there, None where it never does."""
    below = np.flatnonzero(margin < 0.0)
    if len(below) == 0:
        return None
    return _zero(margin, int(below[0]) - 1) if below[0] > 0 else 0.0


def last_kept(bound: Float64[np.ndarray, " m"], best: float | None) -> float | None:
    """Walking down from `best` (None: from the end), where a bound first is at least 0; None: nowhere."""
    kept = np.flatnonzero((bound >= 0.0) & (GRID <= (1.0 if best is None else best)))
    if len(kept) == 0:
        return None
    place = int(kept[-1])
    if place == len(GRID) - 1:
        return 1.0
    end = _zero(bound, place) if bound[place + 1] < 0.0 else float(GRID[place + 1])
    return end if best is None else min(end, best)


def met_again(margin: Float64[np.ndarray, " m"]) -> tuple[tuple[float, float], ...]:
    """Stretches after the first crossing in which the limit holds once more."""
    kept = margin >= 0.0
    starts = np.flatnonzero(~kept[:-1] & kept[1:])
    found = []
    for start in starts.tolist():
        after = np.flatnonzero(~kept[start + 1 :])
        end = 1.0 if len(after) == 0 else _zero(margin, start + int(after[0]))
        found.append((_zero(margin, start), end))
    return tuple(found)


def _zero(margin: Float64[np.ndarray, " m"], left: int) -> float:
    """Where the line between a place and the next is 0."""
    a, b = float(margin[left]), float(margin[left + 1])
    return float(GRID[left] + (GRID[left + 1] - GRID[left]) * a / (a - b))
