"""What the levels that fit predict for numbers that were not fitted, and where the printed ones lie in it.

By draw of the posterior a normal about the emulated mean: run noise / passes, frames, emulator and
discrepancy. The scatter of runs is taken as independent of that in the fitted cells; where both are of the
same drives the prediction is, if anything, too wide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.special import ndtr, ndtri

from simbench.reproduce.fit.emulate import Emulator
from simbench.reproduce.fit.infer import Emulated, Observed, Posterior, emulated, run_covariance, spread

NEGLIGIBLE = 1e-9  # of the total weight, all draws that are left out together
STEPS = 60  # of bisection


@dataclass(frozen=True, kw_only=True)
class Predictive:
    """Of one printed number. p5, p50, p95: what cannot be counts at the limit of what can. tail_p: two-sided
    probability beyond it; None: nothing is printed."""

    mean: float
    sd: float
    p5: float
    p50: float
    p95: float
    printed: float | None
    tail_p: float | None


def predictive(
    posterior: Posterior,
    emulators: Sequence[Emulator],
    printed: Observed,
    *,
    discrepancy_sd: float | Float64[np.ndarray, " k"] = 0.0,
    possible: tuple[float, float] = (-np.inf, np.inf),
) -> tuple[Predictive, ...]:
    """Of every output that an emulator is given for; printed: its value (not a number: none), frames and
    passes. possible: least and greatest value that there can be. ValueError: as many emulators as printed
    numbers are needed."""
    if len(emulators) != len(printed.values):
        raise ValueError(f"{len(emulators)} emulators for {len(printed.values)} printed numbers")
    falling = np.argsort(posterior.weights)[::-1]
    held = int(np.searchsorted(np.cumsum(posterior.weights[falling]), 1.0 - NEGLIGIBLE)) + 1
    matter = falling[:held]
    weights = posterior.weights[matter] / posterior.weights[matter].sum()
    cells = emulated(emulators, posterior.draws[matter])
    sds = spread(cells, printed, run_covariance(emulators, independent=True), discrepancy_sd)
    return tuple(
        _of(weights, Emulated(mean=cells.mean[:, [k]], sd=sds[:, [k]]), float(value), possible)
        for k, value in enumerate(printed.values)
    )


def _of(
    weights: Float64[np.ndarray, " m"], normals: Emulated, printed: float, possible: tuple[float, float]
) -> Predictive:
    """Of one mixture of normals; its percentiles by bisection."""
    means, sds = normals.mean[:, 0], np.maximum(normals.sd[:, 0], 1e-12)
    mean = float(weights @ means)
    sd = float(np.sqrt(weights @ (sds**2 + (means - mean) ** 2)))
    shares = np.array([0.05, 0.5, 0.95])
    ends = means + ndtri(shares)[:, None] * sds  # a mixture's percentile lies among its parts'
    low, high = ends.min(axis=1), ends.max(axis=1)
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        under = ndtr((middle[:, None] - means) / sds) @ weights < shares
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    p5, p50, p95 = np.clip(0.5 * (low + high), *possible).tolist()
    known = np.isfinite(printed)
    below = float(ndtr((printed - means) / sds) @ weights) if known else 0.0
    return Predictive(
        mean=mean, sd=sd, p5=p5, p50=p50, p95=p95, printed=printed if known else None,
        tail_p=min(1.0, 2.0 * min(below, 1.0 - below)) if known else None,
    )  # fmt: skip
