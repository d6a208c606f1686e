"""Shapley values of many causes by antithetic permutation sampling.

Switch the causes on one by one in a random order: what the value changes when i comes is i's marginal
contribution, and its mean over all orders is phi(i). Every order is followed by its reverse: where i came
early in one it comes late in the other, and the mean of the two varies less (Castro et al. 2009; Mitchell et
al. 2022). The error that the sampling itself makes is the SD of these means over pairs of orders, over the
root of their number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

MIN_PAIRS = 8  # below, the sampling error itself is not known well
MOST_PAIRS = 100
ENOUGH = 0.02  # of the total

Order = tuple[int, ...]
ValuesOf = Callable[[Sequence[int]], Float64[np.ndarray, "m r"]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sampled:
    """phi [k r] by cause and run, and its sampling error, 1 SE of the mean over runs [k]."""

    phi: Float64[np.ndarray, "k r"]
    se: Float64[np.ndarray, " k"]
    pairs: int

    def is_enough(self, total: float) -> bool:
        """Whether every cause's sampling error is below 2 % of the total."""
        return self.pairs >= MIN_PAIRS and bool((self.se < ENOUGH * abs(total)).all())


def orders(k: int, rng: np.random.Generator) -> Iterator[tuple[Order, Order]]:
    """Random orders of k causes without end, each with its reverse."""
    while True:
        drawn = tuple(int(i) for i in rng.permutation(k))
        yield drawn, drawn[::-1]


def prefixes(order: Order) -> tuple[int, ...]:
    """The masks on the way from no cause to all."""
    masks = [0]
    for i in order:
        masks.append(masks[-1] | 1 << i)
    return tuple(masks)


def sampled(pairs: Sequence[tuple[Order, Order]], values: ValuesOf) -> Sampled:
    """The estimate of these pairs of orders; `values`: the rows of some masks, one column a run."""
    means = np.array([0.5 * (_marginals(a, values) + _marginals(b, values)) for a, b in pairs])  # [p k r]
    over_runs = means.mean(axis=2)
    se = np.full(means.shape[1], np.inf)
    if len(pairs) > 1:
        se = over_runs.std(axis=0, ddof=1) / np.sqrt(len(pairs))
    return Sampled(phi=means.mean(axis=0), se=se, pairs=len(pairs))


def _marginals(order: Order, values: ValuesOf) -> Float64[np.ndarray, "k r"]:
    steps = np.diff(values(prefixes(order)), axis=0)
    result = np.empty_like(steps)
    result[list(order)] = steps
    return result
