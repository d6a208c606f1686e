"""Exact 2-D boxes without a picture: the analytic outline of an object, and what of it is visible by rays.

Outlines: an ellipsoid's image under a pinhole camera is a conic whose extent follows in closed form from
the dual conic C* = P Q* P^T (Hartley and Zisserman, Multiple View Geometry, result 8.9). A sphere is an
ellipsoid, a disc a flat one; a capsule is the hull of two spheres, a cylinder of two discs, a box of eight
points.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import BoxPx
from simbench.sensors import rays
from simbench.truth import TrueBox

NEAR_M = 0.05
COARSE_SAMPLES = 40  # samples along the longer side in the first look
CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def outline_px(
    kind: np.ndarray,
    size_m: Float64[np.ndarray, "g 3"],
    rotation: Float64[np.ndarray, "g 3 3"],
    centre_m: Float64[np.ndarray, "g 3"],
    camera: PinholeCamera,
) -> BoxPx | None:
    """Extent of primitives given in the optical frame, unclipped. None when a part reaches behind the
    camera."""
    corners: list[np.ndarray] = []
    box = kind == rays.BOX
    if box.any():
        local = CORNERS[None] * size_m[box][:, None, :]
        turned = np.einsum("gij,gkj->gki", rotation[box], local)
        corners.append((turned + centre_m[box][:, None]).reshape(-1, 3))
    axes, centres = _as_ellipsoids(kind[~box], size_m[~box], rotation[~box], centre_m[~box])
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    if corners:
        points = np.concatenate(corners)
        if points[:, 2].min() < NEAR_M:
            return None
        uv = np.stack([points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]], axis=1)
        low, high = np.minimum(low, uv.min(axis=0)), np.maximum(high, uv.max(axis=0))
    if len(centres):
        # Dual quadric of an ellipsoid with half-axes `axes` about c: [A A^T - c c^T, -c; -c^T, -1].
        gram = np.einsum("gij,gkj->gik", axes, axes)
        if (centres[:, 2] - np.sqrt(gram[:, 2, 2])).min() < NEAR_M:
            return None
        dual = gram - np.einsum("gi,gj->gij", centres, centres)
        for i in range(2):
            middle, c_ii, c_zz = dual[:, i, 2], dual[:, i, i], dual[:, 2, 2]
            root = np.sqrt(np.clip(middle**2 - c_ii * c_zz, 0.0, None))
            ends = np.stack([(middle - root) / c_zz, (middle + root) / c_zz])
            low[i], high[i] = min(low[i], ends.min()), max(high[i], ends.max())
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
    return (
        float(fx * low[0] + cx),
        float(fy * low[1] + cy),
        float(fx * high[0] + cx),
        float(fy * high[1] + cy),
    )


def _as_ellipsoids(
    kind: np.ndarray,
    size_m: Float64[np.ndarray, "g 3"],
    rotation: Float64[np.ndarray, "g 3 3"],
    centre_m: Float64[np.ndarray, "g 3"],
) -> tuple[Float64[np.ndarray, "e 3 3"], Float64[np.ndarray, "e 3"]]:
    """Half-axes (columns) and centres of the ellipsoids whose hull each round primitive is."""
    round_one = (kind == rays.SPHERE) | (kind == rays.ELLIPSOID)
    half = np.where((kind == rays.SPHERE)[:, None], size_m[:, :1], size_m)
    axes = [rotation[round_one] * half[round_one][:, None, :]]
    centres = [centre_m[round_one]]
    for flat, which in ((False, kind == rays.CAPSULE), (True, kind == rays.CYLINDER)):
        radius = size_m[which][:, :1]
        ends = np.repeat(radius, 3, axis=1)
        if flat:
            ends[:, 2] = 0.0
        for side in (-1.0, 1.0):
            axes.append(rotation[which] * ends[:, None, :])
            centres.append(centre_m[which] + side * size_m[which][:, 1:2] * rotation[which][:, :, 2])
    return np.concatenate(axes), np.concatenate(centres)


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
            raise ValueError("boxes by rays need an undistorted camera")
        self.geoms, self.T_world_camera, self.camera = geoms, T_world_camera, camera
        self.rotation, self.position_m = rotation, position_m
        body_R, body_p = rotation[geoms.body], position_m[geoms.body]
        self.centre_world_m = np.einsum("gij,gj->gi", body_R, geoms.position_m) + body_p
        self.rotation_world = body_R @ geoms.rotation
        T_camera_world = T_world_camera.inverse()
        self.centre_camera_m = T_camera_world.apply(self.centre_world_m)
        self.rotation_camera = T_camera_world.rotation @ self.rotation_world

    def may_show(self, centre_camera_m: Float64[np.ndarray, "3"], radius_m: float) -> bool:
        """Whether a sphere (optical frame) can reach into the view; never False for one that does."""
        x, y, z = centre_camera_m
        camera = self.camera
        if z + radius_m < NEAR_M:
            return False
        slopes = (
            (x, camera.cx_px / camera.fx_px, (camera.width_px - camera.cx_px) / camera.fx_px),
            (y, camera.cy_px / camera.fy_px, (camera.height_px - camera.cy_px) / camera.fy_px),
        )
        return all(
            (-value - low * z) / np.hypot(1.0, low) <= radius_m
            and (value - high * z) / np.hypot(1.0, high) <= radius_m
            for value, low, high in slopes
        )

    def outline(self, mask: Bool[np.ndarray, " g"]) -> BoxPx | None:
        """The unclipped extent of the geoms in `mask`; the whole image plane where they reach behind it.

        None when nothing of them is in front of the camera or inside the image.
        """
        depth, bound = self.centre_camera_m[mask][:, 2], self.geoms.bound_m[mask]
        if (depth + bound).max() < NEAR_M:
            return None
        box = outline_px(
            self.geoms.kind[mask],
            self.geoms.size_m[mask],
            self.rotation_camera[mask],
            self.centre_camera_m[mask],
            self.camera,
        )
        width, height = float(self.camera.width_px), float(self.camera.height_px)
        if box is None:
            return (-1.0, -1.0, width + 1.0, height + 1.0)
        if box[2] <= 0.0 or box[3] <= 0.0 or box[0] >= width or box[1] >= height:
            return None
        return box

    def cast(self, us: np.ndarray, vs: np.ndarray, mask: Bool[np.ndarray, " g"]) -> np.ndarray:
        """Geom index (into the full table) at pixel columns us [c] and rows vs [r], as [c r]; -1: nothing."""
        camera = self.camera
        hits = rays.cast_pixels(
            self.geoms,
            mask,
            self.rotation,
            self.position_m,
            self.T_world_camera.rotation,
            self.T_world_camera.translation_m,
            (us + 0.5 - camera.cx_px) / camera.fx_px,
            (vs + 0.5 - camera.cy_px) / camera.fy_px,
        )
        return hits.geom

    def near_box(self, box: BoxPx, mask: Bool[np.ndarray, " g"]) -> Bool[np.ndarray, " g"]:
        """Geoms that can occlude or be the object in `box`: bounding sphere meets the box's cone, no
        farther."""
        camera = self.camera
        corner = np.array(
            [
                [(u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, 1.0]
                for u in (box[0] - 1, box[2] + 1)
                for v in (box[1] - 1, box[3] + 1)
            ]
        )
        corner /= np.linalg.norm(corner, axis=1, keepdims=True)
        axis = corner.sum(axis=0)
        axis /= np.linalg.norm(axis)
        half = np.arccos(np.clip(corner @ axis, -1.0, 1.0)).max()
        distance = np.linalg.norm(self.centre_camera_m, axis=1)
        bound = self.geoms.bound_m
        with np.errstate(invalid="ignore"):
            angle = np.arccos(np.clip(self.centre_camera_m @ axis / np.maximum(distance, 1e-9), -1.0, 1.0))
            reach = np.arcsin(np.clip(bound / np.maximum(distance, 1e-9), 0.0, 1.0))
        farthest = (distance[mask] + bound[mask]).max()
        inside = (angle <= half + reach + 1e-6) | (distance <= bound)
        near: np.ndarray = (inside & (distance - bound <= farthest)) | ~np.isfinite(bound)
        return near


def true_box(
    view: View, object_id: int, mask: Bool[np.ndarray, " g"], min_height_px: float
) -> TrueBox | None:
    """Amodal box (clipped to the image), visible box and visible fraction of one object; None when out of
    view or its outline is lower than `min_height_px`.

    The visible box is exact to the pixel: a coarse look, then every pixel between it and the outline.
    """
    outline = view.outline(mask)
    if outline is None or outline[3] - outline[1] < min_height_px:
        return None
    width, height = view.camera.width_px, view.camera.height_px
    x0, y0 = max(int(np.floor(outline[0])), 0), max(int(np.floor(outline[1])), 0)
    x1, y1 = min(int(np.ceil(outline[2])), width), min(int(np.ceil(outline[3])), height)
    truncated = outline[0] < 0 or outline[1] < 0 or outline[2] > width or outline[3] > height
    around = view.near_box((x0, y0, x1, y1), mask)
    stride = max(1, int(np.ceil(max(x1 - x0, y1 - y0) / COARSE_SAMPLES)))
    us, vs = np.arange(x0, x1, stride), np.arange(y0, y1, stride)
    own = view.cast(us, vs, mask) >= 0
    if not own.any():
        us, vs = np.arange(x0, x1), np.arange(y0, y1)
        own = view.cast(us, vs, mask) >= 0
        if not own.any():
            return None
    seen = own & mask[view.cast(us, vs, around)]
    if truncated:
        extent = _extent(view, mask, mask, own, us, vs, (x0, y0, x1, y1))
        amodal: BoxPx = tuple(float(v) for v in extent)  # type: ignore[assignment]
    else:
        amodal = outline
    visible: BoxPx | None = None
    if seen.any():
        found = _extent(view, mask, around, seen, us, vs, (x0, y0, x1, y1))
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
    pixel of the four bands between it and the limit."""
    columns, rows = us[coarse.any(axis=1)], vs[coarse.any(axis=0)]
    x0, x1, y0, y1 = int(columns[0]), int(columns[-1]) + 1, int(rows[0]), int(rows[-1]) + 1
    lx0, ly0, lx1, ly1 = limit

    def look(a: int, b: int, c: int, d: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Columns and rows of [a, b) x [c, d) that show the object."""
        if a >= b or c >= d:
            return None
        u, v = np.arange(a, b), np.arange(c, d)
        geom = view.cast(u, v, scene)
        found = (geom >= 0) & mask[geom]
        if not found.any():
            return None
        return u[found.any(axis=1)], v[found.any(axis=0)]

    # The four bands between the coarse extent and the limit; the sides run over the full height.
    for band in ((lx0, x0, ly0, ly1), (x1, lx1, ly0, ly1), (x0, x1, ly0, y0), (x0, x1, y1, ly1)):
        found = look(*band)
        if found is not None:
            x0, x1 = min(x0, int(found[0][0])), max(x1, int(found[0][-1]) + 1)
            y0, y1 = min(y0, int(found[1][0])), max(y1, int(found[1][-1]) + 1)
    return x0, y0, x1, y1
