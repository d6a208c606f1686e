"""What a recording must be, beyond its form, before anything is computed of it.

Every frame may be well made and the whole still be nonsense: a point that is no number, a sweep without
truth, a target that is no object. Then scores would end in a crash, or in a number. Here it ends in one
sentence. What the bench records, under any fault, passes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

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
from simbench.formats.sound_truth import faults_of_match, faults_of_truth
from simbench.recording import Recording

MOST_TRACK = 2**62


def check_sound(recording: Recording, *, whole: bool, messages_file: str, truth_file: str) -> None:
    """BadInput: the recording cannot be. whole: nothing of it is missing; else the truth may end early."""
    told = (recording.calibration, recording.categories, recording.messages)
    for file, faults in (
        (messages_file, faults_of_messages(*told)),
        (truth_file, faults_of_truth(recording.truth, whole=whole)),
        (truth_file, faults_of_match(recording, whole=whole)),
    ):
        for fault in faults:
            raise BadInput(fault, file=file)


def faults_of_messages(
    calibration: Calibration, categories: Mapping[str, CategorySize], messages: tuple[Measurement, ...]
) -> Iterator[str]:
    """What is wrong with that which a pipeline is told, in sentences without an end."""
    yield from faults_of_calibration(calibration)
    for name, size in categories.items():
        if not is_name(name):
            yield f"a category is called {show(name)}"
        if (
            not all(0.0 < length < FARTHEST_M for length in size.mean_m)
            or not 0.0 <= size.spread < FARTHEST_M
        ):
            yield f"the category {show(name)} has a size that is none"
    before_ns = -LATEST_NS
    first: dict[tuple[str, str, int], Measurement] = {}
    for number, message in enumerate(messages):
        where = f"message {number} ({type(message).__name__} {message.seq} of {show(message.sensor)})"
        if not is_sensor(message.sensor):
            yield f"{where}: its sensor's name is none"
        if message.seq < 0:
            yield f"{where}: its number is negative"
        if max(abs(message.stamp_ns), abs(message.arrival_ns)) >= LATEST_NS:
            yield f"{where}: its time lies beyond {LATEST_NS} ns"
        if message.arrival_ns < before_ns:
            yield f"{where}: it arrived before the one that stands before it"
        before_ns = message.arrival_ns
        for fault in _faults_of(message, calibration):
            yield f"{where}: {fault}"
        known = first.setdefault((type(message).__name__, message.sensor, message.seq), message)
        if known is not message and not _same(known, message):
            yield f"{where}: another one has its number"


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


def _same(one: Measurement, other: Measurement) -> bool:
    """Whether the second is the first, delivered again."""
    if isinstance(one, Detections) and isinstance(other, Detections):
        return (one.stamp_ns, one.boxes) == (other.stamp_ns, other.boxes)
    names = {
        LidarScan: ("xyz_m", "intensity", "offset_ns", "ring"), CameraImage: ("rgb",),
        EgoMotion: ("velocity_mps", "rate_radps", "specific_force_mps2"),
    }[type(one)]  # fmt: skip
    return one.stamp_ns == other.stamp_ns and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in names
    )
