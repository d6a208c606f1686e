"""From the visible surface of an object to its centre, by the mean size of its category and its heading.

A LiDAR sees the near faces only. In the object's own axes (u along its heading, w across) its points reach
from lo to hi. Along an axis on which the sensor stands outside of [lo, hi] the near end of the points is the
near face; the centre is half the mean size behind it. If the points reach over most of the mean size both
ends were seen, and the centre is midway, whatever the true size is. Between the two the answer is blended.

An upright figure (person, rider: shorter than `figure_length_m`) has no faces. Most of its points lie on the
trunk, a cylinder of which the near half is seen: its points' mean lies pi/4 of the radius before its axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from fusion.messages import CategorySize


@dataclass(frozen=True, kw_only=True)
class SurfaceConfig:
    """Where an end of the points is, when it was seen, and what stands upright."""

    tail: float = 0.02  # share of the points beyond an "end": noise and mirrors
    seen_from: float = 0.75  # share of the mean size from which on both ends begin to count as seen
    seen_to: float = 0.9
    figure_length_m: float = 2.5
    trunk: float = 0.2  # a figure's trunk: its radius by the category's mean width


@dataclass(frozen=True, kw_only=True, eq=False)
class Extent:
    """The ends (lo, hi) of an object's points along and across its heading, from the sensor [m]."""

    along: tuple[float, float]
    across: tuple[float, float]


def is_figure(size: CategorySize, config: SurfaceConfig) -> bool:
    """Whether a category stands upright on a small base."""
    return size.mean_m[0] < config.figure_length_m


def to_centre(
    xy_m: Float64[np.ndarray, "k 2"],
    sensor_m: Float64[np.ndarray, "2"],
    heading_rad: float,
    size: CategorySize,
    config: SurfaceConfig,
) -> Float64[np.ndarray, "2"]:
    """The centre of an object with points [k 2], k >= 1, seen from `sensor_m`, heading in the same axes."""
    from_sensor = xy_m - sensor_m
    if is_figure(size, config):
        mean = np.mean(from_sensor, axis=0)
        distance_m = float(np.hypot(*mean))
        push_m = math.pi / 4.0 * config.trunk * size.mean_m[1]
        return sensor_m + mean * ((distance_m + push_m) / max(distance_m, 1e-6))
    axes = heading_axes(heading_rad)
    along, across = axes @ from_sensor.T
    return sensor_m + axes.T @ np.array(
        [
            _centre_along(*_ends(along, config), size.mean_m[0], config),
            _centre_along(*_ends(across, config), size.mean_m[1], config),
        ]
    )


def heading_axes(heading_rad: float) -> Float64[np.ndarray, "2 2"]:
    """Rows: the unit vectors along and across (to the left of) a heading."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[c, s], [-s, c]])


def _ends(values: Float64[np.ndarray, " k"], config: SurfaceConfig) -> tuple[float, float]:
    ordered = np.sort(values)
    skip = int(config.tail * (len(ordered) - 1))
    return float(ordered[skip]), float(ordered[len(ordered) - 1 - skip])


def _centre_along(lo: float, hi: float, size_m: float, config: SurfaceConfig) -> float:
    """The centre on one axis, the sensor at 0."""
    middle = 0.5 * (lo + hi)
    if lo > 0.0:
        near = lo + 0.5 * size_m
    elif hi < 0.0:
        near = hi - 0.5 * size_m
    else:
        return middle  # beside the sensor: no face across this axis is seen, both ends are as far as any
    seen = ((hi - lo) / size_m - config.seen_from) / (config.seen_to - config.seen_from)
    seen = min(max(seen, 0.0), 1.0)
    return seen * middle + (1.0 - seen) * near


def box_heading(xy_m: Float64[np.ndarray, "k 2"], likely_rad: float, size: CategorySize) -> float:
    """The heading of a box whose points [k 2] are seen, when no motion tells: near `likely_rad` if possible.

    Zhang et al. (IV 2017): over angles of 0 to 90 degrees, the rectangle whose sides are closest to the
    points. Of the four headings that fit it, the one whose length holds the longer side where that exceeds
    the category's width, else the nearest to `likely_rad`.
    """
    angles = np.deg2rad(np.arange(0.0, 90.0, 3.0)) + likely_rad
    c, s = np.cos(angles), np.sin(angles)
    u = np.outer(c, xy_m[:, 0]) + np.outer(s, xy_m[:, 1])
    w = np.outer(c, xy_m[:, 1]) - np.outer(s, xy_m[:, 0])
    du = np.minimum(u - u.min(axis=1, keepdims=True), u.max(axis=1, keepdims=True) - u)
    dw = np.minimum(w - w.min(axis=1, keepdims=True), w.max(axis=1, keepdims=True) - w)
    closeness = np.sum(1.0 / np.maximum(np.minimum(du, dw), 0.05), axis=1)
    best = int(np.argmax(closeness))
    long_m, cross_m = float(np.ptp(u[best])), float(np.ptp(w[best]))
    heading = float(angles[best])
    length_m, width_m, _ = size.mean_m
    if max(long_m, cross_m) > 0.5 * (length_m + width_m):
        turns = [0.0, math.pi] if long_m >= cross_m else [0.5 * math.pi, -0.5 * math.pi]
    else:
        turns = [0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi]
    return min((heading + turn for turn in turns), key=lambda h: abs(_wrapped(h - likely_rad)))


def _wrapped(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2.0 * math.pi)
