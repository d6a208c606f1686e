"""What the truth of a recording must be, and how it must fit the messages: see `sound.py`."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Int64

from fusion.messages import CameraImage, Detections, LidarScan
from scenarios.errors import show
from simbench.formats.sampled import EGO, SampledPoses, object_name, sensor_name
from simbench.formats.sound_calibration import FARTHEST_M, FARTHEST_PX, LATEST_NS, faults_of_calibration
from simbench.recording import Recording
from simbench.truth import GnssReference, ImageTruth, ObjectInfo, ScanTruth, Truth

LONGEST_PERIOD_NS = 3_600 * 10**9
LEAST_ORTHONORMAL = 1e-6
CATEGORY = re.compile("[a-z][a-z0-9_-]{0,63}")
NOTHING = -1
MARGIN_NS = 5_000_000  # of speeds, which are differences


def faults_of_truth(truth: Truth, *, whole: bool) -> Iterator[str]:
    """What is wrong with a truth by itself, in sentences without an end."""
    yield from faults_of_calibration(truth.calibration)
    if not 0 < truth.period_ns <= LONGEST_PERIOD_NS:
        yield f"the LiDAR's period is {truth.period_ns} ns"
    yield from _faults_of_objects(truth.objects)
    ids = [info.object_id for info in truth.objects]
    for target in (*truth.targets, *(() if truth.target_id is None else (truth.target_id,))):
        if target not in ids:
            yield f"the target {target} is no object"
    if len(set(truth.targets)) < len(truth.targets):
        yield "a target stands twice"
    yield from _faults_of_poses(truth, whole=whole)
    known = np.array([NOTHING, *ids], dtype=np.int64)
    for kind, parts in (("sweep", truth.scans), ("image", truth.images)):
        keys = [(one.sensor, one.seq) for one in parts]
        if len(set(keys)) < len(keys):
            yield f"there are two truths of one {kind}"
    for scan in truth.scans:
        for fault in _faults_of_scan(scan, known):
            yield f"sweep {scan.seq} of {show(scan.sensor)}: {fault}"
    for image in truth.images:
        for fault in _faults_of_image(image, truth, known):
            yield f"image {image.seq} of {show(image.sensor)}: {fault}"
    if truth.reference is not None:
        yield from _faults_of_reference(truth.reference)


def faults_of_match(recording: Recording, *, whole: bool) -> Iterator[str]:
    """Where messages and truth do not fit. whole: every message must have its truth."""
    scans = {(one.sensor, one.seq): one for one in recording.truth.scans}
    images = {(one.sensor, one.seq): one for one in recording.truth.images}
    for message in recording.messages:
        key = (message.sensor, message.seq)
        where = f"{message.seq} of {show(message.sensor)}"
        match message:
            case LidarScan():
                if key in scans and len(scans[key].object_id) != len(message.xyz_m):
                    yield f"sweep {where}: its truth has another number of points"
                if whole and key not in scans:
                    yield f"sweep {where} has no truth"
                if whole and not _reached(message, recording.truth):
                    yield f"sweep {where}: its stamp lies where no poses are known"
            case CameraImage() | Detections():
                if whole and key not in images:
                    yield f"image {where} has no truth"
                if isinstance(message, Detections) and key in images:
                    if len(images[key].detection_object_id) != len(message.boxes):
                        yield f"image {where}: its truth has another number of detections"


def _reached(scan: LidarScan, truth: Truth) -> bool:
    """Whether ego and objects are known throughout what a sweep's stamp claims: scores ask for them there."""
    assert isinstance(truth.poses, SampledPoses)
    names = (EGO, *(object_name(info.object_id) for info in truth.objects))
    first_ns = max(int(truth.poses.bodies[name].t_ns[0]) for name in names)
    last_ns = min(int(truth.poses.bodies[name].t_ns[-1]) for name in names)
    end_ns = scan.stamp_ns + max(int(scan.offset_ns.max(initial=0)), truth.period_ns)
    return first_ns + MARGIN_NS <= scan.stamp_ns and end_ns + MARGIN_NS <= last_ns


def _faults_of_objects(objects: tuple[ObjectInfo, ...]) -> Iterator[str]:
    for what in ("object_id", "name"):
        if len({getattr(info, what) for info in objects}) < len(objects):
            yield f"two objects have one {what}"
    for info in objects:
        if info.object_id < 0 or not info.name.isprintable() or not info.name:
            yield f"object {info.object_id} has the name {show(info.name)}"
        if CATEGORY.fullmatch(info.category) is None:
            yield f"object {info.object_id} is of no category"
        if not all(0.0 < length < FARTHEST_M for length in info.size_m):
            yield f"object {info.object_id} has a size that is none"


