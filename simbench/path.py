"""Where a scripted actor is at any time: a path in the plane at a piecewise linear speed, in closed form.

A sway adds d(t) = amplitude sin(2 pi f t + phase) to the left of the path. Over ground the actor then moves
at v (1 - k d) along the path and d' across it, v being the speed along the path and k its curvature.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int64
from scipy.interpolate import CubicSpline

from scenarios.scenario import Path, Sway
from simbench.bend import BentRoad

TABLE_M = 0.02  # between the knots of a curve


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """A drive. `at` gives pose and motion at true times t_ns [n]; past either end it goes on straight.

    Between the knots of a curve, place and heading are C2 in the arc length: an accelerometer sees no kinks.
    """

    knot_s: Float64[np.ndarray, " k"]  # arc length table, m
    knot_xy_m: Float64[np.ndarray, "k 2"]
    knot_heading_rad: Float64[np.ndarray, " k"]
    speed_t_s: Float64[np.ndarray, " v"]
    speed_mps: Float64[np.ndarray, " v"]
    sway: Sway | None = None

    def arc_m(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """Distance driven along the path since t = 0 (negative before), the exact integral of the speed
        profile; a sway adds nothing to it."""
        t = np.asarray(t_ns, dtype=np.float64) * 1e-9
        driven: np.ndarray
        if len(self.speed_mps) == 1:
            driven = self.speed_mps[0] * t
        else:  # constant speed outside the profile, linear inside: integrate per segment from t = 0
            driven = _integral(t, self.speed_t_s, self.speed_mps) - self._before_0_m
        return driven

    @cached_property
    def _before_0_m(self) -> float:
        return float(_integral(np.zeros(1), self.speed_t_s, self.speed_mps)[0])

    def speed_at(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """Speed over ground in m/s."""
        if self.sway is None:
            return self._profile(t_ns)
        along_mps, _, across_mps = self._swaying(self.sway, t_ns)
        speed: np.ndarray = np.hypot(along_mps, across_mps)
        return speed

    def _profile(self, t_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        t_s = np.asarray(t_ns, dtype=np.float64) * 1e-9
        speed: np.ndarray = np.interp(t_s, self.speed_t_s, self.speed_mps)
        return speed

    def _swaying(
        self, sway: Sway, t_ns: Int64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
        """Speed along the path, offset to its left in metres, and the offset's rate."""
        t_s = np.asarray(t_ns, dtype=np.float64) * 1e-9
        rate = 2.0 * np.pi * sway.frequency_hz
        angle = rate * t_s + np.deg2rad(sway.phase_deg)
        left_m = sway.amplitude_m * np.sin(angle)
        shortened = 1.0 - self._curvature(self.arc_m(t_ns)) * left_m
        return self._profile(t_ns) * shortened, left_m, sway.amplitude_m * rate * np.cos(angle)

    def _curvature(self, arc_m: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        if self._curve is None:
            return np.zeros(len(arc_m))
        inside = np.clip(arc_m, self.knot_s[0], self.knot_s[-1])
        curvature: np.ndarray = np.where(arc_m == inside, self._curve(inside, 1)[:, 2], 0.0)
        return curvature

    def at(
        self, t_ns: Int64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, "n 2"], Float64[np.ndarray, " n"]]:
        """Position [n 2] in metres and heading [n] in radians in the world."""
        xy, heading = self._on_path(self.arc_m(t_ns))
        if self.sway is None:
            return xy, heading
        along_mps, left_m, across_mps = self._swaying(self.sway, t_ns)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        return xy + left_m[:, None] * left, heading + np.arctan2(across_mps, along_mps)

    def _on_path(
        self, s: Float64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, "n 2"], Float64[np.ndarray, " n"]]:
        inside = np.clip(s, self.knot_s[0], self.knot_s[-1])
        if self._curve is not None:
            curve = self._curve(inside)
            xy, heading = curve[:, :2], curve[:, 2]
        else:
            heading = np.interp(inside, self.knot_s, self.knot_heading_rad)
            xy = np.stack([np.interp(inside, self.knot_s, self.knot_xy_m[:, i]) for i in range(2)], axis=1)
        beyond = (s - inside)[:, None]
        return xy + beyond * np.stack([np.cos(heading), np.sin(heading)], axis=1), heading

    @cached_property
    def _curve(self) -> CubicSpline | None:
        """x, y, heading over the arc length; None where the path is one straight line."""
        if len(self.knot_s) < 3:
            return None
        return CubicSpline(self.knot_s, np.column_stack([self.knot_xy_m, self.knot_heading_rad]))


