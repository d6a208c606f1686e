"""Boxes where each row of the image has its own time, or where the lens bends straight lines.

The outline is sampled: points on the rim of every primitive (the circle where sight lines touch an ellipsoid,
the edges of a box), each projected at a few instants of the read-out and taken at the one at which the row
that it falls on is exposed. Error of a rim of radius r px: below r (1 - cos(pi / RIM)), 0.1 px for 100 px.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float64, Int, Int64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform, readonly
from fusion.messages import BoxPx
from simbench.motion import Motion, at
from simbench.sensors import rays
from simbench.sensors.boxes import View, Window
from simbench.sensors.lens import pixel_directions, row_fans
from simbench.sensors.outline import NEAR_M
from simbench.sensors.rows import Exposure, exposure_at, row_times_ns

RIM = 72  # points around a rim
INSTANTS = 4  # of an object's own part of the read-out, between which points move evenly
STATIONS = 9  # along an edge that the lens may bend


def view_at(motion: Motion, name: str, camera: PinholeCamera, mid_ns: int, line_delay_ns: float) -> View:
    """What camera `name` sees about true time mid_ns: exact and quick for a global shutter and a straight
    lens, row by row otherwise."""
    if line_delay_ns == 0.0 and not any(camera.distortion):
        t_ns = np.array([mid_ns], dtype=np.int64)
        rotation, position = motion.poses(t_ns)
        pose = at(motion.sensor(name, t_ns))
        return View(motion.world.geoms, rotation[0], position[0], pose, camera)
    t_ns = row_times_ns(mid_ns, line_delay_ns, camera.height_px)
    return RowView(exposure_at(motion, name, t_ns), camera)


class RowView(View):
    """An image of which every row has its own instant and pose, through a lens that may distort.

    What it has of `View` (centre_camera_m and the like) is that of the middle row.
    """

    def __init__(self, exposure: Exposure, camera: PinholeCamera) -> None:
        self.exposure, self.camera, self.placed = exposure, camera, exposure.placed
        self.geoms = exposure.placed.geoms
        middle = camera.height_px // 2
        self.T_world_camera = Transform(
            rotation=exposure.R_world_camera[middle], translation_m=exposure.origin_m[middle]
        )
        everything = np.arange(len(self.geoms.kind))
        self.centre_camera_m = self._frames(middle, everything)[1]
        self._bent = any(camera.distortion)
        self._still = len(exposure.placed.keys) == 1
        looks = self._instants(0, camera.height_px - 1)
        self._centre_m = np.stack([self._frames(row, everything)[1] for row in looks])
        # How far any geom is from its place at the nearest instant, at most.
        steps = np.linalg.norm(np.diff(self._centre_m, axis=0), axis=2)
        self._slack_m = 0.5 * steps.max(axis=0) if len(steps) else np.zeros(len(everything))
        self._slope_low, self._slope_high, self._slope_most = _border_slopes(camera)

    def _instants(self, first_row: int, last_row: int) -> list[int]:
        """A few rows from the first to the last, one where all have the same time."""
        if self._still:
            return [(first_row + last_row) // 2]
        return np.unique(np.linspace(first_row, last_row, INSTANTS).astype(np.int64)).tolist()

    def _frames(
        self, image_row: int, which: Int64[np.ndarray, " g"]
    ) -> tuple[Float64[np.ndarray, "g 3 3"], Float64[np.ndarray, "g 3"]]:
        """Rotation and centre of geoms in the optical frame of one row."""
        exposure, placed = self.exposure, self.placed
        frames, moving = placed.still[which], placed.row[which]
        moves = moving >= 0
        if moves.any():
            key, weight = int(exposure.key[image_row]), exposure.weight[image_row]
            first = placed.keys[key, moving[moves]]
            second = placed.keys[min(key + 1, len(placed.keys) - 1), moving[moves]]
            frames[moves] = first + weight * (second - first)
        R_world_camera = exposure.R_world_camera[image_row]
        centre = (frames[:, 9:] - exposure.origin_m[image_row]) @ R_world_camera
        return R_world_camera.T @ frames[:, :9].reshape(-1, 3, 3), centre

    def _spanned(self, which: Int64[np.ndarray, " g"]) -> tuple[int, int]:
        """First and last row that geoms in front of the camera may fall on, with a margin."""
        centre, bound = self._centre_m[:, which], self.geoms.bound_m[which] + self._slack_m[which]
        depth = np.maximum(centre[..., 2] - bound, NEAR_M)
        low, high = (centre[..., 1] - bound) / depth, (centre[..., 1] + bound) / depth
        v = self.camera.fy_px * np.array([low.min(), high.max()]) + self.camera.cy_px
        if self._bent:
            v = np.array([0.0, self.camera.height_px])
        last = self.camera.height_px - 1
        first_row, last_row = np.clip([v[0] - 2.0, v[1] + 2.0], 0, last).astype(np.int64).tolist()
        return first_row, last_row

    def may_show(
        self, geom: Int[np.ndarray, " n"], radius_m: Float64[np.ndarray, " n"]
    ) -> Bool[np.ndarray, " n"]:
        """As `View.may_show`, at any instant of the read-out."""
        x, y, z = self._centre_m[:, geom].transpose(2, 0, 1)
        reach = radius_m + self._slack_m[geom]
        inside = z + reach >= NEAR_M
        for value, low, high in zip((x, y), self._slope_low, self._slope_high, strict=True):
            inside &= (-value + low * z) / np.hypot(1.0, low) <= reach
            inside &= (value - high * z) / np.hypot(1.0, high) <= reach
        shown: np.ndarray = inside.any(axis=0)
        return shown

    def outline(self, geom: Int[np.ndarray, " n"]) -> BoxPx | None:
        """As `View.outline`, each point of it at the time of its row."""
        width, height = float(self.camera.width_px), float(self.camera.height_px)
        if (self._centre_m[:, geom, 2] + self.geoms.bound_m[geom]).max() < NEAR_M:
            return None
        instants = self._instants(*self._spanned(geom))
        frames = [self._frames(row, geom) for row in instants]
        points = rim_points(
            self.geoms.kind[geom],
            self.geoms.size_m[geom],
            np.stack([rotation for rotation, _ in frames]),
            np.stack([centre for _, centre in frames]),
            STATIONS if self._bent else 2,
        )
        if points is None or points[..., 2].min() < NEAR_M:
            return (-1.0, -1.0, width + 1.0, height + 1.0)
        uv = _on_their_rows(self._project(points), np.array(instants))
        u, v = np.ascontiguousarray(uv.T)
        x0, y0, x1, y1 = float(u.min()), float(v.min()), float(u.max()), float(v.max())
        if x1 <= 0.0 or y1 <= 0.0 or x0 >= width or y0 >= height:
            return None
        return (x0, y0, x1, y1)

    def _project(self, points: Float64[np.ndarray, "k n 3"]) -> Float64[np.ndarray, "k n 2"]:
        """Pixels of points in front of the camera. Beyond the corners of the image the lens is not defined:
        there a point is drawn in to the corners' distance from the axis."""
        slope = points[..., :2] / points[..., 2:]
        if self._bent:
            length = np.hypot(slope[..., 0], slope[..., 1])
            slope = slope * np.minimum(1.0, self._slope_most / np.maximum(length, 1e-12))[..., None]
        flat = np.concatenate([slope, np.ones((*slope.shape[:2], 1))], axis=-1).reshape(-1, 3)
        return self.camera.project(flat).reshape(slope.shape)

    def hiders(self, window: Window, geom: Int[np.ndarray, " n"]) -> Int[np.ndarray, " m"]:
        """As `View.hiders`, at any instant of the read-out: by bounding spheres. The ground hides nothing."""
        reach = self.geoms.bound_m + self._slack_m
        distance = np.linalg.norm(self._centre_m, axis=2)
        farthest_m = (distance + reach)[:, geom].max()
        near = np.isfinite(reach) & (distance - reach < farthest_m).any(axis=0)
        near[geom] = False
        others = np.flatnonzero(near)
        return others[self.may_show(others, self.geoms.bound_m[others])]

    def cast(self, window: Window, geom: Int[np.ndarray, " n"]) -> rays.Hits:
        """As `View.cast`, each row at its own time."""
        seen, fans = self.exposure, row_fans(self.camera)
        return rays.cast_window(
            seen.placed, geom, seen.key, seen.weight, seen.R_world_camera, seen.origin_m, fans, fans.pose,
            window,
        )  # fmt: skip


