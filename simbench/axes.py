"""The one place where conventions meet: MuJoCo's cameras and field of view against the optical frame.

MuJoCo's camera looks along -z with y up; the optical frame looks along +z with y down. A camera's pose on a
rig is declared by its viewing direction in ego axes (x forward, y left, z up).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform, rotation_rpy
from scenarios.scenario import CameraSensor, Pose

# Columns: the optical axes x (right), y (down), z (forward) in a body frame that looks along x.
R_BODY_OPTICAL: Float64[np.ndarray, "3 3"] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
# MuJoCo's camera axes: x right, y up, z backward.
R_OPTICAL_MUJOCO: Float64[np.ndarray, "3 3"] = np.diag([1.0, -1.0, -1.0])


def T_parent_body(pose: Pose) -> Transform:
    """A declared pose (metres; roll, pitch, yaw in degrees) as a transform."""
    roll, pitch, yaw = np.deg2rad(pose.rpy_deg)
    return Transform(rotation=rotation_rpy(roll, pitch, yaw), translation_m=np.array(pose.xyz_m))


def T_parent_optical(pose: Pose) -> Transform:
    """The optical frame of a camera whose viewing direction is declared by `pose`."""
    body = T_parent_body(pose)
    return Transform(rotation=body.rotation @ R_BODY_OPTICAL, translation_m=body.translation_m)


def pinhole(sensor: CameraSensor) -> PinholeCamera:
    """Intrinsics with square pixels and the principal point at the image's centre: f = w / (2 tan(fov/2))."""
    focal_px = 0.5 * sensor.width_px / np.tan(0.5 * np.deg2rad(sensor.fov_deg))
    return PinholeCamera(
        fx_px=float(focal_px),
        fy_px=float(focal_px),
        cx_px=0.5 * sensor.width_px,
        cy_px=0.5 * sensor.height_px,
        width_px=sensor.width_px,
        height_px=sensor.height_px,
        distortion=sensor.distortion,
    )


def vertical_fov_deg(camera: PinholeCamera) -> float:
    """MuJoCo's `fovy` of a pinhole camera whose principal point is at the centre."""
    return float(np.rad2deg(2.0 * np.arctan(0.5 * camera.height_px / camera.fy_px)))


def mujoco_camera(T_world_camera: Transform) -> tuple[np.ndarray, np.ndarray]:
    """`cam_xpos` [3] and `cam_xmat` [9] of an optical pose."""
    return T_world_camera.translation_m, (T_world_camera.rotation @ R_OPTICAL_MUJOCO).reshape(9)
