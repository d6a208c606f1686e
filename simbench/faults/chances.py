"""Waits and chances: how they are drawn, and how far a draw may lie from what was asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64
from scipy import stats

RARE = 5e-7  # on either side: the exact interval that one draw in a million leaves
BEHIND_NS = 1_000  # one that catches up with the one before comes this much later
IN_QUEUE = 0.25  # of the mean wait: what waiting behind one another may add to the mean


def late_ns(delay_ms: float, wait_ms: float, n: int, rng: np.random.Generator) -> Int64[np.ndarray, " n"]:
    """A constant delay and an exponentially distributed wait of that mean."""
    late: np.ndarray = np.round((delay_ms + wait_ms * rng.standard_exponential(n)) * 1e6).astype(np.int64)
    return late


def queued_ns(at_ns: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    """The same instants, none before the one ahead of it."""
    behind = BEHIND_NS * np.arange(len(at_ns))
    queue: np.ndarray = np.maximum.accumulate(at_ns - behind) + behind
    return queue


def mean_wait_allowed(wait_ms: float, n: int) -> float:
    """How far the mean of n waits may lie from their expected mean."""
    low, high = stats.gamma.ppf([RARE, 1.0 - RARE], n) / n
    return wait_ms * (float(max(1.0 - low, high - 1.0)) + IN_QUEUE)


def least_wait_allowed(wait_ms: float, n: int) -> float:
    """How far above nothing the least of n waits may lie."""
    return wait_ms * (float(-np.log(2.0 * RARE)) / n + IN_QUEUE)


def share_allowed(share: float, n: float) -> float:
    """How far the share of n free trials that come true may lie from their chance."""
    trials = max(int(n), 1)
    low, high = stats.binom.ppf([RARE, 1.0 - RARE], trials, share) / trials
    return float(max(share - low, high - share))


SPREADS: dict[str, Any] = {
    "gaussian": stats.norm(),
    "uniform": stats.uniform(-np.sqrt(3.0), 2.0 * np.sqrt(3.0)),
    "heavy_tailed": stats.t(3, scale=1.0 / np.sqrt(3.0)),
}
"""Distributions of mean 0 and SD 1."""


def scattered(distribution: str, n: int, rng: np.random.Generator) -> Float64[np.ndarray, " n"]:
    """n numbers of mean 0 and SD 1."""
    drawn: np.ndarray = SPREADS[distribution].ppf(rng.uniform(size=n))
    return drawn


def spread_by_median(values: Float64[np.ndarray, " n"] | Sequence[float], distribution: str) -> float:
    """The SD of a distribution about 0 from the median size of its draws: heavy tails do not move it."""
    return float(np.median(np.abs(values)) / SPREADS[distribution].ppf(0.75))


def spread_allowed(sd: float, n: int, distribution: str) -> float:
    """How far `spread_by_median` of n draws may lie from their SD."""
    middle = [(n + 1) // 2, n // 2 + 1]
    low = stats.beta.ppf(RARE, middle[0], n - middle[0] + 1)
    high = stats.beta.ppf(1.0 - RARE, middle[1], n - middle[1] + 1)
    unit = SPREADS[distribution]
    least, most = unit.ppf(0.5 + 0.5 * np.array([low, high])) / unit.ppf(0.75)
    return sd * float(max(1.0 - least, most - 1.0))
