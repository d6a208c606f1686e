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

SLIM_PX = 2.0  # what is slimmer may slip between pixels
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

    def outline(self, geom: Int[np.ndarray, " n"]) -> BoxPx | None:
        """The unclipped extent of some geoms; the whole image plane where they reach behind it.

        None when nothing of them is in front of the camera or inside the image.
        """
        centre_m = self.centre_camera_m[geom]
        if (centre_m[:, 2] + self.geoms.bound_m[geom]).max() < NEAR_M:
            return None
        rotation = self.T_world_camera.rotation.T @ self.placed.still[geom, :9].reshape(-1, 3, 3)
        kind, size_m = self.geoms.kind[geom], self.geoms.size_m[geom]
        box = outline_px(kind, size_m, rotation, centre_m, self.camera)
        width, height = float(self.camera.width_px), float(self.camera.height_px)
        if box is None:
            return (-1.0, -1.0, width + 1.0, height + 1.0)
        if box[2] <= 0.0 or box[3] <= 0.0 or box[0] >= width or box[1] >= height:
            return None
        return box

    def hiders(self, window: Window, geom: Int[np.ndarray, " n"]) -> Int[np.ndarray, " m"]:
        """Other geoms that may stand before one of some, in a window; may name too many."""
        pose, camera = self.T_world_camera, self.camera
        x0, y0, x1, y1 = window
        slopes = (
            (x0 - camera.cx_px) / camera.fx_px,
            (y0 - camera.cy_px) / camera.fy_px,
            (x1 - camera.cx_px) / camera.fx_px,
            (y1 - camera.cy_px) / camera.fy_px,
        )
        return rays.hiders(self.placed, geom, pose.translation_m, pose.rotation, slopes)

    def cast(self, window: Window, geom: Int[np.ndarray, " n"]) -> rays.Hits:
        """What the rays [r c] of a window's pixels meet first among some geoms."""
        pose, fans = self.T_world_camera, row_fans(self.camera)
        still = np.zeros(1)
        return rays.cast_window(
            self.placed, geom, still.astype(np.int64), still, pose.rotation[None], pose.translation_m[None],
            fans, np.zeros_like(fans.pose), window,
        )  # fmt: skip


def true_box(view: View, object_id: int, geom: Int[np.ndarray, " n"], min_height_px: float) -> TrueBox | None:
    """Amodal box (clipped to the image), visible box and visible fraction of one object, which is made of the
    geoms `geom`; None when out of view or its outline is lower than `min_height_px`.

    The visible box of what nothing can hide is the amodal one; else it is found by rays, to the pixel.
    """
    outline = view.outline(geom)
    if outline is None or outline[3] - outline[1] < min_height_px:
        return None
    width, height = view.camera.width_px, view.camera.height_px
    x0, y0 = max(int(np.floor(outline[0])), 0), max(int(np.floor(outline[1])), 0)
    x1, y1 = min(int(np.ceil(outline[2])), width), min(int(np.ceil(outline[3])), height)
    window = (x0, y0, x1, y1)
    truncated = outline[0] < 0 or outline[1] < 0 or outline[2] > width or outline[3] > height
    alone: rays.Hits | None = None
    amodal = visible = outline
    if truncated or outline[2] - outline[0] < SLIM_PX:
        alone = view.cast(window, geom)
        if not (alone.geom >= 0).any():
            return None
        visible = _extent(alone.geom >= 0, window)
        amodal = visible if truncated else outline
        alone, window = _part(alone, window, visible), _pixels(visible)
    others = view.hiders(window, geom)
    before = view.cast(window, others) if len(others) else None
    if before is None or not _hides(before, view, geom, alone, window):
        return TrueBox(object_id=object_id, amodal_px=amodal, visible_px=visible, visible_fraction=1.0)
    if alone is None:
        alone = view.cast(window, geom)
    own = alone.geom >= 0
    seen = own & (alone.range_m <= before.range_m)
    return TrueBox(
        object_id=object_id,
        amodal_px=amodal,
        visible_px=_extent(seen, window) if seen.any() else None,
        visible_fraction=float(np.count_nonzero(seen) / np.count_nonzero(own)),
    )


def _hides(
    before: rays.Hits, view: View, geom: Int[np.ndarray, " n"], alone: rays.Hits | None, window: Window
) -> bool:
    """Whether anything that rays met in a window stands before one of some geoms; what they met of
    these `alone` is cast where it is needed, if it is not there."""
    if not (before.geom >= 0).any():
        return False
    met = _extent(before.geom >= 0, window)
    there = view.cast(_pixels(met), geom) if alone is None else _part(alone, window, met)
    return bool(((there.geom >= 0) & (_part(before, window, met).range_m < there.range_m)).any())


def _part(hits: rays.Hits, window: Window, box_px: BoxPx) -> rays.Hits:
    """Those of a window's hits that are in a box."""
    x0, y0, x1, y1 = _pixels(box_px)
    part = np.s_[y0 - window[1] : y1 - window[1], x0 - window[0] : x1 - window[0]]
    return rays.Hits(range_m=hits.range_m[part], geom=hits.geom[part], cosine=hits.cosine[part])


def _pixels(box_px: BoxPx) -> Window:
    x0, y0, x1, y1 = box_px
    return int(x0), int(y0), int(x1), int(y1)


def _extent(shown: Bool[np.ndarray, "r c"], window: Window) -> BoxPx:
    """The extent of the pixels of a window that show something."""
    x0, y0 = window[:2]
    columns, rows = np.flatnonzero(shown.any(axis=0)), np.flatnonzero(shown.any(axis=1))
    return (
        float(x0 + columns[0]), float(y0 + rows[0]), float(x0 + columns[-1] + 1), float(y0 + rows[-1] + 1)
    )  # fmt: skip