def _integral(
    t: Float64[np.ndarray, " n"], knots: Float64[np.ndarray, " v"], speed: Float64[np.ndarray, " v"]
) -> Float64[np.ndarray, " n"]:
    """Integral of the speed from knots[0] to t, with the end values held outside."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(knots))])
    inside = np.clip(t, knots[0], knots[-1])
    i = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, max(len(knots) - 2, 0))
    dt = inside - knots[i]
    here = np.interp(inside, knots, speed)
    within = area[i] + 0.5 * (speed[i] + here) * dt
    before = np.minimum(t - knots[0], 0.0) * speed[0]
    after = np.maximum(t - knots[-1], 0.0) * speed[-1]
    whole: np.ndarray = within + before + after
    return whole


def make_track(path: Path, road: BentRoad | None = None) -> Track:
    """The track of a declared path, on a road with a bend or a straight one (None).

    Two waypoints are exact; more are a C2 spline tabled every 2 cm, and so is a path along a bend. BadInput:
    a path reaches the centre of the bend.
    """
    points = np.asarray(path.waypoints_m, dtype=np.float64)
    if isinstance(path.speed_mps, tuple):
        profile = np.asarray(path.speed_mps, dtype=np.float64)
    else:
        profile = np.array([[0.0, path.speed_mps]], dtype=np.float64)
    if road is not None:
        table_s, table_xy, heading = _bent(path, road, moves=bool(profile[:, 1].any()))
    elif len(points) == 1:
        heading = np.array([np.deg2rad(path.heading_deg)])
        table_s, table_xy = np.zeros(1), points
    elif len(points) == 2:
        step = points[1] - points[0]
        heading = np.full(2, np.arctan2(step[1], step[0]))
        table_s, table_xy = np.array([0.0, np.hypot(*step)]), points
    else:
        chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        spline = CubicSpline(chord, points)
        u = np.linspace(0.0, chord[-1], max(int(chord[-1] / TABLE_M), 2))
        table_xy = spline(u)
        tangent = spline(u, 1)
        table_s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(table_xy, axis=0).T))])
        heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    return Track(
        knot_s=table_s,
        knot_xy_m=table_xy,
        knot_heading_rad=heading,
        speed_t_s=profile[:, 0],
        speed_mps=profile[:, 1],
        sway=path.sway,
    )


def _bent(
    path: Path, road: BentRoad, moves: bool
) -> tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, "k 2"], Float64[np.ndarray, " k"]]:
    """Arc lengths (0 at the first waypoint), places and headings of a straight declared path on a bent road.

    Tabled where the path is beside the bend; before and after, it is straight. One that crosses the road at a
    right angle is straight, and who never moves needs no path.
    """
    first, *more = np.asarray(path.waypoints_m, dtype=np.float64)
    step = more[0] - first if more else None
    angle = float(np.deg2rad(path.heading_deg)) if step is None else float(np.arctan2(step[1], step[0]))
    if moves and abs(np.cos(angle)) > 1e-9:
        ends = (np.array([road.start_m, road.end_m]) - first[0]) / np.cos(angle)
        low, high = float(ends.min()), float(ends.max())
        u = np.linspace(low, high, max(int((high - low) / TABLE_M), 2))
    else:
        u = np.zeros(1)
    on_road = first + u[:, None] * np.array([np.cos(angle), np.sin(angle)])
    xy = road.to_world(on_road)
    heading = road.world_heading_rad(on_road, angle) if moves else road.heading_rad(on_road[:, 0]) + angle
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    if u[0] > 0.0:
        start = -u[0]
    elif u[-1] < 0.0:
        start = arc[-1] - u[-1]
    else:
        start = np.interp(0.0, u, arc)
    return arc - start, xy, heading