def _faults_of_poses(truth: Truth, *, whole: bool) -> Iterator[str]:
    assert isinstance(truth.poses, SampledPoses)
    bodies = truth.poses.bodies
    needed = [EGO, *(object_name(info.object_id) for info in truth.objects)]
    needed += [sensor_name(name) for name in truth.calibration.T_ego_sensor]
    for body in needed if whole else ():
        if body not in bodies:
            yield f"nobody says where '{body[:60]}' is"
    times = _times(truth)
    for body, samples in bodies.items():
        what = f"the poses of {show(body)}"
        if not (np.abs(samples.translation_m) < FARTHEST_M).all():
            yield f"{what} are not finite, or too far away"
        if not _rotations(samples.rotation).all():
            yield f"{what} hold a matrix that is no rotation"
        if not _in_time(samples.t_ns):
            yield f"{what} are of a time beyond {LATEST_NS} ns"
        elif len(times) and not samples.t_ns[0] <= times.min() <= times.max() <= samples.t_ns[-1]:
            yield f"{what} do not reach over all that happened"


def _times(truth: Truth) -> Int64[np.ndarray, " n"]:
    """The first and last of all times at which something was."""
    found = [t for scan in truth.scans if len(scan.fire_ns) for t in (scan.fire_ns.min(), scan.fire_ns.max())]
    found += [image.capture_ns for image in truth.images]
    return np.array(found, dtype=np.int64)


def _faults_of_scan(scan: ScanTruth, known: Int64[np.ndarray, " o"]) -> Iterator[str]:
    if not np.isin(scan.object_id, known).all():
        yield "a point lies on an object that is none"
    if not ((scan.true_range_m >= 0.0) & (scan.true_range_m < FARTHEST_M)).all():  # False for NaN
        yield "a true range is negative, not finite, or too large"
    if not _in_time(scan.fire_ns):
        yield f"a point was fired beyond {LATEST_NS} ns"


def _faults_of_image(image: ImageTruth, truth: Truth, known: Int64[np.ndarray, " o"]) -> Iterator[str]:
    if image.sensor not in truth.calibration.cameras:
        yield "the calibration knows no such camera"
    if abs(image.capture_ns) >= LATEST_NS:
        yield f"it was taken beyond {LATEST_NS} ns"
    if not (np.abs(image.T_world_camera.translation_m) < FARTHEST_M).all():
        yield "it was taken too far away"
    if not np.isin(np.array(image.detection_object_id, dtype=np.int64), known).all():
        yield "a detection is of an object that is none"
    for box in image.boxes:
        if box.object_id < 0 or box.object_id not in known:
            yield "a box is of an object that is none"
        for x0, y0, x1, y1 in (box.amodal_px, *(() if box.visible_px is None else (box.visible_px,))):
            if not (-FARTHEST_PX < x0 <= x1 < FARTHEST_PX and -FARTHEST_PX < y0 <= y1 < FARTHEST_PX):
                yield "a box is not finite, or its corners are the wrong way round"
        if not 0.0 <= box.visible_fraction <= 1.0:
            yield f"a box is visible by {box.visible_fraction:g}"
    if len({box.object_id for box in image.boxes}) < len(image.boxes):
        yield "an object has two boxes"


def _faults_of_reference(reference: GnssReference) -> Iterator[str]:
    for name in ("position_ego_m", "centre_ego_m", "lever_m", "heading_m", "noise_m"):
        if not (np.abs(getattr(reference, name)) < FARTHEST_M).all():
            yield f"the reference's {name} is not finite, or too far away"
    if not (_in_time(reference.fix_ns) and _in_time(reference.available_ns)):
        yield f"a fix of the reference lies beyond {LATEST_NS} ns"


def _in_time(t_ns: Int64[np.ndarray, " n"]) -> bool:
    return bool(((t_ns > -LATEST_NS) & (t_ns < LATEST_NS)).all())


def _rotations(rotation: np.ndarray) -> Bool[np.ndarray, " n"]:
    """Which of [n 3 3] are rotations."""
    with np.errstate(invalid="ignore", over="ignore"):
        off = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        return np.asarray((off <= LEAST_ORTHONORMAL) & (np.linalg.det(rotation) > 0.0))
