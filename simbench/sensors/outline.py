"""The exact image of primitives under a pinhole: the extent of their outline, in closed form.

An ellipsoid's image is a conic whose extent follows from the dual conic C* = P Q* P^T (Hartley and Zisserman,
Multiple View Geometry, result 8.9). A sphere is an ellipsoid, a disc a flat one; a capsule is the hull of two
spheres, a cylinder of two discs, a box of eight points.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx
from simbench.sensors.compiled import jit
from simbench.sensors.rays import BOX, CAPSULE, CYLINDER, SPHERE

NEAR_M = 0.05


def outline_px(
    kind: Int[np.ndarray, " g"],
    size_m: Float64[np.ndarray, "g 3"],
    rotation: Float64[np.ndarray, "g 3 3"],
    centre_m: Float64[np.ndarray, "g 3"],
    camera: PinholeCamera,
) -> BoxPx | None:
    """Extent of primitives given in the optical frame, unclipped. None when a part reaches behind the
    camera. The camera's distortion is not looked at."""
    extent = np.empty(4)
    if not _outline(kind, size_m, np.ascontiguousarray(rotation), np.ascontiguousarray(centre_m), extent):
        return None
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
    x0, y0, x1, y1 = extent.tolist()
    return (fx * x0 + cx, fy * y0 + cy, fx * x1 + cx, fy * y1 + cy)


@jit
def _outline(kind, size, rotation, centre, extent):  # type: ignore[no-untyped-def]
    """Extent (x0, y0, x1, y1) of the slopes x / z and y / z; False when something lies behind NEAR_M."""
    extent[0], extent[1], extent[2], extent[3] = np.inf, np.inf, -np.inf, -np.inf
    half, c = np.empty(3), np.empty(3)
    for i in range(kind.shape[0]):
        R = rotation[i]
        if kind[i] == BOX:
            for corner in range(8):
                for r in range(3):
                    c[r] = centre[i, r]
                    for k in range(3):
                        side = 1.0 if (corner >> k) & 1 else -1.0
                        c[r] += side * R[r, k] * size[i, k]
                if c[2] < NEAR_M:
                    return False
                for a in range(2):
                    extent[a] = min(extent[a], c[a] / c[2])
                    extent[2 + a] = max(extent[2 + a], c[a] / c[2])
            continue
        ends = 2 if kind[i] == CAPSULE or kind[i] == CYLINDER else 1
        for k in range(3):
            half[k] = size[i, 0] if kind[i] == SPHERE or ends == 2 else size[i, k]
        if kind[i] == CYLINDER:
            half[2] = 0.0
        for end in range(ends):
            for r in range(3):
                c[r] = centre[i, r]
                if ends == 2:
                    c[r] += (1.0 if end else -1.0) * size[i, 1] * R[r, 2]
            deep = 0.0
            for k in range(3):
                deep += (R[2, k] * half[k]) ** 2
            if c[2] - np.sqrt(deep) < NEAR_M:
                return False
            # Dual quadric of an ellipsoid with half-axes A about c: [A A^T - c c^T, -c; -c^T, -1].
            zz = deep - c[2] * c[2]
            for a in range(2):
                aa, az = -c[a] * c[a], -c[a] * c[2]
                for k in range(3):
                    aa += (R[a, k] * half[k]) ** 2
                    az += R[a, k] * half[k] * R[2, k] * half[k]
                root = np.sqrt(max(az * az - aa * zz, 0.0))
                one, other = (az - root) / zz, (az + root) / zz
                extent[a] = min(extent[a], min(one, other))
                extent[2 + a] = max(extent[2 + a], max(one, other))
    return True
