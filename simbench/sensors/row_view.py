"""Boxes where each row of the image has its own time, or where the lens bends straight lines.

The outline is sampled (`rim.py`): points on the rim of every primitive, each projected at a few instants of
the read-out and taken at the one at which the row that it falls on is exposed.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float64, Int, Int64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import BoxPx
from simbench.motion import Motion, at
from simbench.sensors import rays
from simbench.sensors.boxes import View, Window
from simbench.sensors.lens import pixel_directions, row_fans
from simbench.sensors.outline import NEAR_M
from simbench.sensors.rim import extent_px, rim_points
from simbench.sensors.rows import Exposure, exposure_at, row_times_ns

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
        most = self._slope_most
        box = None if points is None else extent_px(points, np.array(instants), self.camera, most)
        if box is None:
            return (-1.0, -1.0, width + 1.0, height + 1.0)
        x0, y0, x1, y1 = box
        if x1 <= 0.0 or y1 <= 0.0 or x0 >= width or y0 >= height:
            return None
        return box

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
