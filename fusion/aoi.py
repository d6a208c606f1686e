"""Step 2 of the paper: enlarged areas of interest (AOIs), and the points that the mapping M puts into them.

"100 % enlargement was implemented for left and right directions" is read as: the AOI is twice as wide as the
box, half a width more on either side; the vertical ratio is a parameter of its own, 0 by default. An AOI is a
set of pixels, so it ends where the image ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64

from fusion.camera import MIN_DEPTH_M, PinholeCamera, inside_box
from fusion.geometry import Transform
from fusion.messages import BoxPx

_STEPS = np.linspace(0.0, 1.0, 9)
_BORDER = np.concatenate(  # points on the border of the unit square, [36 2]
    [
        np.column_stack(side)
        for value in (np.zeros(9), np.ones(9))
        for side in ((_STEPS, value), (value, _STEPS))
    ]
)


@dataclass(frozen=True, kw_only=True)
class AoiConfig:
    """Hyper-parameters of step 2: added width and height, as shares of the box's own."""

    widen: float = 1.0  # paper: 100 %
    heighten: float = 0.0  # the paper names no number; vibration is mostly pitch, so this one matters


@dataclass(frozen=True, kw_only=True, eq=False)
class MappedPoints:
    """The points that map into one AOI: ascending indices into the given points, and their pixels [k 2]."""

    points: Int64[np.ndarray, " k"]
    uv_px: Float64[np.ndarray, "k 2"]


def enlarge(box_px: BoxPx, config: AoiConfig) -> BoxPx:
    """The box grown about its centre."""
    x0, y0, x1, y1 = box_px
    du, dv = 0.5 * config.widen * (x1 - x0), 0.5 * config.heighten * (y1 - y0)
    return (x0 - du, y0 - dv, x1 + du, y1 + dv)


def clip(box_px: BoxPx, camera: PinholeCamera) -> BoxPx | None:
    """The part of the box that lies in the image; None if there is none (or a coordinate is not finite)."""
    x0, y0, x1, y1 = box_px
    clipped = (max(x0, 0.0), max(y0, 0.0), min(x1, float(camera.width_px)), min(y1, float(camera.height_px)))
    return clipped if clipped[0] < clipped[2] and clipped[1] < clipped[3] else None


def map_into_boxes(
    xyz_m: Float32[np.ndarray, "3 n"],
    T_camera_lidar: Transform,
    camera: PinholeCamera,
    boxes_px: Sequence[BoxPx],
) -> tuple[MappedPoints, ...]:
    """The points of a LiDAR frame, given as [3 n], that eq. 6 maps into each box.

    A cheap crop by bearing in float32 comes first, the exact projection in float64 only for what it leaves.
    The crop is slightly larger than the boxes; it also keeps out points far outside the field of view, which
    a distortion polynomial would fold back into the image.
    """
    if not boxes_px:
        return ()
    near = _crop(xyz_m, T_camera_lidar, _bearing_bounds(boxes_px, camera))
    uv_px = camera.project(T_camera_lidar.apply(xyz_m.take(near, axis=1).T))
    inside = (inside_box(uv_px, box).nonzero()[0] for box in boxes_px)
    return tuple(MappedPoints(points=near[rows], uv_px=uv_px[rows]) for rows in inside)


def _bearing_bounds(boxes_px: Sequence[BoxPx], camera: PinholeCamera) -> tuple[float, float, float, float]:
    """Bounds (left, top, right, bottom) of x/z and y/z over the borders of all boxes, with a margin."""
    corners = np.array(boxes_px)
    low, high = corners[:, None, :2], corners[:, None, 2:]
    rays = camera.unproject((low + (high - low) * _BORDER).reshape(-1, 2))
    if not np.isfinite(rays).all():  # the distortion cannot be inverted there: no bearing may be ruled out
        return (-np.inf, -np.inf, np.inf, np.inf)
    low, high = rays.min(axis=0), rays.max(axis=0)
    margin = 0.02 * (high - low) + 1e-3
    left, top = (low - margin).tolist()
    right, bottom = (high + margin).tolist()
    return left, top, right, bottom


def _crop(
    xyz_m: Float32[np.ndarray, "3 n"], T_camera_lidar: Transform, bounds: tuple[float, float, float, float]
) -> Int64[np.ndarray, " k"]:
    """Indices of the points in front of the camera whose bearing lies within the bounds."""
    left, top, right, bottom = bounds
    rotation = T_camera_lidar.rotation.astype(np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        x, y, z = rotation @ xyz_m + T_camera_lidar.translation_m.astype(np.float32)[:, None]
        inside = (z > np.float32(0.5 * MIN_DEPTH_M)) & np.isfinite(x + y + z)
        if np.isfinite(left):
            inside &= (x >= np.float32(left) * z) & (x <= np.float32(right) * z)
            inside &= (y >= np.float32(top) * z) & (y <= np.float32(bottom) * z)
    return np.flatnonzero(inside)
