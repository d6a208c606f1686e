"""Where every pixel looks: directions of a whole image through a pinhole with Brown-Conrady distortion."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.geometry import readonly
from scenarios.errors import BadInput
from simbench.sensors import rays
from simbench.sensors.lens_kernel import undistort


@lru_cache(maxsize=8)
def pixel_directions(camera: PinholeCamera) -> Float64[np.ndarray, "h w 3"]:
    """Unit vectors in the optical frame (x right, y down, z forward) through the pixels' centres.

    Pixel (row r, column c) has its centre at (u, v) = (c + 0.5, r + 0.5). Read-only, kept per camera: a view
    of `direction_planes`. Raises BadInput as that does.
    """
    return direction_planes(camera).transpose(0, 2, 1)


@lru_cache(maxsize=8)
def direction_planes(camera: PinholeCamera) -> Float64[np.ndarray, "h 3 w"]:
    """The same with the pixels of a row side by side, as kernels read them.

    Raises BadInput where a pixel has no direction, or the lens folds the picture over itself.
    """
    direction = np.empty((camera.height_px, camera.width_px, 3))
    direction[..., 0], direction[..., 1] = _slopes(camera)
    direction[..., 2] = 1.0
    direction /= np.sqrt(np.einsum("hwi,hwi->hw", direction, direction))[..., None]
    return readonly(direction.transpose(0, 2, 1))


@lru_cache(maxsize=8)
def row_fans(camera: PinholeCamera) -> rays.Fans:
    """The same directions as fans for `rays.cast_fans`: one per row, with a pose of its own, ascending in u.

    Results lie row by row. Raises BadInput as `pixel_directions`.
    """
    rows = np.arange(camera.height_px)
    if not any(camera.distortion):
        x = (np.arange(camera.width_px) + 0.5 - camera.cx_px) / camera.fx_px
        y = (rows + 0.5 - camera.cy_px) / camera.fy_px
        scale, zero, one = 1.0 / np.sqrt(1.0 + y * y), np.zeros_like(y), np.ones_like(y)
        ahead = np.stack([zero, y, one], axis=1) * scale[:, None]
        normal = np.stack([zero, one, -y], axis=1) * scale[:, None]
        frame = np.stack([ahead, np.stack([one, zero, zero], axis=1), normal], axis=2)
        return rays.make_alike_fans(frame, x, scale, rows, rows * camera.width_px, 1)
    direction = np.ascontiguousarray(pixel_directions(camera))
    # The plane of a row's ends (any plane near it will do: a bent row leaves it by its skew).
    across = direction[:, -1] - direction[:, 0]
    across /= np.linalg.norm(across, axis=1)[:, None]
    ahead = direction.mean(axis=1)
    ahead -= np.einsum("hi,hi->h", ahead, across)[:, None] * across
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    frame = np.stack([ahead, across, np.cross(ahead, across)], axis=2)
    along = np.einsum("hij,hwi->hwj", frame, direction)
    slope = np.maximum.accumulate(along[..., 1] / along[..., 0], axis=1)
    return rays.make_fans(frame, slope, along[..., 2] / along[..., 0], rows, rows * camera.width_px, 1)


def _slopes(camera: PinholeCamera) -> tuple[Float64[np.ndarray, "h w"], Float64[np.ndarray, "h w"]]:
    """x / z and y / z of every pixel, as `PinholeCamera.unproject` has them."""
    u, v = np.meshgrid(np.arange(camera.width_px) + 0.5, np.arange(camera.height_px) + 0.5)
    x, y = (u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px
    if not any(camera.distortion):
        return x, y
    good = np.empty(x.size, dtype=np.bool_)
    undistort(
        x.ravel(), y.ravel(), camera.fx_px, camera.fy_px, *camera.distortion,
        flat_x := x.flatten(), flat_y := y.flatten(), good,
    )  # fmt: skip
    if not good.all():
        row, column = divmod(int(np.flatnonzero(~good)[0]), camera.width_px)
        raise BadInput(
            f"the lens distortion {camera.distortion} gives pixel ({column}, {row}) no direction: it is too "
            "strong for this field of view"
        )
    return flat_x.reshape(x.shape), flat_y.reshape(y.shape)
