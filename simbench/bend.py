"""A road with a bend: from distances along its centre line and to its left to the world.

Curvature over the distance x along the centre line is a trapezoid (clothoid, arc, clothoid):

    k(x) = +-1/radius (r(u) - r(u - length + transition)),  u = x - at,  r(u) = u / transition within [0, 1]

so the heading, its integral, is closed form, and the centre line is the integral of its cosine and sine.
Before the bend, road and world coordinates are the same.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import CubicHermiteSpline

from scenarios.errors import BadInput
from scenarios.scenario import Bend

STEP_M = 0.05  # of the centre line's table: its cubics are then within 1e-10 m
NEAREST_RATIO = 0.1  # a path may not come nearer to the bend's centre than this share of its radius


class BentRoad:
    """The map from road coordinates (along, left) to the world.

    It keeps distances on the centre line, across the road, and everywhere off the bend.
    """

    def __init__(self, bend: Bend) -> None:
        self.bend = bend
        self.start_m, self.end_m = bend.at_m, bend.at_m + bend.length_m
        self._most = (1.0 if bend.turn == "left" else -1.0) / bend.radius_m

    def curvature_1pm(self, along_m: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """Of the centre line, positive to the left."""
        rise_m = self.bend.transition_m
        ramp = [np.clip((along_m - x) / rise_m, 0.0, 1.0) for x in (self.start_m, self.end_m - rise_m)]
        curvature: np.ndarray = self._most * (ramp[0] - ramp[1])
        return curvature

    def heading_rad(self, along_m: Float64[np.ndarray, "*n"]) -> Float64[np.ndarray, "*n"]:
        """Of the centre line, 0 before the bend."""
        rise_m = self.bend.transition_m
        risen = [
            np.clip(u, 0.0, rise_m) ** 2 / (2.0 * rise_m) + np.maximum(u - rise_m, 0.0)
            for u in (along_m - self.start_m, along_m - self.end_m + rise_m)
        ]
        heading: np.ndarray = self._most * (risen[0] - risen[1])
        return heading

    def to_world(self, road_m: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, "n 2"]:
        """Points (along, left) as world x, y."""
        along, left = road_m[:, 0], road_m[:, 1]
        inside = np.clip(along, self.start_m, self.end_m)
        heading = self.heading_rad(along)
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        centre = self._centre(inside) + (along - inside)[:, None] * ahead
        world: np.ndarray = centre + left[:, None] * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        return world

    def world_heading_rad(
        self, road_m: Float64[np.ndarray, "n 2"], heading_rad: float
    ) -> Float64[np.ndarray, " n"]:
        """Headings in the world, at points (along, left), of a line of one heading against the road.

        BadInput: a point comes too near the centre of the bend.
        """
        ratio = self.ratio(road_m)
        if ratio.min() < NEAREST_RATIO:
            along, left = road_m[int(ratio.argmin())]
            raise BadInput(
                f"a path comes to {abs(left):.0f} m beside the road, {along:.0f} m along it: that is at the "
                f"centre of a bend of {self.bend.radius_m:g} m"
            )
        c, s = np.cos(heading_rad), np.sin(heading_rad)
        turned = np.arctan2(s * c - c * s * ratio, c * c * ratio + s * s)  # of (c ratio, s) against (c, s)
        heading: np.ndarray = self.heading_rad(road_m[:, 0]) + heading_rad + turned
        return heading

    def ratio(self, road_m: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
        """Metres of the world per metre along, at points (along, left)."""
        return 1.0 - self.curvature_1pm(road_m[:, 0]) * road_m[:, 1]

    def longest_ratio(self, left_m: float) -> float:
        """Most metres along per metre of the world, anywhere on a line so far to either side of the road."""
        return 1.0 / max(1.0 - abs(left_m * self._most), NEAREST_RATIO)

    @cached_property
    def _centre(self) -> CubicHermiteSpline:
        cells = max(int(np.ceil(self.bend.length_m / STEP_M)), 1)
        knot = np.linspace(self.start_m, self.end_m, cells + 1)
        node, weight = np.polynomial.legendre.leggauss(4)
        half = 0.5 * np.diff(knot)
        heading = self.heading_rad((knot[:-1] + half)[:, None] + half[:, None] * node)
        step = half[:, None] * np.stack([np.cos(heading) @ weight, np.sin(heading) @ weight], axis=1)
        xy = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
        xy[:, 0] += self.start_m
        angle = self.heading_rad(knot)
        return CubicHermiteSpline(knot, xy, np.stack([np.cos(angle), np.sin(angle)], axis=1))
