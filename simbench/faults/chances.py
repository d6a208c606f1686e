"""Waits and chances: how they are drawn, and how far a draw may lie from what was asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64
from scipy.special import bdtr, bdtrik, betaincinv, gammaincinv, ndtri, pdtr, pdtrik, stdtrit

RARE = 5e-7  # on either side: the exact interval that one draw in a million leaves
IN_QUEUE = 0.25  # of the mean wait: what waiting behind one another may add to the mean


def late_ns(delay_ms: float, wait_ms: float, n: int, rng: np.random.Generator) -> Int64[np.ndarray, " n"]:
    """A constant delay and an exponentially distributed wait of that mean."""
    late: np.ndarray = np.round((delay_ms + wait_ms * rng.standard_exponential(n)) * 1e6).astype(np.int64)
    return late


def mean_wait_allowed(wait_ms: float, n: int) -> float:
    """How far the mean of n waits may lie from their expected mean."""
    low, high = gammaincinv(n, [RARE, 1.0 - RARE]) / n
    return wait_ms * (float(max(1.0 - low, high - 1.0)) + IN_QUEUE)


def least_wait_allowed(wait_ms: float, n: int) -> float:
    """How far above nothing the least of n waits may lie."""
    return wait_ms * (float(-np.log(2.0 * RARE)) / n + IN_QUEUE)


def share_allowed(share: float, n: float) -> float:
    """How far the share of n free trials that come true may lie from their chance: beyond in one of a million
    draws. 0 where there is nothing to try, or no chance in it.
    """
    trials = int(n)
    if trials < 1 or not 0.0 < share < 1.0:
        return 0.0
    low, high = _counts(lambda q: bdtrik(q, trials, share), lambda k: bdtr(k, trials, share)) / trials
    return float(max(share - low, high - share))


def count_allowed(mean: float) -> float:
    """How far a count of a Poisson process may lie from its mean."""
    if mean <= 0.0:
        return 0.0
    low, high = _counts(lambda q: pdtrik(q, mean), lambda k: pdtr(k, mean))
    return float(max(mean - low, high - mean))


Curve = Callable[[Float64[np.ndarray, "2"]], Float64[np.ndarray, "2"]]


def _counts(inverse: Curve, cumulative: Curve) -> Float64[np.ndarray, "2"]:
    """The least counts that reach either end of the exact interval."""
    q = np.array([RARE, 1.0 - RARE])
    count = np.ceil(inverse(q))
    below = np.maximum(count - 1.0, 0.0)
    least: np.ndarray = np.where(cumulative(below) >= q, below, count)
    return least


SPREADS: dict[str, Callable[..., Any]] = {
    "gaussian": ndtri,
    "uniform": lambda q: np.sqrt(3.0) * (2.0 * q - 1.0),
    "heavy_tailed": lambda q: stdtrit(3.0, q) / np.sqrt(3.0),
}
"""Distributions of mean 0 and SD 1 by their quantiles."""


def scattered(distribution: str, n: int, rng: np.random.Generator) -> Float64[np.ndarray, " n"]:
    """n numbers of mean 0 and SD 1."""
    drawn: np.ndarray = SPREADS[distribution](rng.uniform(size=n))
    return drawn


def spread_by_median(values: Float64[np.ndarray, " n"] | Sequence[float], distribution: str) -> float:
    """The SD of a distribution about 0 from the median size of its draws: heavy tails do not move it."""
    return float(np.median(np.abs(values)) / SPREADS[distribution](0.75))


def spread_allowed(sd: float, n: int, distribution: str) -> float:
    """How far `spread_by_median` of n draws may lie from their SD."""
    middle = [(n + 1) // 2, n // 2 + 1]
    low = betaincinv(middle[0], n - middle[0] + 1, RARE)
    high = betaincinv(middle[1], n - middle[1] + 1, 1.0 - RARE)
    quantile = SPREADS[distribution]
    least, most = quantile(0.5 + 0.5 * np.array([low, high])) / quantile(0.75)
    return sd * float(max(1.0 - least, most - 1.0))
