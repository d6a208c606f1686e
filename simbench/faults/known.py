"""What a told calibration says of known points: poses by PnP and rigid fit, pixels by OpenCV.

Stands apart from the injectors: it sees only what a calibration does to points.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from fusion.camera import PinholeCamera, project_points
from fusion.geometry import Transform
from fusion.messages import Calibration
from simbench.faults.estimate import camera_pose
from simbench.sensors import fiducials

AROUND_M = np.array(
    [[12.0, 0.0, -1.0], [8.0, 7.0, 0.5], [-9.0, 6.0, 1.0], [-11.0, -5.0, -1.5], [6.0, -9.0, 2.0]]
)  # in the LiDAR's frame
AHEAD_M = fiducials.points_m(
    PinholeCamera(fx_px=500.0, fy_px=500.0, cx_px=400.0, cy_px=250.0, width_px=800, height_px=500),
    Transform.identity(),
)  # in a camera's frame


def told_pose(told: Calibration, sensor: str) -> Transform:
    """T_ego_sensor as known points show it: a camera's by PnP on the pixels at which the told camera puts
    those in its view; the LiDAR's by a rigid fit of points around it."""
    if sensor not in told.cameras:
        there = told.T_ego_sensor[sensor].apply(AROUND_M)
        turn, _ = Rotation.align_vectors(there - there.mean(axis=0), AROUND_M - AROUND_M.mean(axis=0))
        rotation = turn.as_matrix()
        return Transform(
            rotation=rotation, translation_m=there.mean(axis=0) - rotation @ AROUND_M.mean(axis=0)
        )
    lens, pose = told.cameras[sensor], told.T_ego_sensor[sensor]
    points = fiducials.points_m(lens, pose)
    rotation, position = camera_pose(points, project_points(points, pose.inverse(), lens), lens)
    return Transform(rotation=rotation, translation_m=position)


def pixels(camera: PinholeCamera, xyz_camera_m: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 2"]:
    """Where a camera puts points of its own frame, by OpenCV."""
    seen, _ = cv2.projectPoints(
        xyz_camera_m, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion)
    )
    return np.asarray(seen, dtype=np.float64)[:, 0]
