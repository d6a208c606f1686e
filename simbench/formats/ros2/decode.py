"""The small ROS messages as the bench's types. MessageError: what a message says cannot be."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx
from simbench.formats.ros2.cdr import Message, MessageError
from simbench.formats.ros2.encode import HALF_PX
from simbench.formats.ros2.names import S_TO_NS

FARTHEST_PX = 1e7
LARGEST = 1e7  # metres, metres per second, ...
MODELS = ("plumb_bob", "rational_polynomial", "")  # of which the first five numbers are ours
Vector = Float64[np.ndarray, "3"]


@dataclass(frozen=True, kw_only=True)
class Box:
    """One detection as told: its likeliest class (None: it has none), its track's text ("": none)."""

    class_id: str | None
    track: str
    box_px: BoxPx
    confidence: float


def stamp_ns(header: Message) -> int:
    """A header's time in nanoseconds."""
    sec, nanosec = int(header["stamp"]["sec"]), int(header["stamp"]["nanosec"])
    if sec < 0 or nanosec >= S_TO_NS:
        raise MessageError(f"its stamp is no time: {sec} s and {nanosec} ns")
    return sec * S_TO_NS + nanosec


def vector(told: Mapping[str, float], what: str) -> Vector:
    """Three finite numbers of a sane size."""
    found = np.array([told["x"], told["y"], told["z"]], dtype=np.float64)
    if not np.abs(found).max() <= LARGEST:  # True for NaN
        raise MessageError(f"its {what} is not finite, or beyond {LARGEST:g}")
    return found


def imu(message: Message) -> tuple[Vector, Vector]:
    """Rate [rad/s] and specific force [m/s^2], in the axes of the message's frame."""
    for what in ("angular_velocity", "linear_acceleration"):
        if message[f"{what}_covariance"][0] == -1.0:
            raise MessageError(f"it says that it has no {what}")
    return (
        vector(message["angular_velocity"], "angular velocity"),
        vector(message["linear_acceleration"], "linear acceleration"),
    )


def boxes(message: Message) -> tuple[Box, ...]:
    """The boxes of a Detection2DArray."""
    return tuple(_box(one) for one in message["detections"])


def _box(told: Message) -> Box:
    centre, size_x, size_y = told["bbox"]["center"], told["bbox"]["size_x"], told["bbox"]["size_y"]
    x, y = centre["position"]["x"], centre["position"]["y"]
    if not all(map(math.isfinite, (x, y, size_x, size_y, centre["theta"]))):
        raise MessageError("a box is not finite")
    if min(size_x, size_y) < 0.0 or max(abs(x), abs(y), size_x, size_y) > FARTHEST_PX:
        raise MessageError(f"a box of {size_x:g} x {size_y:g} px at ({x:g}, {y:g})")
    if centre["theta"] != 0.0:
        raise MessageError(f"a box is turned by {centre['theta']:g} rad")
    best = likeliest(told["results"])
    corners = (x - 0.5 * size_x, y - 0.5 * size_y, x + 0.5 * size_x, y + 0.5 * size_y)
    return Box(
        class_id=None if best is None else best["class_id"], track=told["id"], box_px=corners,
        confidence=0.0 if best is None else best["score"],
    )  # fmt: skip


def likeliest(results: Sequence[Message]) -> Message | None:
    """The hypothesis of the highest score among a detection's results, the first of equals; None: there is
    none."""
    return max((one["hypothesis"] for one in results), key=lambda told: _score(told["score"]), default=None)


def _score(score: float) -> float:
    if not 0.0 <= score <= 1.0:
        raise MessageError(f"a box has a score of {score:g}, not 0 to 1")
    return score


def corners(message: Message) -> Float64[np.ndarray, "n 4"]:
    """The exact corners that our own bags tell."""
    flat = np.asarray(message["data"], dtype=np.float64)
    if len(flat) % 4 or not np.isfinite(flat).all():
        raise MessageError("it holds no corners of boxes")
    return flat.reshape(-1, 4)


def camera(message: Message, *, rectified: bool) -> PinholeCamera:
    """The intrinsics of a CameraInfo: K and D, or of the rectified image P."""
    width, height = int(message["width"]), int(message["height"])
    if max(message["binning_x"], message["binning_y"]) > 1:
        raise MessageError("its image is binned")
    roi = message["roi"]
    if (roi["width"], roi["height"]) not in ((0, 0), (width, height)) or roi["x_offset"] or roi["y_offset"]:
        raise MessageError("its image is a part of the sensor's (roi)")
    matrix = np.asarray(message["p"], dtype=np.float64).reshape(3, 4)[:, :3] if rectified else None
    if matrix is None:
        matrix = np.asarray(message["k"], dtype=np.float64).reshape(3, 3)
    rest = np.array([matrix[0, 1], matrix[1, 0], *matrix[2]])
    sane = np.isfinite(matrix).all() and np.array_equal(rest, [0, 0, 0, 0, 1]) and not (width * height == 0)
    if not sane or min(matrix[0, 0], matrix[1, 1]) <= 0.0:
        raise MessageError("its camera is not calibrated: K (or P) is no intrinsic matrix, or it has no size")
    lens = (0.0,) * 5 if rectified else _distortion(message)
    fx, fy, cx, cy = (float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return PinholeCamera(
        fx_px=fx, fy_px=fy, cx_px=cx + HALF_PX, cy_px=cy + HALF_PX, width_px=width, height_px=height,
        distortion=cast(tuple[float, float, float, float, float], lens),
    )  # fmt: skip


def _distortion(message: Message) -> tuple[Any, ...]:
    """(k1, k2, p1, p2, k3); a model whose other numbers are 0 is ours."""
    model, d = message["distortion_model"], np.asarray(message["d"], dtype=np.float64)
    if model not in MODELS or len(d) > 14:
        raise MessageError(f"its distortion is '{model[:40]}' of {len(d)} numbers, not plumb_bob")
    if not np.isfinite(d).all() or d[5:].any():
        raise MessageError("its distortion has more than the five numbers of plumb_bob")
    return tuple((*d[:5].tolist(), 0.0, 0.0, 0.0, 0.0, 0.0)[:5])
