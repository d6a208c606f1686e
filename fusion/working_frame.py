"""The frame that the robust pipeline works in, and how the ego moved in it.

It is the ego frame turned about z so that the LiDAR looks along x. Nothing that is computed in it knows which
way the rig is mounted: turning scene and rig together about z turns the result and changes nothing else.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from fusion.geometry import Transform, rotation_rpy
from fusion.messages import Calibration, LidarScan
from fusion.odometry import Odometry, from_odometry


class WorkingFrame:
    """Fixed transforms of a run, by the LiDAR that defines the frame; and the odometry."""

    def __init__(self, calibration: Calibration, lidar: str) -> None:
        rotation = calibration.T_ego_sensor[lidar].rotation
        yaw_rad = math.atan2(rotation[1, 0], rotation[0, 0])
        self.T_ego_work = Transform(rotation=rotation_rpy(0.0, 0.0, yaw_rad), translation_m=np.zeros(3))
        T_work_ego = self.T_ego_work.inverse()
        self.T_work_sensor = {
            name: T_work_ego @ T_ego_sensor for name, T_ego_sensor in calibration.T_ego_sensor.items()
        }
        self._T_camera_work = {name: self.T_work_sensor[name].inverse() for name in calibration.cameras}
        self.odometry = Odometry(yaw_rad)
        self._beams_per_sr: dict[str, float | None] = {}

    def T_camera_scene(self, camera: str, stamp_ns: int, scene_pose: Float64[np.ndarray, "1 3"]) -> Transform:
        """From the frame as it stood at `scene_pose` to the camera at `stamp_ns`, in a still world."""
        pose = self.odometry.pose(np.array([stamp_ns]))
        x, y = from_odometry(scene_pose[:, :2], pose)[0]
        turn = float(scene_pose[0, 2] - pose[0, 2])
        c, s = math.cos(turn), math.sin(turn)
        T_camera_work = self._T_camera_work[camera]
        moved = np.array([[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, 0.0]])
        seen = T_camera_work.rotation @ moved
        return Transform(rotation=seen[:, :3], translation_m=seen[:, 3] + T_camera_work.translation_m)

    def turned_rad(self, stamp_ns: int, within_s: float) -> float:
        """By how much the ego turned in the time before a stamp, either way."""
        yaw = self.odometry.pose(np.array([stamp_ns - round(within_s * 1e9), stamp_ns]))[:, 2]
        return abs(float(yaw[1] - yaw[0]))

    def beams_per_sr(self, scan: LidarScan) -> float | None:
        """How dense a LiDAR's beams are, measured on its first scan with two rings or more; None before."""
        if self._beams_per_sr.get(scan.sensor) is None:
            self._beams_per_sr[scan.sensor] = beam_density(scan)
        return self._beams_per_sr[scan.sensor]

    def travel_rad(self) -> float:
        """The direction of travel in this frame; x where the ego stands or its motion is not measured."""
        x, y = self.odometry.speed_mps()
        return math.atan2(y, x) if math.hypot(x, y) > 1.0 else 0.0


def beam_density(scan: LidarScan) -> float | None:
    """Beams per steradian: one over the median spacings of rings in elevation and of a ring in azimuth.

    None for a scan with fewer than two rings, or whose fullest ring has fewer than two points.
    """
    xyz_m = scan.xyz_m.astype(np.float64)
    finite = np.isfinite(xyz_m).all(axis=1)
    xyz_m, ring = xyz_m[finite], scan.ring[finite]
    names, place, count = np.unique(ring, return_inverse=True, return_counts=True)
    if len(names) < 2 or count.max() < 2:
        return None
    elevation = np.arctan2(xyz_m[:, 2], np.hypot(xyz_m[:, 0], xyz_m[:, 1]))
    levels = np.sort(np.bincount(place, elevation) / count)
    full = xyz_m[place == int(np.argmax(count))]
    turns = np.diff(np.sort(np.arctan2(full[:, 1], full[:, 0])))
    cell_sr = float(np.median(np.diff(levels)) * np.median(turns))
    return 1.0 / cell_sr if cell_sr > 1e-9 else None
