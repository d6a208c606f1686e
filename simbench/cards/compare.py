"""Simulated beside recorded objects: does what was recorded lie where the simulation does, at like range?

Of every recorded sighting the simulated ones of its category within a quarter of its range are looked up; it
lies inside when it is between their 5th and 95th percentiles. Of data alike nine in ten would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbench.cards.statistics import Sight

LIKE_RANGE = 0.25
FEWEST = 10  # simulated sightings at like range
QUANTITIES = ("points", "height_px", "shift_px", "intensity", "noise_m")


@dataclass(frozen=True, kw_only=True)
class Compared:
    """One quantity of one category. inside: of `known` recorded sightings that have enough simulated ones at
    like range; ratio: median of recorded over simulated median there (None for `shift_px`, whose sign has no
    meaning). unmatched: recorded sightings without."""

    category: str
    quantity: str
    known: int
    inside: int
    unmatched: int
    ratio: float | None


def compare(ours: Sequence[Sight], theirs: Sequence[Sight]) -> tuple[Compared, ...]:
    """Every quantity of every category that was recorded, in order of category."""
    categories = sorted({row.category for row in theirs})
    return tuple(_one(ours, theirs, c, q) for c in categories for q in QUANTITIES)


def _one(ours: Sequence[Sight], theirs: Sequence[Sight], category: str, quantity: str) -> Compared:
    simulated = [
        (row.range_m, v)
        for row in ours
        if row.category == category and np.isfinite(v := _value(row, quantity))
    ]
    ranges, values = np.array(simulated, dtype=np.float64).reshape(-1, 2).T
    known = inside = unmatched = 0
    ratios = []
    for row in theirs:
        value = _value(row, quantity)
        if row.category != category or not np.isfinite(value):
            continue
        like = values[np.abs(ranges - row.range_m) <= LIKE_RANGE * row.range_m]
        if len(like) < FEWEST:
            unmatched += 1
            continue
        low, middle, high = np.percentile(like, [5.0, 50.0, 95.0])
        known, inside = known + 1, inside + int(low <= value <= high)
        if middle > 0.0:
            ratios.append(value / middle)
    return Compared(
        category=category, quantity=quantity, known=known, inside=inside, unmatched=unmatched,
        ratio=float(np.median(ratios)) if ratios and quantity != "shift_px" else None,
    )  # fmt: skip


def _value(row: Sight, quantity: str) -> float:
    """Points and intensity of an object without points are not measured."""
    if quantity == "points" and row.points == 0:
        return float("nan")
    return float(getattr(row, quantity))
