"""Many random numbers in little time."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float32, UInt64
from scipy.special import ndtri

from fusion.geometry import readonly
from simbench.sensors.compiled import jit, jit_no_alias

LEVELS = 2**16


def standard_normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Float32[np.ndarray, "..."]:
    """Standard normal numbers, several times as fast as `Generator.standard_normal` makes them.

    Each is one of 65,536 equally likely quantiles: the greatest is 4.3, and within one standard deviation
    they lie less than 7e-5 apart.
    """
    out = np.empty(shape, dtype=np.float32)
    _look_up(_quantiles(), _words(rng, -(-out.size // 4)).view(np.uint16), out.reshape(-1))
    return out


def standard_uniform(rng: np.random.Generator, shape: tuple[int, ...]) -> Float32[np.ndarray, "..."]:
    """Uniform numbers in [0, 1): those of PCG64's `Generator.random` in float32, in half the time."""
    out = np.empty(shape, dtype=np.float32)
    _share(_words(rng, -(-out.size // 2)).view(np.uint32), out.reshape(-1))
    return out


def _words(rng: np.random.Generator, count: int) -> UInt64[np.ndarray, " n"]:
    words: np.ndarray = rng.integers(0, 2**64, size=count, dtype=np.uint64)
    return words


@jit
def _look_up(table, word, out):  # type: ignore[no-untyped-def]
    for i in range(out.shape[0]):
        out[i] = table[word[i]]


@jit_no_alias
def _share(word, out):  # type: ignore[no-untyped-def]
    for i in range(out.shape[0]):
        out[i] = np.float32(word[i] >> np.uint32(8)) * np.float32(2.0**-24)


@lru_cache(maxsize=1)
def _quantiles() -> Float32[np.ndarray, " q"]:
    """The middles of the levels, scaled to a variance of exactly 1."""
    z = ndtri((np.arange(LEVELS) + 0.5) / LEVELS)
    return readonly(z / z.std(), np.float32)
