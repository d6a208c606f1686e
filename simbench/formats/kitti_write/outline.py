"""How much of a 3-D box lies beyond the image's border: KITTI's truncation."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera

NEAR_M = 0.1
SIGNS = np.array([(a, b, c) for a in (-0.5, 0.5) for b in (-0.5, 0.5) for c in (-0.5, 0.5)])
EDGES = np.array(
    [(i, j) for i, j in combinations(range(8), 2) if np.count_nonzero(SIGNS[i] != SIGNS[j]) == 1]
)


def corners(
    centre_m: Float64[np.ndarray, "3"], yaw_rad: float, size_m: tuple[float, float, float]
) -> Float64[np.ndarray, "8 3"]:
    """Of an upright box in the camera's frame; size: length, width, height."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    along, across, down = np.array([c, 0.0, -s]), np.array([s, 0.0, c]), np.array([0.0, 1.0, 0.0])
    return np.asarray((SIGNS * np.array(size_m)) @ np.stack([along, across, down]) + centre_m)


def outside_share(
    centre_m: Float64[np.ndarray, "3"],
    yaw_rad: float,
    size_m: tuple[float, float, float],
    camera: PinholeCamera,
) -> float:
    """Share (0..1) of the rectangle around the projected box that is not in the image; what is nearer than
    10 cm or behind the camera is cut off first. 1: nothing is in the image."""
    box = corners(centre_m, yaw_rad, size_m)
    a, b = box[EDGES[:, 0]], box[EDGES[:, 1]]
    cut = (a[:, 2] < NEAR_M) != (b[:, 2] < NEAR_M)
    a, b = a[cut], b[cut]
    crossing = a + (b - a) * ((NEAR_M - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None]
    front = np.concatenate([box[box[:, 2] >= NEAR_M], crossing])
    if len(front) == 0:
        return 1.0
    uv = camera.project(front)
    low, high = uv.min(axis=0), uv.max(axis=0)
    inside = np.minimum(high, (camera.width_px, camera.height_px)) - np.maximum(low, 0.0)
    if (inside <= 0.0).any():
        return 1.0
    return float(1.0 - np.prod(inside) / np.prod(high - low))
