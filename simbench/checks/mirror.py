"""A mirrored scene gives a mirrored result.

All that a pipeline is told is mirrored about the ego's x-z plane. With M = diag(1, -1, 1): points of a scan
p -> M p, poses (R, t) -> (M R M, M t), so that a point's place in the ego frame, M (R p + t), is mirrored; of
cameras the optical x axis turns too, R -> M R diag(-1, 1, 1), which mirrors pictures: u -> width - u. A
velocity or a force v becomes M v, a turning rate (an axial vector) w becomes -M w. Times, rings and the order
of the points stay, so the LiDAR of the mirrored scene spins the other way; nobody has promised which way.

Nature has no left and no right: whoever maps a point to a box does so in the mirror. Signs are exact in
floating point, so the tolerance is rounding (`compare.py`) and all points must be the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import (
    BoxPx,
    Calibration,
    CameraImage,
    Detections,
    EgoMotion,
    LidarScan,
    Measurement,
)
from simbench.checks.compare import compare
from simbench.checks.finding import Finding, Story, ask
from simbench.plugins import Factory

_M = np.array([1.0, -1.0, 1.0])
_AXIAL = -_M
_OPTICAL = np.array([-1.0, 1.0, 1.0])


def find(factory: Factory, story: Story) -> Finding:
    """The answers to a story and to its mirror image."""
    return compare(ask(factory, story), ask(factory, mirrored(story)), move=mirror)


def mirror(xyz_m: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
    """Points in the ego frame [n 3] in the mirror."""
    return xyz_m * _M


def mirrored(story: Story) -> Story:
    """The story in the mirror. Twice is the story itself."""
    told = story.calibration
    poses = {
        name: Transform(
            rotation=_M[:, None] * pose.rotation * (_OPTICAL if name in told.cameras else _M),
            translation_m=_M * pose.translation_m,
        )
        for name, pose in told.T_ego_sensor.items()
    }
    cameras = {name: _camera(camera) for name, camera in told.cameras.items()}
    messages = tuple(_message(message, told) for message in story.messages)
    return Story(calibration=Calibration(T_ego_sensor=poses, cameras=cameras), messages=messages)


def _camera(camera: PinholeCamera) -> PinholeCamera:
    """Of Brown-Conrady's terms only p2 is odd in x."""
    k1, k2, p1, p2, k3 = camera.distortion
    return replace(camera, cx_px=camera.width_px - camera.cx_px, distortion=(k1, k2, p1, -p2, k3))


def _message(message: Measurement, told: Calibration) -> Measurement:
    if isinstance(message, LidarScan):
        return replace(message, xyz_m=message.xyz_m * _M.astype(np.float32))
    if isinstance(message, CameraImage):
        return replace(message, rgb=message.rgb[:, ::-1])
    if isinstance(message, Detections):
        width_px = told.cameras[message.sensor].width_px
        boxes = tuple(replace(box, box_px=_box(box.box_px, width_px)) for box in message.boxes)
        return replace(message, boxes=boxes)
    if isinstance(message, EgoMotion):
        return replace(
            message,
            velocity_mps=_M * message.velocity_mps,
            rate_radps=_AXIAL * message.rate_radps,
            specific_force_mps2=_M * message.specific_force_mps2,
        )
    raise TypeError(f"a {type(message).__name__} has no mirror image")


def _box(box_px: BoxPx, width_px: int) -> BoxPx:
    x0, y0, x1, y1 = box_px
    return (width_px - x1, y0, width_px - x0, y1)