@lru_cache(maxsize=8)
def _border_slopes(camera: PinholeCamera) -> tuple[np.ndarray, np.ndarray, float]:
    """Least and greatest slopes (x, y) of the pixels on the border, and the greatest from the axis."""
    direction = pixel_directions(camera)
    border = np.concatenate([direction[0], direction[-1], direction[:, 0], direction[:, -1]])
    slope = border[:, :2] / border[:, 2:]
    return slope.min(axis=0), slope.max(axis=0), float(np.hypot(slope[:, 0], slope[:, 1]).max())


def _on_their_rows(
    uv: Float64[np.ndarray, "k n 2"], row: Int64[np.ndarray, " k"]
) -> Float64[np.ndarray, "n 2"]:
    """Each of n tracks, given when k rows are exposed, where it is when the row under it is exposed."""
    if len(uv) == 1:
        return uv[0]
    below = uv[:, :, 1] - (row + 0.5)[:, None]  # how far below the row that is exposed
    passed = (below[:-1] > 0.0) & (below[1:] <= 0.0)
    never = np.where(below[0] <= 0.0, 0, len(uv) - 2)  # above the first row, or below the last
    before, n = np.where(passed.any(axis=0), passed.argmax(axis=0), never), np.arange(uv.shape[1])
    a, b = below[before, n], below[before + 1, n]
    share = np.clip(a / np.where(a == b, 1.0, a - b), 0.0, 1.0)[:, None]
    found: np.ndarray = uv[before, n] + share * (uv[before + 1, n] - uv[before, n])
    return found


