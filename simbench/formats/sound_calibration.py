"""What names, numbers and calibrations must be: see `sound.py`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusion.messages import Calibration
from scenarios.errors import show
from simbench.formats.png import MOST_PIXELS

FARTHEST_M = 1e6  # of a point from its sensor; also for speeds, per second
FARTHEST_PX = 1e9
LATEST_NS = 2**62  # two times are then apart by less than 2**63


def faults_of_calibration(calibration: Calibration) -> Iterator[str]:
    """What is wrong with a calibration."""
    for name, pose in calibration.T_ego_sensor.items():
        if not is_sensor(name):
            yield f"the calibration has a sensor called {show(name)}"
        if not (np.abs(pose.translation_m) < FARTHEST_M).all():
            yield f"the calibration has {show(name)} too far away"
    for name, camera in calibration.cameras.items():
        numbers = (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, *camera.distortion)
        if not (np.abs(numbers) < FARTHEST_PX).all() or not min(camera.fx_px, camera.fy_px) > 0.0:
            yield f"the calibration of the camera {show(name)} is none"
        width, height = camera.width_px, camera.height_px
        if min(width, height) < 1 or width * height > MOST_PIXELS:
            yield f"the camera {show(name)} has {width} x {height} pixels"


def is_name(text: str) -> bool:
    """Whether a text may be shown anywhere."""
    return bool(text) and text.isprintable()


def is_sensor(text: str) -> bool:
    """Whether a text may be the name of a sensor, of which a topic or a file may be named."""
    return is_name(text) and text not in (".", "..") and not set(text) & set("/\\")
