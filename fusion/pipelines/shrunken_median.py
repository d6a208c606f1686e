"""Rival: the median distance in the middle of the box.

The usual cure for background at a box's edges: shrink the box about its centre and take the median distance
of what is left (as "Central Region Depth Extraction" in Applied Sciences 15(10), 5543, 2025). That is a
distance, not a mapping, so the last step is ours: of the points in the whole box, those whose planar distance
lies within `band_m` of that median are the object's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from fusion.aoi import AoiConfig, enlarge
from fusion.camera import inside_box
from fusion.localize import planar_distance_m
from fusion.pipelines.within_box import BoxPoints, RivalConfig, WithinBox


@dataclass(frozen=True, kw_only=True)
class ShrunkenMedianConfig(RivalConfig):
    """`keep`: width and height of the shrunken box, as shares of the box's own."""

    keep: float = 0.5  # ours: half in both directions
    band_m: float = 1.0  # ours: holds all of a rider, and of a car the side that it shows


class ShrunkenMedian(WithinBox):
    """The points near the median distance of the shrunken box; none where that is empty."""

    def __init__(self, config: ShrunkenMedianConfig | None = None) -> None:
        self.config = ShrunkenMedianConfig() if config is None else config
        super().__init__(self.config)

    def select(self, inside: BoxPoints) -> Bool[np.ndarray, " k"]:
        """See the module's text."""
        shrink = self.config.keep - 1.0
        middle = inside_box(inside.uv_px, enlarge(inside.box_px, AoiConfig(widen=shrink, heighten=shrink)))
        if not middle.any():
            return middle
        distance_m = planar_distance_m(inside.xyz_lidar_m)
        return np.abs(distance_m - np.median(distance_m[middle])) <= self.config.band_m
