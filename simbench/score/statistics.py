"""Statistics over runs. The unit is the run: every run's value weighs the same, frames of a pass are never
pooled.

| runs | interval | p of paired differences |
|---|---|---|
| < 6 | none: points and range only | none |
| 6-19 | Student t, 95 % | exact sign-flip |
| >= 20 | BCa bootstrap over runs, 95 % | exact sign-flip at n = 20, none above |

BCa: Efron & Tibshirani, An Introduction to the Bootstrap, 1993, ch. 14. Sign flip: Fisher 1935; under the
null the signs of the differences are exchangeable. The paper's t-tests (`paired_t`, `one_sample_t`) treat
frames as independent; they stand here to recompute its Tables II and III, not to decide anything.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
from jaxtyping import Float64
from scipy.special import ndtr, ndtri, stdtr, stdtrit  # scipy.stats takes half a second to import

MIN_RUNS = 6
BOOTSTRAP_RUNS = 20
SIGN_FLIP_RUNS = 20
RESAMPLES = 9999
AT_ONCE = 4_000_000  # values drawn at a time

Alternative = Literal["two-sided", "greater", "less"]
Run = TypeVar("Run", bound=Hashable)


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Equal-weight mean over runs. `points`: the runs' values; `low`, `high`: their range; `missing`: runs
    without one.

    `ci95` is None below 6 runs, `method` says how it was made ("none", "t", "bca"), `note` what to print with
    it.
    """

    mean: float | None
    sd: float | None
    n: int
    missing: int
    low: float | None
    high: float | None
    points: tuple[float, ...]
    ci95: tuple[float, float] | None
    method: Literal["none", "t", "bca"]
    note: str | None


@dataclass(frozen=True, kw_only=True)
class Paired:
    """Differences b - a over the runs that both have. `sign_flip_p` is two-sided and None below 6 or above 20
    runs.
    """

    difference: Summary
    only_a: int
    only_b: int
    sign_flip_p: float | None


@dataclass(frozen=True, kw_only=True)
class TTest:
    """t, degrees of freedom and p."""

    t: float
    df: int
    p: float


def summarize(values: Mapping[Run, float | None], rng: np.random.Generator) -> Summary:
    """Combine one metric's values by run; None values are runs without one, counted in `missing`."""
    known = np.array([v for v in values.values() if v is not None], dtype=np.float64)
    return _summary(known, len(values) - len(known), rng)


def paired(
    values_a: Mapping[Run, float | None],
    values_b: Mapping[Run, float | None],
    rng: np.random.Generator,
) -> Paired:
    """Differences b - a, paired by run (its key, usually the seed); runs that only one side has are
    counted.
    """
    a = {run: v for run, v in values_a.items() if v is not None}
    b = {run: v for run, v in values_b.items() if v is not None}
    both = [run for run in a if run in b]
    difference = np.array([b[run] - a[run] for run in both], dtype=np.float64)
    summary = _summary(difference, len(set(values_a) & set(values_b)) - len(both), rng)
    exact = MIN_RUNS <= len(both) <= SIGN_FLIP_RUNS
    return Paired(
        difference=summary,
        only_a=len(a) - len(both),
        only_b=len(b) - len(both),
        sign_flip_p=sign_flip_p(difference) if exact else None,
    )


def _summary(values: Float64[np.ndarray, " n"], missing: int, rng: np.random.Generator) -> Summary:
    if not np.isfinite(values).all():
        raise ValueError("a run's value is not finite; use None for a run without a value")
    n = len(values)
    method: Literal["none", "t", "bca"] = "none"
    ci95, note = None, None
    if n < MIN_RUNS:
        note = f"n = {n} run{'' if n == 1 else 's'}: illustration"
    elif n < BOOTSTRAP_RUNS:
        ci95, method = t_interval(values), "t"
    else:
        ci95, method = bca_interval(values, rng), "bca"
    return Summary(
        mean=float(values.mean()) if n else None,
        sd=float(values.std(ddof=1)) if n > 1 else None,
        n=n,
        missing=missing,
        low=float(values.min()) if n else None,
        high=float(values.max()) if n else None,
        points=tuple(float(v) for v in values),
        ci95=ci95,
        method=method,
        note=note,
    )


