"""Mean sizes of the categories. A fusion pipeline is told these, never the size of the simulated object."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

SIZE_SPREAD = 0.08
"""Relative spread of a category's size (judgement): targets are scaled by 1 ± this, uniformly, by seed."""

CATEGORY_SIZES: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "car": (4.5, 1.8, 1.5),  # length: the paper, for its ±15 % of 4.5 m; vans are cars too
        "rider": (1.5, 0.7, 1.75),  # with the e-scooter; length: the paper
        "pedestrian": (0.6, 0.6, 1.75),
        "board": (0.8, 1.2, 1.7),  # a panel across x, on a tripod
    }
)
"""Length, width, height in metres of what a detector names."""

FIXTURE_SIZES: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "tree": (0.5, 0.5, 6.0),  # the trunk
        "post": (0.4, 0.4, 6.0),
        "building": (12.0, 8.0, 8.0),
    }
)
"""Rough footprints of what stands at the roadside, only used to keep actors apart."""


def rough_size_m(category: str) -> tuple[float, float, float]:
    """Length, width, height of any category. KeyError: no such category."""
    return CATEGORY_SIZES[category] if category in CATEGORY_SIZES else FIXTURE_SIZES[category]
