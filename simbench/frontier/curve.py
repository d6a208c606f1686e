"""A curve along an axis as it was estimated from runs: by how much the limit is met, and how sure that is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

GRID: Float64[np.ndarray, " m"] = np.linspace(0.0, 1.0, 401)
"""Where curves are looked at, as a share of the range."""

Functional = Literal["share", "mean"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """margin: the functional beyond its limit at every place of `GRID`, at least 0 where the limit holds; a
    mean's in the metric's unit, a share's on the probit (or logit) scale.

    influence: of every seed on the margin; the mean over a resample of seeds is (to first order) how far that
    resample moves the curve. smooth: variance of what lies between the levels. pivots: (resampled margin -
    margin) / its standard error at a place of `GRID`, many resamples of the seeds.
    """

    margin: Float64[np.ndarray, " m"]
    influence: Float64[np.ndarray, "n m"]
    smooth: Float64[np.ndarray, " m"]
    pivots: Callable[[int, np.random.Generator], Float64[np.ndarray, " b"]]

    @property
    def error(self) -> Float64[np.ndarray, " m"]:
        """Standard error of the margin: the seeds' scatter and what lies between the levels."""
        n = len(self.influence)
        seeds = self.influence.var(axis=0, ddof=1) / n if n > 1 else np.zeros(len(self.margin))
        return np.sqrt(seeds + self.smooth)
