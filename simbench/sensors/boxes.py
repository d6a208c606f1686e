"""Exact 2-D boxes without a picture: the outline in closed form, and what of it is visible by rays."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import BoxPx
from simbench.sensors import rays
from simbench.sensors.lens import row_fans
from simbench.sensors.outline import NEAR_M, outline_px
from simbench.truth import TrueBox

MOVED_M = 1.0  # more than anything moves while an image is read out
Window = tuple[int, int, int, int]
"""Pixels (x0, y0, x1, y1), x1 and y1 not in it."""


class View:
    """A frozen instant seen by one camera: casts the rays of pixels against all geoms or one object's.

    rotation, position: T_world_body of all bodies at the instant, [b 3 3] and [b 3].
    """

    def __init__(
        self,
        geoms: rays.Geoms,
        rotation: Float64[np.ndarray, "b 3 3"],
        position_m: Float64[np.ndarray, "b 3"],
        T_world_camera: Transform,
        camera: PinholeCamera,
    ) -> None:
        if any(camera.distortion):
            raise ValueError("a view of one instant needs an undistorted camera; see row_view")
        self.geoms, self.T_world_camera, self.camera = geoms, T_world_camera, camera
        self.placed = rays.place(geoms, rotation[None], position_m[None])
        frames = self.placed.still
        self.centre_camera_m = (frames[:, 9:] - T_world_camera.translation_m) @ T_world_camera.rotation

    def may_show(
        self, geom: Int[np.ndarray, " n"], radius_m: Float64[np.ndarray, " n"]
    ) -> Bool[np.ndarray, " n"]:
        """Whether spheres about geoms' centres can reach into the view; never False for one that does."""
        x, y, z = self.centre_camera_m[geom].T
        camera = self.camera
        shown: np.ndarray = z + radius_m >= NEAR_M
        slopes = (
            (x, camera.cx_px / camera.fx_px, (camera.width_px - camera.cx_px) / camera.fx_px),
            (y, camera.cy_px / camera.fy_px, (camera.height_px - camera.cy_px) / camera.fy_px),
        )
        for value, low, high in slopes:
            shown &= (-value - low * z) / np.hypot(1.0, low) <= radius_m
            shown &= (value - high * z) / np.hypot(1.0, high) <= radius_m
        return shown

    def outline(self, mask: Bool[np.ndarray, " g"]) -> BoxPx | None:
        """The unclipped extent of the geoms in `mask`; the whole image plane where they reach behind it.

        None when nothing of them is in front of the camera or inside the image.
        """
        which = np.flatnonzero(mask)
        centre_m = self.centre_camera_m[which]
        if (centre_m[:, 2] + self.geoms.bound_m[which]).max() < NEAR_M:
            return None
        rotation = self.T_world_camera.rotation.T @ self.placed.still[which, :9].reshape(-1, 3, 3)
        kind, size_m = self.geoms.kind[which], self.geoms.size_m[which]
        box = outline_px(kind, size_m, rotation, centre_m, self.camera)
        width, height = float(self.camera.width_px), float(self.camera.height_px)
        if box is None:
            return (-1.0, -1.0, width + 1.0, height + 1.0)
        if box[2] <= 0.0 or box[3] <= 0.0 or box[0] >= width or box[1] >= height:
            return None
        return box

    def cast(self, window: Window, mask: Bool[np.ndarray, " g"]) -> Int[np.ndarray, "r c"]:
        """Geom index (into the full table) at every pixel of a window, among those in `mask`; -1: nothing."""
        pose = self.T_world_camera
        return rays.cast_window(
            self.placed,
            np.flatnonzero(mask),
            np.zeros(1, dtype=np.int64),
            np.zeros(1),
            pose.rotation[None],
            pose.translation_m[None],
            row_fans(self.camera),
            np.zeros_like(row_fans(self.camera).pose),
            window,
        )


def true_box(
    view: View, object_id: int, mask: Bool[np.ndarray, " g"], min_height_px: float
) -> TrueBox | None:
    """Amodal box (clipped to the image), visible box and visible fraction of one object; None when out of
    view or its outline is lower than `min_height_px`. The visible box is exact to the pixel."""
    outline = view.outline(mask)
    if outline is None or outline[3] - outline[1] < min_height_px:
        return None
    width, height = view.camera.width_px, view.camera.height_px
    x0, y0 = max(int(np.floor(outline[0])), 0), max(int(np.floor(outline[1])), 0)
    x1, y1 = min(int(np.ceil(outline[2])), width), min(int(np.ceil(outline[3])), height)
    window = (x0, y0, x1, y1)
    first = view.cast(window, np.ones_like(mask))
    seen = (first >= 0) & mask[first]
    own = view.cast(window, mask) >= 0 if not seen.any() or may_hide(view, first, mask) else seen
    if not own.any():
        return None
    truncated = outline[0] < 0 or outline[1] < 0 or outline[2] > width or outline[3] > height
    return TrueBox(
        object_id=object_id,
        amodal_px=_extent(own, x0, y0) if truncated else outline,
        visible_px=_extent(seen, x0, y0) if seen.any() else None,
        visible_fraction=float(np.count_nonzero(seen) / np.count_nonzero(own)),
    )


def may_hide(view: View, first: Int[np.ndarray, "r c"], mask: Bool[np.ndarray, " g"]) -> bool:
    """Whether one of the geoms that are seen may stand before one of those in `mask`, by their distances."""
    distance_m, bound_m = np.linalg.norm(view.centre_camera_m, axis=1), view.geoms.bound_m
    shown = np.zeros(len(mask) + 1, dtype=np.bool_)
    shown[first] = True  # the last for -1, nothing
    farthest_m = (distance_m + bound_m)[mask].max() + MOVED_M
    other = shown[:-1] & ~mask & np.isfinite(bound_m)  # the ground hides nothing that stands on it
    return bool((distance_m[other] - bound_m[other] < farthest_m).any())


def _extent(shown: Bool[np.ndarray, "r c"], x0: int, y0: int) -> BoxPx:
    """The extent of the pixels that show something, the first of which is (x0, y0)."""
    columns, rows = np.flatnonzero(shown.any(axis=0)), np.flatnonzero(shown.any(axis=1))
    return (
        float(x0 + columns[0]), float(y0 + rows[0]), float(x0 + columns[-1] + 1), float(y0 + rows[-1] + 1)
    )  # fmt: skip