def rim_points(
    kind: np.ndarray,
    size_m: Float64[np.ndarray, "g 3"],
    rotation: Float64[np.ndarray, "k g 3 3"],
    centre_m: Float64[np.ndarray, "k g 3"],
    stations: int,
) -> Float64[np.ndarray, "k n 3"] | None:
    """Points whose hull's image is the primitives' image, at k instants, in the optical frame.

    Point n is the same one at every instant, or glides over the surface with the sight line. `stations`:
    points along a straight edge, its ends included. None when the camera is inside a primitive.
    """
    along = np.linspace(-1.0, 1.0, stations)
    found: list[np.ndarray] = []
    box = kind == rays.BOX
    if box.any():
        local = _edges(stations)[None] * size_m[box][:, None, :]
        found.append(_placed(rotation[:, box], local, centre_m[:, box]))
    turn = np.linspace(0.0, 2.0 * np.pi, RIM, endpoint=False)
    cylinder = kind == rays.CYLINDER
    if cylinder.any():
        ring = np.stack([np.cos(turn), np.sin(turn), np.ones(RIM)], axis=1)
        rings = (ring * np.stack([np.ones_like(along), np.ones_like(along), along], axis=1)[:, None]).reshape(
            -1, 3
        )
        local = rings[None] * size_m[cylinder][:, None, [0, 0, 1]]
        found.append(_placed(rotation[:, cylinder], local, centre_m[:, cylinder]))
    ball = (kind == rays.SPHERE) | (kind == rays.ELLIPSOID)
    for which, places in ((kind == rays.CAPSULE, along), (ball, np.zeros(1))):
        if not which.any():
            continue
        axes = np.where((kind[which] == rays.ELLIPSOID)[:, None], size_m[which], size_m[which][:, :1])
        turned, axis = rotation[:, which], size_m[which][:, 1:2] * rotation[:, which][..., 2]
        middle = np.concatenate([centre_m[:, which] + a * axis for a in places], axis=1)
        rim = _touched(np.tile(turned, (1, len(places), 1, 1)), np.tile(axes, (len(places), 1)), middle, turn)
        if rim is None:
            return None
        found.append(rim)
    return np.concatenate(found, axis=1)


@lru_cache(maxsize=4)
def _edges(stations: int) -> Float64[np.ndarray, "n 3"]:
    """Points along the edges of the cube from -1 to 1, every one once."""
    places = [
        np.insert(_square(), axis, a, axis=1) for axis in range(3) for a in np.linspace(-1.0, 1.0, stations)
    ]
    found: np.ndarray = np.unique(np.concatenate(places), axis=0)
    return readonly(found)


def _square() -> Float64[np.ndarray, "4 2"]:
    return np.array([[x, y] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])


def _placed(
    rotation: Float64[np.ndarray, "k g 3 3"],
    local: Float64[np.ndarray, "g j 3"],
    centre_m: Float64[np.ndarray, "k g 3"],
) -> Float64[np.ndarray, "k n 3"]:
    points = local @ rotation.swapaxes(2, 3) + centre_m[:, :, None]
    return points.reshape(len(rotation), -1, 3)


def _touched(
    rotation: Float64[np.ndarray, "k g 3 3"],
    axes_m: Float64[np.ndarray, "g 3"],
    centre_m: Float64[np.ndarray, "k g 3"],
    turn: Float64[np.ndarray, " j"],
) -> Float64[np.ndarray, "k n 3"] | None:
    """Where sight lines touch ellipsoids: scaled to a unit sphere with the eye at e, the circle about
    e / |e|^2 of radius sqrt(1 - 1 / |e|^2), across e."""
    eye = -(centre_m[:, :, None] @ rotation)[:, :, 0] / axes_m
    square = (eye * eye).sum(axis=2)
    if square.min() <= 1.0:
        return None
    # Across e, from the axis that is least along it in the middle of the read-out: the same at all instants.
    least = np.abs(eye[len(eye) // 2]).argmin(axis=1)
    first = np.cross(eye, np.eye(3)[least])
    first /= np.linalg.norm(first, axis=2, keepdims=True)
    second = np.cross(eye / np.sqrt(square)[..., None], first)
    radius = np.sqrt(1.0 - 1.0 / square)[..., None, None]
    circle = (
        radius * (np.cos(turn)[:, None] * first[:, :, None] + np.sin(turn)[:, None] * second[:, :, None])
        + (eye / square[..., None])[:, :, None]
    )
    points = (circle * axes_m[:, None]) @ rotation.swapaxes(2, 3) + centre_m[:, :, None]
    return points.reshape(len(rotation), -1, 3)
