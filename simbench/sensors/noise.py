"""Many normal numbers in little time."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float32, UInt16
from scipy.special import ndtri

from fusion.geometry import readonly

LEVELS = 2**16


def standard_normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Float32[np.ndarray, "..."]:
    """Standard normal numbers, several times as fast as `Generator.standard_normal` makes them.

    Each is one of 65,536 equally likely quantiles: the greatest is 4.3, and within one standard deviation
    they lie less than 7e-5 apart.
    """
    size = int(np.prod(shape))
    words: UInt16[np.ndarray, " n"] = rng.integers(0, 2**64, size=-(-size // 4), dtype=np.uint64).view(
        np.uint16
    )
    return _quantiles()[words[:size]].reshape(shape)


@lru_cache(maxsize=1)
def _quantiles() -> Float32[np.ndarray, " q"]:
    """The middles of the levels, scaled to a variance of exactly 1."""
    z = ndtri((np.arange(LEVELS) + 0.5) / LEVELS)
    return readonly(z / z.std(), np.float32)
