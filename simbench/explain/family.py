"""Many effects at once: how far from zero the farthest of them gets by chance alone.

t of an effect is its mean over runs by its standard error. If no cause did anything, every run's effects
would as well have the other sign: flip the signs of whole runs, all effects of a run together, and look how
large the largest |t| gets. Its 95 % quantile is the limit c; the intervals mean ± c SE hold for all effects
together, and an effect whose interval excludes zero is a cause.

This is the wild bootstrap over runs with the null imposed (Cameron, Gelbach & Miller 2008) and the largest
|t| (Westfall & Young 1993). Why so: effects of one table share their clean run and hang together, which the
flips keep and Bonferroni would pay for; it is exact where effects are symmetric by chance, also with 6 runs,
where resampled runs are too few (a resample of ten runs of which one shows an effect has no spread in a
third of the cases); and the limit over all effects is no lower than that over those without a cause, so it
also guards the others when some are real. Every pattern of signs is taken up to 12 runs, else random ones.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

LEVEL = 0.05
ALL_PATTERNS_RUNS = 12
PATTERNS = 9999
SLACK = 1e-9  # t that are equal but for rounding count as equal


def t_values(effects: Float64[np.ndarray, "m n"]) -> Float64[np.ndarray, " m"]:
    """Mean by standard error over n runs; 0 where all is zero, infinite where all runs agree on something
    else."""
    n = effects.shape[1]
    return _t(effects.mean(axis=1), (effects**2).sum(axis=1), n)


def limit(effects: Float64[np.ndarray, "m n"], rng: np.random.Generator) -> float:
    """c: at most 5 % of the sign patterns have a larger largest |t|."""
    n = effects.shape[1]
    if n <= ALL_PATTERNS_RUNS:
        signs = 1.0 - 2.0 * (np.arange(1 << n)[None, :] >> np.arange(n)[:, None] & 1)
    else:
        signs = 1.0 - 2.0 * rng.integers(0, 2, size=(n, PATTERNS))
        signs = np.concatenate([np.ones((n, 1)), signs], axis=1)  # what was observed is one of the patterns
    largest = np.abs(_t(effects @ signs / n, (effects**2).sum(axis=1)[:, None], n)).max(axis=0, initial=0.0)
    return float(np.sort(largest)[::-1][int(LEVEL * signs.shape[1])])


def exceeds(t: Float64[np.ndarray, " m"], c: float) -> np.ndarray:
    """Which effects are beyond the limit."""
    return np.abs(t) > c * (1.0 + SLACK)


def _t(mean: np.ndarray, squares: np.ndarray, n: int) -> np.ndarray:
    """From the mean and the sum of squares over runs, which no flip changes."""
    spread = np.maximum(squares - n * mean**2, 0.0)
    sure = spread <= 1e-12 * squares
    with np.errstate(divide="ignore", invalid="ignore"):
        t = mean * np.sqrt(n * (n - 1) / spread)
    return np.where(squares == 0.0, 0.0, np.where(sure, np.copysign(np.inf, mean), t))
