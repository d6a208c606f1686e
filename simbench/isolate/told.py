"""What the bench tells a pipeline, as frames: calibration and categories, and every kind of message.

The round trip gives equal messages, bit by bit: numbers that may be any float travel in arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, cast

import numpy as np

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import (
    BoxPx,
    Calibration,
    CameraImage,
    CategorySize,
    Detection,
    Detections,
    EgoMotion,
    LidarScan,
    Measurement,
)
from simbench.isolate.fields import Shape, Taken
from simbench.isolate.frames import Frame, FrameError

PROTOCOL = "simbench-pipeline/1"
Five = tuple[float, float, float, float, float]


def reset_frame(calibration: Calibration, categories: Mapping[str, CategorySize]) -> Frame:
    """`reset`: a run begins."""
    poses, cameras = calibration.T_ego_sensor, calibration.cameras
    return Frame(
        kind="reset",
        fields={
            "protocol": PROTOCOL,
            "sensors": list(poses),
            "cameras": list(cameras),
            "categories": list(categories),
        },
        arrays={
            "rotation": _stacked([pose.rotation for pose in poses.values()], (3, 3)),
            "translation_m": _stacked([pose.translation_m for pose in poses.values()], (3,)),
            "intrinsics_px": _stacked([(c.fx_px, c.fy_px, c.cx_px, c.cy_px) for c in cameras.values()], (4,)),
            "size_px": _stacked([(c.width_px, c.height_px) for c in cameras.values()], (2,), np.int64),
            "distortion": _stacked([c.distortion for c in cameras.values()], (5,)),
            "mean_m": _stacked([size.mean_m for size in categories.values()], (3,)),
            "spread": _stacked([size.spread for size in categories.values()], ()),
        },
    )


def read_reset(frame: Frame) -> tuple[Calibration, dict[str, CategorySize]]:
    """Calibration and categories of a `reset`. FrameError where it is malformed."""
    taken = Taken(frame)
    if (protocol := taken.text("protocol")) != PROTOCOL:
        raise taken.error(f"its protocol is '{protocol}', not {PROTOCOL}")
    sensors, cameras = taken.texts("sensors", "sensors"), taken.texts("cameras", "cameras")
    categories = taken.texts("categories", "categories")
    rotation = taken.array("rotation", "f64", ("sensors", 3, 3))
    translation_m = taken.array("translation_m", "f64", ("sensors", 3))
    intrinsics = taken.array("intrinsics_px", "f64", ("cameras", 4)).tolist()
    size_px = taken.array("size_px", "i64", ("cameras", 2)).tolist()
    distortion = taken.array("distortion", "f64", ("cameras", 5)).tolist()
    mean_m = taken.array("mean_m", "f64", ("categories", 3)).tolist()
    spread = taken.array("spread", "f64", ("categories",)).tolist()
    taken.end()
    models = {}
    for name, (fx, fy, cx, cy), (width, height), lens in zip(
        cameras, intrinsics, size_px, distortion, strict=True
    ):
        models[name] = PinholeCamera(
            fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy, width_px=width, height_px=height,
            distortion=cast(Five, tuple(lens)),
        )  # fmt: skip
    try:
        poses = {
            name: Transform(rotation=r, translation_m=p)
            for name, r, p in zip(sensors, rotation, translation_m, strict=True)
        }
        calibration = Calibration(T_ego_sensor=poses, cameras=models)
    except ValueError as error:
        raise taken.error(str(error)) from error
    sizes = {
        name: CategorySize(mean_m=cast(tuple[float, float, float], tuple(mean)), spread=one)
        for name, mean, one in zip(categories, mean_m, spread, strict=True)
    }
    return calibration, sizes


def message_frame(message: Measurement) -> Frame:
    """One message: `lidar_scan`, `camera_image`, `detections` or `ego_motion`."""
    stamps = {
        "sensor": message.sensor,
        "seq": int(message.seq),
        "stamp_ns": int(message.stamp_ns),
        "arrival_ns": int(message.arrival_ns),
    }
    if isinstance(message, Detections):
        boxes = message.boxes
        return Frame(
            kind="detections",
            fields={**stamps, "category": [box.category for box in boxes]},
            arrays={
                "track_id": _stacked([box.track_id for box in boxes], (), np.int64),
                "box_px": _stacked([box.box_px for box in boxes], (4,)),
                "confidence": _stacked([box.confidence for box in boxes], ()),
            },
        )
    kind, specs = _ARRAYS[type(message)]
    return Frame(kind=kind, fields=stamps, arrays={name: getattr(message, name) for name in specs})


def read_message(frame: Frame) -> Measurement:
    """The message of a frame. FrameError where it is none."""
    taken = Taken(frame)
    if frame.kind not in (*_BY_KIND, "detections"):
        raise FrameError(f"a '{frame.kind[:40]}' is no message")
    sensor, seq = taken.text("sensor"), taken.integer("seq")
    stamp_ns, arrival_ns = taken.integer("stamp_ns"), taken.integer("arrival_ns")
    found: Measurement
    if frame.kind == "detections":
        found = Detections(
            sensor=sensor, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, boxes=_boxes(taken)
        )
    else:
        make, specs = _BY_KIND[frame.kind]
        arrays = {name: taken.array(name, dtype, shape) for name, (dtype, shape) in specs.items()}
        found = make(sensor=sensor, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, **arrays)
    taken.end()
    return found


def _boxes(taken: Taken) -> tuple[Detection, ...]:
    category = taken.texts("category", "n")
    track_id = taken.array("track_id", "i64", ("n",)).tolist()
    box_px = taken.array("box_px", "f64", ("n", 4)).tolist()
    confidence = taken.array("confidence", "f64", ("n",)).tolist()
    return tuple(
        Detection(track_id=track, category=word, box_px=cast(BoxPx, tuple(box)), confidence=sure)
        for track, word, box, sure in zip(track_id, category, box_px, confidence, strict=True)
    )


_Specs: TypeAlias = dict[str, tuple[str, Shape]]
_SCAN: _Specs = {
    "xyz_m": ("f32", ("n", 3)),
    "intensity": ("f32", ("n",)),
    "offset_ns": ("i32", ("n",)),
    "ring": ("i16", ("n",)),
}
_IMAGE: _Specs = {"rgb": ("u8", ("h", "w", 3))}
_MOTION: _Specs = {name: ("f64", (3,)) for name in ("velocity_mps", "rate_radps", "specific_force_mps2")}
_ARRAYS: dict[type, tuple[str, _Specs]] = {
    LidarScan: ("lidar_scan", _SCAN),
    CameraImage: ("camera_image", _IMAGE),
    EgoMotion: ("ego_motion", _MOTION),
}
_BY_KIND: dict[str, tuple[Any, _Specs]] = {kind: (make, specs) for make, (kind, specs) in _ARRAYS.items()}


def _stacked(
    rows: Sequence[Any], width: tuple[int, ...], dtype: type[np.float64] | type[np.int64] = np.float64
) -> np.ndarray:
    """Rows of a shape as one array [rows *width], without rows too."""
    return np.array(rows, dtype=dtype).reshape(len(rows), *width)