def t_interval(values: Sequence[float] | np.ndarray, level: float = 0.95) -> tuple[float, float]:
    """Student's interval of the mean of n >= 2 values."""
    array = np.asarray(values, dtype=np.float64)
    n = len(array)
    if n < 2:
        raise ValueError("a t interval needs at least 2 values")
    half = float(stdtrit(n - 1, 0.5 + level / 2) * array.std(ddof=1) / np.sqrt(n))
    mean = float(array.mean())
    return mean - half, mean + half


def bca_interval(
    values: Sequence[float] | np.ndarray,
    rng: np.random.Generator,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    statistic: Callable[[np.ndarray], np.ndarray] = lambda rows: rows.mean(axis=-1),
) -> tuple[float, float]:
    """Bias-corrected and accelerated bootstrap interval of a statistic (along the last axis) of n >= 2
    values.
    """
    array = np.asarray(values, dtype=np.float64)
    n = len(array)
    if n < 2:
        raise ValueError("a bootstrap interval needs at least 2 values")
    observed = float(statistic(array))
    at_once = max(1, AT_ONCE // n)
    replicates = np.concatenate(
        [
            statistic(array[rng.integers(0, n, size=(min(at_once, resamples - done), n))])
            for done in range(0, resamples, at_once)
        ]
    )
    jackknife = np.array([statistic(np.delete(array, i)) for i in range(n)])
    pull = jackknife.mean() - jackknife
    spread = float((pull**2).sum())
    if spread <= (1e-12 * max(1.0, abs(observed))) ** 2:
        return observed, observed
    acceleration = float((pull**3).sum()) / (6.0 * spread**1.5)
    below = np.mean(replicates < observed) + 0.5 * np.mean(replicates == observed)
    bias = float(ndtri(np.clip(below, 0.5 / resamples, 1.0 - 0.5 / resamples)))
    z = bias + ndtri(np.array([0.5 - level / 2, 0.5 + level / 2]))
    low, high = np.quantile(replicates, ndtr(bias + z / (1.0 - acceleration * z)))
    return float(low), float(high)


def sign_flip_p(differences: Sequence[float] | np.ndarray, alternative: Alternative = "two-sided") -> float:
    """Exact p of "the differences are symmetric around 0": the share of all 2^n sign patterns whose sum is at
    least as extreme as the observed one (n <= 20)."""
    array = np.asarray(differences, dtype=np.float64)
    if not 1 <= len(array) <= SIGN_FLIP_RUNS:
        raise ValueError(f"the exact sign-flip test takes 1 to {SIGN_FLIP_RUNS} values, not {len(array)}")
    sums = np.zeros(1)
    for value in array:
        sums = np.concatenate([sums + value, sums - value])
    observed = float(array.sum())
    slack = 1e-9 * float(np.abs(array).sum())  # sums that are equal but for rounding count as equal
    if alternative == "two-sided":
        return float(np.mean(np.abs(sums) >= abs(observed) - slack))
    if alternative == "greater":
        return float(np.mean(sums >= observed - slack))
    return float(np.mean(sums <= observed + slack))


def one_sample_t(
    mean: float, sd: float, n: int, against: float, alternative: Alternative = "greater"
) -> TTest:
    """Student's one-sample test from mean, SD (n - 1) and count; the paper's is right-tailed against 0.5."""
    if n < 2 or not sd > 0.0:
        raise ValueError("a t-test needs at least 2 values and an SD above 0")
    t = (mean - against) / (sd / np.sqrt(n))
    p = {
        "greater": stdtr(n - 1, -t),
        "less": stdtr(n - 1, t),
        "two-sided": 2.0 * stdtr(n - 1, -abs(t)),
    }[alternative]
    return TTest(t=float(t), df=n - 1, p=float(p))


def paired_t(
    values_a: Sequence[float] | np.ndarray,
    values_b: Sequence[float] | np.ndarray,
    alternative: Alternative = "two-sided",
) -> TTest:
    """The paper's paired two-sample test of b - a over frames."""
    a, b = np.asarray(values_a, dtype=np.float64), np.asarray(values_b, dtype=np.float64)
    if a.shape != b.shape:
        raise ValueError(f"paired values differ in number: {len(a)} and {len(b)}")
    d = b - a
    return one_sample_t(
        float(d.mean()), float(d.std(ddof=1)) if len(d) > 1 else 0.0, len(d), 0.0, alternative
    )
