"""Known points in the world that every camera observes with its image: what receipts measure with.

They stand for a surveyed calibration field, exist for receipts only, and never reach a pipeline. Each frame
has its own points, spread over the nominal field of view at 6 to 30 m; where they appear comes from the same
camera pose that makes the boxes and the picture of that frame.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform

GRID = (4, 3)
DEPTHS_M = (6.0, 30.0, 11.0, 18.0, 8.0)


def points_m(camera: PinholeCamera, T_world_camera: Transform) -> Float64[np.ndarray, "m 3"]:
    """World points on a grid inside the nominal view, at varied depths."""
    u, v = np.meshgrid(
        np.linspace(0.15, 0.85, GRID[0]) * camera.width_px, np.linspace(0.2, 0.8, GRID[1]) * camera.height_px
    )
    depth = np.resize(np.array(DEPTHS_M), u.size)
    x = (u.ravel() - camera.cx_px) / camera.fx_px * depth
    y = (v.ravel() - camera.cy_px) / camera.fy_px * depth
    return T_world_camera.apply(np.stack([x, y, depth], axis=1))
