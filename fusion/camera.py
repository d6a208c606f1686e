"""The pinhole camera of the paper's eq. 6, with Brown-Conrady distortion.

Eq. 6 prints the third row of the intrinsic matrix as [0 0 0 1]; it must be [0 0 1 0], then divide by Z.
Optical frame: x right, y down, z forward. Pixel coordinates: (0, 0) is the outer corner of the first
pixel, so that the centre of the first pixel is (0.5, 0.5) and an image spans [0, width] x [0, height].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fusion.geometry import Transform

MIN_DEPTH_M = 0.05


@dataclass(frozen=True, kw_only=True)
class PinholeCamera:
    """Intrinsics in pixels. `distortion` is (k1, k2, p1, p2, k3) as OpenCV orders it; zeros: none."""

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    width_px: int
    height_px: int
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """The [3 3] intrinsic matrix K."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1]], dtype=float)

    def project(self, xyz_camera_m: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
        """Points [n 3] in the optical frame to pixels [n 2]; NaN where z is not above 5 cm."""
        xyz = np.asarray(xyz_camera_m, dtype=np.float64)
        depth = xyz[:, 2]
        front = depth > MIN_DEPTH_M  # False for NaN too
        safe = np.where(front, depth, 1.0)
        x, y = xyz[:, 0] / safe, xyz[:, 1] / safe
        if any(self.distortion):
            x, y = self._distort(x, y)
        uv = np.stack([self.fx_px * x + self.cx_px, self.fy_px * y + self.cy_px], axis=1)
        uv[~front] = np.nan
        return uv

    def unproject(self, uv_px: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Pixels [n 2] to bearings [n 2], (x/z, y/z) in the optical frame: the inverse of `project`.

        Newton's iteration on the distortion; NaN where it does not come back to the pixel within 1e-6 px.
        """
        uv = np.asarray(uv_px, dtype=np.float64)
        x_d, y_d = (uv[:, 0] - self.cx_px) / self.fx_px, (uv[:, 1] - self.cy_px) / self.fy_px
        if not any(self.distortion):
            return np.stack([x_d, y_d], axis=1)
        x, y = x_d.copy(), y_d.copy()
        step = 1e-6
        with np.errstate(all="ignore"):  # what diverges is found out below
            for _ in range(20):
                fx, fy = self._distort(x, y)
                ex, ey = x_d - fx, y_d - fy
                if max(np.abs(ex).max(initial=0.0), np.abs(ey).max(initial=0.0)) < 1e-12:
                    break
                ax, ay = self._distort(x + step, y)
                bx, by = self._distort(x, y + step)
                j00, j10, j01, j11 = (ax - fx) / step, (ay - fy) / step, (bx - fx) / step, (by - fy) / step
                det = j00 * j11 - j01 * j10
                x, y = x + (j11 * ex - j01 * ey) / det, y + (j00 * ey - j10 * ex) / det
            fx, fy = self._distort(x, y)
            close = np.hypot((fx - x_d) * self.fx_px, (fy - y_d) * self.fy_px) < 1e-6
        return np.where(close[:, None], np.stack([x, y], axis=1), np.nan)

    def _distort(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Brown-Conrady: ideal bearings to the bearings that the lens makes of them."""
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )


def project_points(
    xyz_m: Float[np.ndarray, "n 3"], T_camera_source: Transform, camera: PinholeCamera
) -> Float[np.ndarray, "n 2"]:
    """The paper's mapping M (eq. 1, eq. 6): points [n 3] of a source frame to pixels [n 2], NaN behind."""
    return camera.project(T_camera_source.apply(xyz_m))


def inside_box(uv_px: Float[np.ndarray, "n 2"], box_px: tuple[float, float, float, float]) -> np.ndarray:
    """Which pixels [n] lie in the closed box (x0, y0, x1, y1); NaN never does."""
    x0, y0, x1, y1 = box_px
    u, v = uv_px[:, 0], uv_px[:, 1]
    return (u >= x0) & (u <= x1) & (v >= y0) & (v <= y1)
