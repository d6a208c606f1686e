"""Exact 2-D boxes without a picture: the outline in closed form, and what of it is visible by rays."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int, Int64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import BoxPx
from simbench.sensors import rays
from simbench.sensors.outline import NEAR_M, outline_px
from simbench.truth import TrueBox

WHOLE_PX = 40_000  # outlines up to this area are looked at pixel by pixel
COARSE_SAMPLES = 40  # samples along the longer side in the first look at larger ones


class View:
    """A frozen instant seen by one camera: casts pixel rays against all geoms or one object's.

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

    def cast(
        self, us: Int64[np.ndarray, " c"], vs: Int64[np.ndarray, " r"], mask: Bool[np.ndarray, " g"]
    ) -> Int[np.ndarray, "c r"]:
        """Geom index (into the full table) at pixel columns us and rows vs, ascending; -1: nothing."""
        camera, pose = self.camera, self.T_world_camera
        return rays.cast_window(
            self.placed,
            np.flatnonzero(mask),
            np.zeros(1, dtype=np.int64),
            np.zeros(1),
            pose.rotation[None],
            pose.translation_m[None],
            np.zeros(len(vs), dtype=np.int64),
            (us + 0.5 - camera.cx_px) / camera.fx_px,
            (vs + 0.5 - camera.cy_px) / camera.fy_px,
        ).T


def true_box(
    view: View, object_id: int, mask: Bool[np.ndarray, " g"], min_height_px: float
) -> TrueBox | None:
    """Amodal box (clipped to the image), visible box and visible fraction of one object; None when out of
    view or its outline is lower than `min_height_px`.

    The visible box is exact to the pixel: every pixel of the outline is looked at, or, of large ones, a grid
    and every pixel between what it shows and the outline.
    """
    outline = view.outline(mask)
    if outline is None or outline[3] - outline[1] < min_height_px:
        return None
    width, height = view.camera.width_px, view.camera.height_px
    x0, y0 = max(int(np.floor(outline[0])), 0), max(int(np.floor(outline[1])), 0)
    x1, y1 = min(int(np.ceil(outline[2])), width), min(int(np.ceil(outline[3])), height)
    truncated = outline[0] < 0 or outline[1] < 0 or outline[2] > width or outline[3] > height
    everything = np.ones_like(mask)
    stride = 1
    if (x1 - x0) * (y1 - y0) > WHOLE_PX:
        stride = int(np.ceil(max(x1 - x0, y1 - y0) / COARSE_SAMPLES))
    us, vs = np.arange(x0, x1, stride), np.arange(y0, y1, stride)
    own = view.cast(us, vs, mask) >= 0
    if not own.any():
        us, vs = np.arange(x0, x1), np.arange(y0, y1)
        own = view.cast(us, vs, mask) >= 0
        if not own.any():
            return None
    seen = own & mask[view.cast(us, vs, everything)]
    if truncated:
        extent = _extent(view, mask, mask, own, us, vs, (x0, y0, x1, y1))
        amodal: BoxPx = tuple(float(v) for v in extent)  # type: ignore[assignment]
    else:
        amodal = outline
    visible: BoxPx | None = None
    if seen.any():
        found = _extent(view, mask, everything, seen, us, vs, (x0, y0, x1, y1))
        visible = tuple(float(v) for v in found)  # type: ignore[assignment]
    return TrueBox(
        object_id=object_id,
        amodal_px=amodal,
        visible_px=visible,
        visible_fraction=float(seen.sum() / own.sum()),
    )


def _extent(
    view: View, mask: np.ndarray, scene: np.ndarray, coarse: np.ndarray, us: np.ndarray, vs: np.ndarray,
    limit: tuple[int, int, int, int],
) -> tuple[int, int, int, int]:  # fmt: skip
    """Pixel extent of the pixels whose nearest hit among `scene` is in `mask`: the coarse extent, and every
    pixel of the four bands between it and the limit where the look was coarse."""
    columns, rows = us[coarse.any(axis=1)], vs[coarse.any(axis=0)]
    x0, x1, y0, y1 = int(columns[0]), int(columns[-1]) + 1, int(rows[0]), int(rows[-1]) + 1
    lx0, ly0, lx1, ly1 = limit
    if len(us) == lx1 - lx0 and len(vs) == ly1 - ly0:
        return x0, y0, x1, y1
    # The sides run over the full height.
    for a, b, c, d in ((lx0, x0, ly0, ly1), (x1, lx1, ly0, ly1), (x0, x1, ly0, y0), (x0, x1, y1, ly1)):
        if a >= b or c >= d:
            continue
        u, v = np.arange(a, b), np.arange(c, d)
        geom = view.cast(u, v, scene)
        found = (geom >= 0) & mask[geom]
        if found.any():
            columns, rows = u[found.any(axis=1)], v[found.any(axis=0)]
            x0, x1 = min(x0, int(columns[0])), max(x1, int(columns[-1]) + 1)
            y0, y1 = min(y0, int(rows[0])), max(y1, int(rows[-1]) + 1)
    return x0, y0, x1, y1
