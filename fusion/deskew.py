"""Motion compensation of a sweep: every point where a still world would show it at one common instant.

A point fired at t_i, seen at x_i in the moving frame, is at x = T(t)^-1 T(t_i) x_i in the frame at instant t;
T is the measured motion (`odometry.py`). An object that moves itself keeps a shear of its own speed times the
time between its points; `against_motion` takes that out too once its velocity is known.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from fusion.odometry import Odometry, from_odometry, to_odometry

_KNOT_NS = 1_000_000  # poses are interpolated between knots: at 20 m/s and 1 rad/s good to 3 um


def poses_at(odometry: Odometry, fire_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 3"]:
    """The pose [n 3] at every firing time, exact at knots of 1 ms and linear between them."""
    if len(fire_ns) == 0:
        return np.zeros((0, 3))
    first_ns = int(fire_ns.min())
    count = (int(fire_ns.max()) - first_ns) // _KNOT_NS + 2
    if count > len(fire_ns):
        return odometry.pose(fire_ns)
    knots = odometry.pose(first_ns + _KNOT_NS * np.arange(count))
    at = (fire_ns - first_ns) / _KNOT_NS
    return np.stack([np.interp(at, np.arange(count), column) for column in knots.T], axis=1)


def deskew(
    xy_m: Float64[np.ndarray, "n 2"], fire_ns: Int64[np.ndarray, " n"], at_ns: int, odometry: Odometry
) -> Float64[np.ndarray, "n 2"]:
    """Points [n 2] of the moving frame at their firing times, in the frame at `at_ns`, for a still world."""
    world_m = to_odometry(xy_m, poses_at(odometry, fire_ns))
    return from_odometry(world_m, odometry.pose(np.array([at_ns], dtype=np.int64)))


def against_motion(
    xy_odom_m: Float64[np.ndarray, "n 2"],
    fire_ns: Int64[np.ndarray, " n"],
    at_ns: int,
    velocity_mps: Float64[np.ndarray, "2"],
) -> Float64[np.ndarray, "n 2"]:
    """Points [n 2] of an object that moves with `velocity_mps`, all moved on to the instant `at_ns`."""
    moved: np.ndarray = xy_odom_m - ((fire_ns - at_ns) * 1e-9)[:, None] * velocity_mps
    return moved
