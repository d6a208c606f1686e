"""Numbers, times, calibration and label lines as KITTI's text files have them.

Every number has all digits of a double, where KITTI's own files have two to twelve: the development kit
parses any, and nothing is lost on the way through text.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, timedelta

import numpy as np

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from simbench.formats.kitti_write.objects import Labelled

EPOCH = datetime(2000, 1, 1, 12)
"""What 0 on the bench's clock is called: a simulated drive has no date."""
HALF_PX = 0.5  # KITTI counts pixels from the centre of the first one, the bench from its corner
REGION_TAIL = "-1 -1 -1 -1000 -1000 -1000 -10"


def row(values: Iterable[float] | np.ndarray) -> str:
    """Numbers with all their digits, matrices row by row."""
    return " ".join(repr(float(value)) for value in np.asarray(values, dtype=np.float64).ravel())


def time_text(t_ns: int) -> str:
    """Nanoseconds on the bench's clock as '2000-01-01 12:00:00.000000000'."""
    seconds, rest = divmod(t_ns, 10**9)
    return f"{EPOCH + timedelta(seconds=seconds):%Y-%m-%d %H:%M:%S}.{rest:09d}"


def projection(camera: PinholeCamera) -> np.ndarray:
    """P of a rectified camera [3 4], in KITTI's pixels; every camera of the files is the chosen one."""
    matrix = camera.matrix
    matrix[:2, 2] -= HALF_PX
    return np.hstack([matrix, np.zeros((3, 1))])


def rigid(T_a_b: Transform) -> np.ndarray:
    """[R | t], [3 4]."""
    return np.hstack([T_a_b.rotation, T_a_b.translation_m[:, None]])


def calibration_text(
    camera: PinholeCamera, T_camera_lidar: Transform, T_lidar_ego: Transform, *, tracking: bool
) -> str:
    """calib/*.txt of the object or the tracking layout."""
    names = (
        ("R_rect", "Tr_velo_cam", "Tr_imu_velo")
        if tracking
        else ("R0_rect:", "Tr_velo_to_cam:", "Tr_imu_to_velo:")
    )
    lines = [f"P{number}: {row(projection(camera))}" for number in range(4)]
    matrices = (np.eye(3), rigid(T_camera_lidar), rigid(T_lidar_ego))
    lines += [f"{name} {row(matrix)}" for name, matrix in zip(names, matrices, strict=True)]
    return "\n".join(lines) + "\n"


def label_words(label: Labelled, kind: str, truncated: float, occluded: int) -> str:
    """The 15 words of a label that has a 2-D box."""
    assert label.box_px is not None
    x, _, z = label.centre_m
    alpha = _wrapped(label.yaw_rad - float(np.arctan2(x, z)))
    length, width, height = label.size_m
    numbers = (alpha, *box_words(label), height, width, length, *label.bottom_m, label.yaw_rad)
    return f"{kind} {truncated!r} {occluded} {row(numbers)}"


def region_words(label: Labelled) -> str:
    """DontCare: a part of the image where something stands that nobody can see."""
    return f"DontCare -1 -1 -10 {row(box_words(label))} {REGION_TAIL}"


def box_words(label: Labelled) -> tuple[float, ...]:
    """The 2-D box in KITTI's pixels."""
    assert label.box_px is not None
    return tuple(edge - HALF_PX for edge in label.box_px)


def _wrapped(angle_rad: float) -> float:
    return float((angle_rad + np.pi) % (2.0 * np.pi) - np.pi)
