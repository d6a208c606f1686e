"""Where labelled objects are at any time, for the truth of a recording.

The world is the ego frame, at every time anew: labels say where things are about the car, and no score asks
where the car is. Between two labelled frames position and heading go evenly; before the first and after the
last they stay.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.geometry import Transform
from fusion.messages import Calibration

UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Axes of a box with rotation_y = 0 in the camera's frame: length right, width away from the camera, up."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelledTrack:
    """One object's labels, in order of time. bottom_m: centre of the box's bottom, rectified camera."""

    t_ns: Int64[np.ndarray, " k"]
    bottom_m: Float64[np.ndarray, "k 3"]
    yaw_rad: Float64[np.ndarray, " k"]  # rotation_y, unwrapped
    height_m: float


class RecordedPoses:
    """The `PoseSource` of a recording. `tracks`: by object id."""

    def __init__(
        self, calibration: Calibration, T_ego_rect: Transform, tracks: Mapping[int, LabelledTrack]
    ) -> None:
        self._calibration, self._T_ego_rect, self._tracks = calibration, T_ego_rect, dict(tracks)

    def labelled_ns(self, object_id: int) -> Int64[np.ndarray, " k"]:
        """When an object was labelled. KeyError: no such object."""
        return self._tracks[object_id].t_ns

    def ego(
        self, t_ns: Int64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"]]:
        """The identity: the world is the ego frame."""
        return _still(Transform.identity(), len(t_ns))

    def object_centre(
        self, object_id: int, t_ns: Int64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"]]:
        """T_ego_box: centre and axes (length, width, height) of an object's box. KeyError: no such object."""
        track = self._tracks[object_id]
        t = np.asarray(t_ns, dtype=np.int64)
        start = track.t_ns[0]  # floats of nanoseconds since 1970 would be coarse
        since, known = (t - start).astype(np.float64), (track.t_ns - start).astype(np.float64)
        bottom = np.stack([np.interp(since, known, track.bottom_m[:, axis]) for axis in range(3)], axis=1)
        yaw = np.interp(since, known, track.yaw_rad)
        turn = np.zeros((len(t), 3, 3))
        turn[:, 0, 0] = turn[:, 2, 2] = np.cos(yaw)
        turn[:, 0, 2], turn[:, 2, 0] = np.sin(yaw), -np.sin(yaw)
        turn[:, 1, 1] = 1.0
        axes = turn @ UPRIGHT
        centre = bottom + 0.5 * track.height_m * axes[:, :, 2]
        return self._T_ego_rect.rotation @ axes, self._T_ego_rect.apply(centre)

    def sensor(
        self, sensor: str, t_ns: Int64[np.ndarray, " n"]
    ) -> tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"]]:
        """T_ego_sensor by the recording's own calibration. KeyError: no such sensor."""
        return _still(self._calibration.T_ego_sensor[sensor], len(t_ns))


def _still(pose: Transform, n: int) -> tuple[np.ndarray, np.ndarray]:
    return np.tile(pose.rotation, (n, 1, 1)), np.tile(pose.translation_m, (n, 1))
