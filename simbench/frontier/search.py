"""The search: levels that fill the range, then one after another where it matters, all questions on the same
recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from simbench.frontier.choose import EXTRA, START, next_level, start_levels
from simbench.frontier.crossing import LEVEL, Answer, answer
from simbench.frontier.curve import Curve, Functional
from simbench.frontier.logistic import logistic_curve
from simbench.frontier.mean import mean_curve
from simbench.frontier.share import share_curve

Margins = Mapping[str, Sequence[float]]
"""By question and in the order of the seeds: by how much a run meets its limit, below 0 where it does not."""

Measure = Callable[[Sequence[float]], Sequence[Margins]]
"""The runs at some levels (0 to 1): for each level the margins of all its runs."""


@dataclass(frozen=True, kw_only=True)
class Goal:
    """functional: what must keep the limit; share: of the runs that must meet it; monotone: it only falls."""

    functional: Functional = "share"
    share: float = 0.9
    monotone: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """A question's answer, with what it rests on."""

    levels: Float64[np.ndarray, " k"]
    margins: Float64[np.ndarray, "k n"]
    curve: Curve
    answer: Answer


def curve_of(levels: Float64[np.ndarray, " k"], margins: Float64[np.ndarray, "k n"], goal: Goal) -> Curve:
    """The curve of a goal through what was measured."""
    if goal.functional == "mean":
        return mean_curve(levels, margins)
    fit = logistic_curve if goal.monotone else share_curve
    return fit(levels, margins >= 0.0, goal.share)


def search(
    measure: Measure,
    deciding: Sequence[str],
    goal: Goal,
    stream_of: Callable[[str], np.random.Generator],
    *,
    start: int = START,
    extra: int = EXTRA,
) -> Mapping[str, Found]:
    """The answers to all questions that `measure` knows. deciding: those that choose levels, each at most
    `extra`. stream_of: what a question's bootstrap draws from."""
    first = start_levels(start)
    known = dict(zip(first, measure(first), strict=True))
    for _ in range(extra):
        wanted: dict[float, None] = {}
        for question in deciding:
            levels, margins = _table(known, question)
            level = next_level(levels, curve_of(levels, margins, goal))
            if level is not None:
                wanted[level] = None
        if not wanted:
            break
        known.update(zip(wanted, measure(tuple(wanted)), strict=True))
    return {question: _found(known, question, goal, stream_of(question)) for question in known[first[0]]}


def _found(known: Mapping[float, Margins], question: str, goal: Goal, rng: np.random.Generator) -> Found:
    levels, margins = _table(known, question)
    curve = curve_of(levels, margins, goal)
    found = answer(curve, rng)
    if goal.functional == "share" and (margins >= 0.0).all() and shown_share(margins.shape[1]) < goal.share:
        found = replace(found, safe_to=None, interval=None)
    return Found(levels=levels, margins=margins, curve=curve, answer=found)


def shown_share(n: int) -> float:
    """The share of all runs that n runs without a failure show at 95 % (Clopper-Pearson)."""
    return float((1.0 - LEVEL) ** (1.0 / n))


def runs_for(share: float) -> int:
    """How many runs without a failure show a share at 95 %."""
    return int(np.ceil(np.log(1.0 - LEVEL) / np.log(share)))


def _table(
    known: Mapping[float, Margins], question: str
) -> tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, "k n"]]:
    levels = sorted(known)
    return np.array(levels), np.array([known[level][question] for level in levels], dtype=np.float64)
