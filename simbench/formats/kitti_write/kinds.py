"""KITTI's words for the bench's categories, and its levels for how much of an object is seen."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

KIND: Mapping[str, str | None] = MappingProxyType(
    {
        "car": "Car",
        "van": "Van",
        "truck": "Truck",
        "pedestrian": "Pedestrian",
        "person_sitting": "Person_sitting",
        "rider": "Cyclist",  # an e-scooter with its rider too
        "tram": "Tram",
        "misc": "Misc",
        "tree": None,  # KITTI labels no vegetation, posts and houses
        "post": None,
        "building": None,
    }
)
"""None: such things have no label. What is not here (a calibration board) is Misc."""

EXACT = 1e-6


def kind_of(category: str) -> str | None:
    """The type of a label; None where KITTI has none."""
    return KIND.get(category, "Misc")


def occlusion(visible_fraction: float, outside: float, shares: Mapping[int, float]) -> int:
    """The level of `shares` (visible share by level) that says best how much is seen.

    A truth that was itself read from labels has a level's share times what is not `outside`: that level, if
    there is one. Else the visible fraction is of what lies inside the image: the level of the nearest share.
    """
    for level, share in shares.items():
        if abs(share * (1.0 - outside) - visible_fraction) < EXACT:
            return level
    return min(shares, key=lambda level: abs(shares[level] - visible_fraction))
