"""One metric in one group of runs: PASS, REGRESSION, INCONCLUSIVE or ERROR.

D = new - old, turned so that higher is better; d > 0 is the margin that was declared beforehand. PASS: D's
one-sided lower bound lies above -d. REGRESSION: its upper bound lies below -d. Neither: INCONCLUSIVE. ERROR:
there is nothing to compare, or the new version has no value where the old one had one.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from simbench.score.statistics import MIN_RUNS, SIGN_FLIP_RUNS, sign_flip_p
from simbench.verdict.bounds import Bounds, Method, bounds
from simbench.verdict.differences import Better, Differences, Values, differences, runs
from simbench.verdict.nested import SCENARIOS, nested_bounds

Verdict: TypeAlias = Literal["ERROR", "REGRESSION", "INCONCLUSIVE", "PASS"]
WORST_FIRST: tuple[Verdict, ...] = ("ERROR", "REGRESSION", "INCONCLUSIVE", "PASS")

ALPHA = 0.05
MARGIN = 0.05


@dataclass(frozen=True, kw_only=True)
class SignFlip:
    """Exact p that signs of D + d say about "D <= -d" (`passing`) and "D >= -d" (`regression`), if D is
    symmetric."""

    passing: float
    regression: float


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """A verdict and what it rests on.

    old, new: means over the n runs that both have, as the metric counts. difference: mean of D; low, high:
    its one-sided bounds at alpha each, None without. p_pass: p of "D <= -d"; p_regression: p of "D >= -d";
    None without bounds. sign_flip: from 6 to 20 runs. note: what a reader must know, None: nothing.
    """

    verdict: Verdict
    better: Better
    margin: float
    alpha: float
    n: int
    method: Method
    old: float | None
    new: float | None
    difference: float | None
    low: float | None = None
    high: float | None = None
    p_pass: float | None = None
    p_regression: float | None = None
    sign_flip: SignFlip | None = None
    note: str | None = None

    @property
    def beyond(self) -> float:
        """By how much the loss exceeds the margin, in margins: what orders a list; below 0 inside of it."""
        return -np.inf if self.difference is None else -self.difference / self.margin - 1.0


def judge(
    old: Values, new: Values, *, better: Better, margin: float = MARGIN, alpha: float = ALPHA,
    rng: np.random.Generator, identical: bool = False, scenario_of: Callable[[Hashable], str] | None = None,
) -> Judgement:  # fmt: skip
    """Compare two versions run by run.

    margin: in the metric's unit. identical: all outputs of both versions have the same hash. scenario_of: the
    scenario of a run's key, where 20 or more are a sample of all that may happen; scenarios weigh the same
    then. None: they are fixed. ValueError: a value is not finite, the margin is not above 0, or alpha not
    between 0 and 0.5.
    """
    if not (np.isfinite(margin) and margin > 0.0):
        raise ValueError(f"a margin is a finite number above 0, not {margin}")
    if not 0.0 < alpha < 0.5:
        raise ValueError(f"alpha lies between 0 and 0.5, not {alpha}")
    paired = differences(old, new, better)
    n = len(paired.d)
    blank = Judgement(
        verdict="ERROR", better=better, margin=margin, alpha=alpha, n=n, method="none", old=paired.old,
        new=paired.new, difference=float(paired.d.mean()) if n else None,
    )  # fmt: skip
    wrong = _wrong(paired, identical)
    if wrong:
        return replace(blank, note=wrong)
    if identical:
        return replace(blank, verdict="PASS", method="identical", note="identical")
    if scenario_of is not None:
        return _over_scenarios(blank, paired, scenario_of, rng)
    said = bounds(paired.d, rng)
    if said is None:
        few = f"n = {n} run{'' if n == 1 else 's'}: illustration"
        return replace(blank, verdict="INCONCLUSIVE", note=_join(few, *_uneven(paired)))
    return _decided(blank, paired, said)


def _over_scenarios(
    blank: Judgement, paired: Differences, scenario_of: Callable[[Hashable], str], rng: np.random.Generator
) -> Judgement:
    of: dict[str, list[float]] = {}
    for run, d in zip(paired.keys, paired.d, strict=True):
        of.setdefault(scenario_of(run), []).append(float(d))
    if len(of) < SCENARIOS:
        return replace(blank, note=f"only {len(of)} scenarios have a value on both sides")
    values = [np.array(some) for some in of.values()]
    mean = float(np.mean([some.mean() for some in values]))
    return _decided(replace(blank, difference=mean), paired, nested_bounds(values, rng))


def _wrong(paired: Differences, identical: bool) -> str | None:
    if paired.lost:
        return f"{runs(paired.lost)} lost the value that the old version had"
    if not len(paired.d):
        return "no samples: no run has a value on both sides"
    if identical and paired.d.any():
        return "outputs are identical but values are not: the metric or the bench changed"
    return None


def _decided(blank: Judgement, paired: Differences, said: Bounds) -> Judgement:
    d, alpha, n = blank.margin, blank.alpha, blank.n
    low, high = said.lower(alpha), said.upper(alpha)
    flips = None
    if MIN_RUNS <= n <= SIGN_FLIP_RUNS:
        flips = SignFlip(
            passing=sign_flip_p(paired.d + d, "greater"), regression=sign_flip_p(paired.d + d, "less")
        )
    verdict: Verdict = "PASS" if low > -d else "REGRESSION" if high < -d else "INCONCLUSIVE"
    notes = _uneven(paired)
    if verdict == "PASS" and high < 0.0:
        notes.insert(0, "a loss, inside the margin")
    if flips and (
        (verdict == "PASS" and flips.passing > alpha)
        or (verdict == "REGRESSION" and flips.regression > alpha)
    ):
        notes.append("the sign-flip test does not agree")
    if (paired.d == paired.d[0]).all():
        notes.append(
            f"all differences are equal; up to {1.0 - alpha ** (1.0 / n):.0%} of runs may still differ"
        )
    return replace(
        blank, verdict=verdict, method=said.method, low=low, high=high, p_pass=said.p_at_most(-d),
        p_regression=said.p_at_least(-d), sign_flip=flips, note=_join(*notes),
    )  # fmt: skip


def _uneven(paired: Differences) -> list[str]:
    said = (
        (paired.missing, "without a value on either side"),
        (paired.gained, "with a new value only"),
        (paired.only_old, "of the old version only"),
        (paired.only_new, "of the new version only"),
    )
    return [f"{runs(keys)} {words} left out" for keys, words in said if keys]


def _join(*notes: str) -> str | None:
    return "; ".join(notes) or None
