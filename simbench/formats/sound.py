"""What a recording must be, beyond its form, before anything is computed of it.

Every frame may be well made and the whole still be nonsense: a point that is no number, a sweep without
truth, a target that is no object. Then scores would end in a crash, or in a number. Here it ends in one
sentence. What the bench records, under any fault, passes.

Everything is looked at as it is read. What is kept until all was, to see whether it fits (`Heard`, and
`Outline` of the truth), does not grow with points or pixels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain

import numpy as np

from fusion.messages import (
    Calibration,
    CameraImage,
    CategorySize,
    Detections,
    EgoMotion,
    LidarScan,
    Measurement,
)
from scenarios.errors import BadInput, show
from simbench.formats.sound_calibration import (
    FARTHEST_M,
    FARTHEST_PX,
    LATEST_NS,
    faults_of_calibration,
    is_name,
    is_sensor,
)

MOST_TRACK = 2**62


@dataclass(frozen=True, kw_only=True)
class Heard:
    """What the truth must fit, of a sweep, an image or its boxes. count: of points or boxes; last_ns: of the
    last firing, by the stamp."""

    kind: type
    sensor: str
    seq: int
    stamp_ns: int
    last_ns: int
    count: int


def sound_messages(
    calibration: Calibration,
    categories: Mapping[str, CategorySize],
    messages: Iterable[Measurement],
    heard: list[Heard],
    file: str,
) -> Iterator[Measurement]:
    """The messages one by one, each when it is known to be sound; what is kept of them is added to `heard`.
    BadInput: one cannot be, or the calibration or a category."""
    for fault in chain(faults_of_calibration(calibration), _faults_of_categories(categories)):
        raise BadInput(fault, file=file)
    before_ns = -LATEST_NS
    known: dict[tuple[type, str, int], bytes] = {}
    for number, message in enumerate(messages):
        where = f"message {number} ({type(message).__name__} {message.seq} of {show(message.sensor)})"
        for fault in chain(_faults_of_stamps(message, before_ns), _faults_of(message, calibration)):
            raise BadInput(f"{where}: {fault}", file=file)
        content = _content(message)
        if known.setdefault((type(message), message.sensor, message.seq), content) != content:
            raise BadInput(f"{where}: another one has its number", file=file)
        before_ns = message.arrival_ns
        if not isinstance(message, EgoMotion):
            heard.append(_heard(message))
        yield message


def _heard(message: LidarScan | CameraImage | Detections) -> Heard:
    count, last_ns = 0, message.stamp_ns
    if isinstance(message, LidarScan):
        count, last_ns = len(message.xyz_m), last_ns + int(message.offset_ns.max(initial=0))
    elif isinstance(message, Detections):
        count = len(message.boxes)
    return Heard(
        kind=type(message), sensor=message.sensor, seq=message.seq, stamp_ns=message.stamp_ns,
        last_ns=last_ns, count=count,
    )  # fmt: skip


def _faults_of_categories(categories: Mapping[str, CategorySize]) -> Iterator[str]:
    for name, size in categories.items():
        if not is_name(name):
            yield f"a category is called {show(name)}"
        if (
            not all(0.0 < length < FARTHEST_M for length in size.mean_m)
            or not 0.0 <= size.spread < FARTHEST_M
        ):
            yield f"the category {show(name)} has a size that is none"


def _faults_of_stamps(message: Measurement, before_ns: int) -> Iterator[str]:
    if not is_sensor(message.sensor):
        yield "its sensor's name is none"
    if message.seq < 0:
        yield "its number is negative"
    if max(abs(message.stamp_ns), abs(message.arrival_ns)) >= LATEST_NS:
        yield f"its time lies beyond {LATEST_NS} ns"
    if message.arrival_ns < before_ns:
        yield "it arrived before the one that stands before it"


def _faults_of(message: Measurement, calibration: Calibration) -> Iterator[str]:
    match message:
        case LidarScan():
            yield from _faults_of_scan(message, calibration)
        case CameraImage():
            camera = calibration.cameras.get(message.sensor)
            if camera is None:
                yield "the calibration knows no such camera"
            elif message.rgb.shape[:2] != (camera.height_px, camera.width_px):
                height, width = message.rgb.shape[:2]
                yield f"{width} x {height} pixels, its camera has {camera.width_px} x {camera.height_px}"
        case Detections():
            if message.sensor not in calibration.cameras:
                yield "the calibration knows no such camera"
            yield from _faults_of_boxes(message)
        case EgoMotion():
            for name in ("velocity_mps", "rate_radps", "specific_force_mps2"):
                if not (np.abs(getattr(message, name)) < FARTHEST_M).all():
                    yield f"{name} is not finite, or too large"


def _faults_of_scan(scan: LidarScan, calibration: Calibration) -> Iterator[str]:
    if scan.sensor not in calibration.T_ego_sensor:
        yield "the calibration does not say where this LiDAR is"
    if not (np.abs(scan.xyz_m) < FARTHEST_M).all():  # True for NaN
        yield "a point is not finite, or too far away"
    if not np.isfinite(scan.intensity).all():
        yield "an intensity is not finite"
    if len(scan.offset_ns) and scan.offset_ns.min() < 0:
        yield "a point was fired before the stamp"
    if len(scan.ring) and scan.ring.min() < -1:
        yield "a ring is negative, and not -1 for an unknown one"


def _faults_of_boxes(detections: Detections) -> Iterator[str]:
    for number, box in enumerate(detections.boxes):
        x0, y0, x1, y1 = box.box_px
        if not (-FARTHEST_PX < x0 <= x1 < FARTHEST_PX and -FARTHEST_PX < y0 <= y1 < FARTHEST_PX):
            yield f"box {number} is not finite, or its corners are the wrong way round"
        if not 0.0 <= box.confidence <= 1.0:
            yield f"box {number} has a confidence of {box.confidence:g}"
        if abs(box.track_id) >= MOST_TRACK or not is_name(box.category):
            yield f"box {number} is of no track or category"


def _content(message: Measurement) -> bytes:
    """A hash of all but the arrival: what is delivered again has the same."""
    hashed = hashlib.sha256(str(message.stamp_ns).encode())
    if isinstance(message, Detections):
        hashed.update(repr(message.boxes).encode())
        return hashed.digest()
    names = {
        LidarScan: ("xyz_m", "intensity", "offset_ns", "ring"), CameraImage: ("rgb",),
        EgoMotion: ("velocity_mps", "rate_radps", "specific_force_mps2"),
    }[type(message)]  # fmt: skip
    for name in names:
        hashed.update(getattr(message, name).tobytes())
    return hashed.digest()
