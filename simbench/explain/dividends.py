"""Harsanyi dividends: what every set of causes adds that none of its smaller sets has.

    d(S) = sum over T within S of (-1)^(|S| - |T|) v(T)        v(S) = sum over T within S of d(T)

d of one cause is its effect alone on a clean run, d of a pair what the two do together beyond the sum of
both, and so on; all together they are the total, v(all) - v(none). The Shapley value of a cause is its share
of every set that it is in, phi(i) = sum over S with i of d(S) / |S|; the values of all causes add up to the
total too.

Sets are bit masks: cause i is bit 1 << i. Tables are [2^k r], row S the values of set S, a column a run.
Harsanyi 1963; Shapley 1953.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64


def dividends(values: Float64[np.ndarray, "s r"]) -> Float64[np.ndarray, "s r"]:
    """Row S: d(S) of every run; row 0 is v(none). A cause that never changes a value has exact zeros."""
    table = values.copy()
    for i in range(causes_in(len(values))):
        with_i = np.flatnonzero(np.arange(len(values)) >> i & 1)
        table[with_i] -= table[with_i ^ (1 << i)]
    return table


def values_of(table: Float64[np.ndarray, "s r"]) -> Float64[np.ndarray, "s r"]:
    """The other way: row S is v(S), given all dividends."""
    values = table.copy()
    for i in range(causes_in(len(values))):
        with_i = np.flatnonzero(np.arange(len(values)) >> i & 1)
        values[with_i] += values[with_i ^ (1 << i)]
    return values


def shapley(table: Float64[np.ndarray, "s r"]) -> Float64[np.ndarray, "k r"]:
    """phi of every cause and run, given all dividends."""
    masks = np.arange(len(table))
    size = np.array([order(int(mask)) for mask in masks])
    shares = table[1:] / size[1:, None]
    rows = [shares[(masks[1:] >> i & 1) == 1].sum(axis=0) for i in range(causes_in(len(table)))]
    return np.array(rows, dtype=np.float64).reshape(len(rows), table.shape[1])


def causes_in(rows: int) -> int:
    """k of a table of 2^k rows. ValueError: it is none."""
    k = rows.bit_length() - 1
    if rows < 1 or rows != 1 << k:
        raise ValueError(f"a table has 2^k rows, this one has {rows}")
    return k


def order(mask: int) -> int:
    """How many causes a set has."""
    return mask.bit_count()


def members(mask: int, names: Sequence[str]) -> tuple[str, ...]:
    """The names of a set's causes."""
    return tuple(name for i, name in enumerate(names) if mask >> i & 1)


def up_to(k: int, largest: int) -> tuple[int, ...]:
    """The masks of all sets of at most `largest` of k causes, smaller sets first, then as they count."""
    return tuple(sorted((m for m in range(1 << k) if order(m) <= largest), key=lambda m: (order(m), m)))
