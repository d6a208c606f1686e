"""One-sided bounds of a mean difference, and the p-values that they imply.

| runs | bounds |
|---|---|
| < 6 | none |
| 6-19 | Student t |
| >= 20 | studentised bootstrap over runs |

A p-value here is the least alpha at which the bound lies beyond the limit, so p <= alpha exactly where the
bound at alpha does. Studentised and not BCa, by measurement (tests/benchmarks/verdict_methods.py): BCa passes
more than alpha of the losses that few runs carry. Efron & Tibshirani, An Introduction to the Bootstrap, 1993,
ch. 12.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float64
from scipy.special import stdtr, stdtrit  # scipy.stats takes half a second to import

from simbench.score.statistics import BOOTSTRAP_RUNS, MIN_RUNS, RESAMPLES

Method: TypeAlias = Literal["none", "identical", "t", "bootstrap"]

LEAST_SPREAD = 0.25
"""A resample that missed the few runs that differ has a spread near 0, and a t near infinity: its spread
counts as at least this share of the sample's. It keeps bounds finite and costs no error that could be
measured."""

NOTHING = 1e-12  # spread over size, at or below which values are equal but for rounding
AT_ONCE = 4_000_000  # draws held at a time


@runtime_checkable
class Bounds(Protocol):
    """What a sample says about its mean."""

    @property
    def method(self) -> Method: ...

    def lower(self, alpha: float) -> float:
        """Above which the mean lies, but for a chance of alpha."""

    def upper(self, alpha: float) -> float:
        """Below which the mean lies, but for a chance of alpha."""

    def p_at_most(self, limit: float) -> float:
        """p of "the mean is at most `limit`"."""

    def p_at_least(self, limit: float) -> float:
        """p of "the mean is at least `limit`"."""


def bounds(values: Float64[np.ndarray, " n"], rng: np.random.Generator) -> Bounds | None:
    """By the number of values; None below 6."""
    n = len(values)
    if n < MIN_RUNS:
        return None
    if n < BOOTSTRAP_RUNS:
        sd = 0.0 if _equal(values[None])[0] else float(values.std(ddof=1))
        return StudentT(mean=float(values.mean()), error=sd / float(np.sqrt(n)), df=n - 1)
    at_once = max(1, AT_ONCE // n)
    parts = [
        candidates(values[None], draw_counts(n, min(at_once, RESAMPLES - done), rng))[0]
        for done in range(0, RESAMPLES, at_once)
    ]
    return Bootstrap(candidates=np.sort(np.concatenate(parts)))


@dataclass(frozen=True, kw_only=True)
class StudentT:
    """mean, its standard error (0: all values are equal) and the degrees of freedom."""

    mean: float
    error: float
    df: int
    method: Method = "t"

    def lower(self, alpha: float) -> float:
        return self.mean - float(stdtrit(self.df, 1.0 - alpha)) * self.error

    def upper(self, alpha: float) -> float:
        return self.mean + float(stdtrit(self.df, 1.0 - alpha)) * self.error

    def p_at_most(self, limit: float) -> float:
        return self._p(self.mean - limit)

    def p_at_least(self, limit: float) -> float:
        return self._p(limit - self.mean)

    def _p(self, beyond: float) -> float:
        if self.error == 0.0:
            return 0.0 if beyond > 0.0 else 1.0
        return float(stdtr(self.df, -beyond / self.error))


@dataclass(frozen=True, kw_only=True, eq=False)
class Bootstrap:
    """Where the mean would lie if each resample's error were the sample's, in rising order: the bound at
    alpha is the k-th of them from either end, k = alpha * (their number + 1).
    """

    candidates: Float64[np.ndarray, " b"]
    method: Method = "bootstrap"

    def lower(self, alpha: float) -> float:
        k = self._rank(alpha)
        return float(self.candidates[k - 1]) if k else -np.inf

    def upper(self, alpha: float) -> float:
        k = self._rank(alpha)
        return float(self.candidates[-k]) if k else np.inf

    def p_at_most(self, limit: float) -> float:
        return (1.0 + float(np.searchsorted(self.candidates, limit, "right"))) / (len(self.candidates) + 1)

    def p_at_least(self, limit: float) -> float:
        beyond = len(self.candidates) - int(np.searchsorted(self.candidates, limit, "left"))
        return (1.0 + beyond) / (len(self.candidates) + 1)

    def _rank(self, alpha: float) -> int:
        return int(np.floor(alpha * (len(self.candidates) + 1) + 1e-9))


def draw_counts(n: int, resamples: int, rng: np.random.Generator) -> Float64[np.ndarray, "{resamples} {n}"]:
    """How often each of n values is drawn in each resample of n with replacement."""
    drawn = rng.integers(0, n, (resamples, n)) + n * np.arange(resamples)[:, None]
    return np.bincount(drawn.ravel(), minlength=resamples * n).reshape(resamples, n).astype(np.float64)


def candidates(
    values: Float64[np.ndarray, "samples n"], counts: Float64[np.ndarray, "b n"]
) -> Float64[np.ndarray, "samples b"]:
    """mean - sd * t* for each sample and resample, t* = (resample's mean - mean) / resample's sd."""
    n = values.shape[1]
    mean = values.mean(axis=1, keepdims=True)
    off = np.where(_equal(values)[:, None], 0.0, values - mean)
    variance = (off**2).mean(axis=1, keepdims=True)
    moved = np.einsum("sn,bn->sb", off, counts) / n  # not by BLAS, whose sums depend on its threads
    spread = np.sqrt(
        np.maximum(np.einsum("sn,bn->sb", off**2, counts) / n - moved**2, LEAST_SPREAD**2 * variance)
    )
    t = np.divide(moved, spread, out=np.zeros_like(moved), where=spread > 0.0)
    return np.asarray(mean - np.sqrt(variance) * t)


def _equal(values: Float64[np.ndarray, "samples n"]) -> np.ndarray:
    return np.asarray(np.ptp(values, axis=1) <= NOTHING * np.abs(values).max(axis=1))
