"""Where to measure next: in the middle of the gap that matters most for the first crossing.

A gap matters by its width times the chance that the curve lies on the other side of the limit within it (the
"straddle" of Bryan et al., Active Learning for Identifying Function Threshold Boundaries, 2005, by gaps).
Gaps beyond the first crossing's upper bound do not.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.special import ndtr

from simbench.frontier.crossing import first_below
from simbench.frontier.curve import GRID, Curve

START = 10
EXTRA = 6
NARROWEST = 0.012  # of the range
LEAST = 0.002
BAND = 2.0  # standard errors


def start_levels(count: int = START) -> tuple[float, ...]:
    """Levels that fill the range evenly, both ends among them."""
    return tuple(float(f"{level:.6g}") for level in np.linspace(0.0, 1.0, count))


def next_level(levels: Float64[np.ndarray, " k"], curve: Curve) -> float | None:
    """The level to measure next; None where another one would tell little. levels: rising."""
    if curve.margin[0] < 0.0:  # broken at the start: there is no crossing to look for
        return None
    error = np.maximum(curve.error, 1e-12)
    beyond = first_below(curve.margin + BAND * error)
    chances = ndtr(-np.abs(curve.margin) / error)
    best: tuple[float, float] | None = None
    for left, right in zip(levels[:-1].tolist(), levels[1:].tolist(), strict=True):
        if beyond is not None and left > beyond:
            break
        if right - left < 2.0 * NARROWEST:
            continue
        inside = (left - 1e-9 <= GRID) & (right + 1e-9 >= GRID)
        margin = curve.margin[inside]
        chance = 0.5 if margin.min() < 0.0 <= margin.max() else float(chances[inside].max())
        matter = (right - left) * chance
        if matter >= LEAST and (best is None or matter > best[0]):
            best = (matter, float(f"{0.5 * (left + right):.6g}"))
    return None if best is None else best[1]
