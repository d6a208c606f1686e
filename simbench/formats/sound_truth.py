"""What the truth of a recording must be, and how it must fit the messages: see `sound.py`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np
from jaxtyping import Bool, Int64

from fusion.messages import Calibration, Detections, LidarScan
from scenarios.errors import BadInput, show
from simbench.formats.sampled import EGO, Samples, Span, object_name, sensor_name
from simbench.formats.sound import Heard
from simbench.formats.sound_calibration import FARTHEST_M, FARTHEST_PX, LATEST_NS, faults_of_calibration
from simbench.formats.truth_parts import About, Placed, TruthPart
from simbench.truth import GnssReference, ImageTruth, ObjectInfo, ScanTruth

LONGEST_PERIOD_NS = 3_600 * 10**9
LEAST_ORTHONORMAL = 1e-6
CATEGORY = re.compile("[a-z][a-z0-9_-]{0,63}")
NOTHING = -1
MARGIN_NS = 5_000_000  # of speeds, which are differences


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """What is kept of a `ScanTruth`. fire_ns: first and last; object_ids: of all points."""

    sensor: str
    seq: int
    count: int
    fire_ns: Span | None
    object_ids: frozenset[int]


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What is kept of an `ImageTruth`. count: of detections; object_ids: of boxes, detected_ids: of them."""

    sensor: str
    seq: int
    capture_ns: int
    count: int
    object_ids: frozenset[int]
    detected_ids: frozenset[int]


@dataclass(kw_only=True, eq=False)
class Outline:
    """What is kept of a truth while it is read. spans_ns: first and last pose of a body."""

    about: About | None = None
    calibration: Calibration | None = None
    spans_ns: dict[str, Span] = field(default_factory=dict)
    sweeps: list[Sweep] = field(default_factory=list)
    images: list[Shown] = field(default_factory=list)


def sound_parts(parts: Iterable[TruthPart], outline: Outline, file: str) -> Iterator[TruthPart]:
    """The parts one by one, each when it is known to be sound by itself; what is kept of them is added to
    `outline`. BadInput: one cannot be."""
    for part in parts:
        for fault in _faults_of(part):
            raise BadInput(fault, file=file)
        _keep(part, outline)
        yield part


def check_fit(outline: Outline, heard: Sequence[Heard], *, whole: bool, file: str) -> None:
    """BadInput: the parts of a truth do not fit each other, or the messages. whole: nothing is missing; else
    the truth may end early."""
    for fault in chain(_faults_of_whole(outline, whole=whole), _faults_of_match(outline, heard, whole=whole)):
        raise BadInput(fault, file=file)


def _keep(part: TruthPart, outline: Outline) -> None:
    match part:
        case About():
            outline.about = part
        case Calibration():
            outline.calibration = part
        case Placed():
            outline.spans_ns[part.body] = (int(part.samples.t_ns[0]), int(part.samples.t_ns[-1]))
        case ScanTruth():
            outline.sweeps.append(Sweep(
                sensor=part.sensor, seq=part.seq, count=len(part.object_id),
                fire_ns=(int(part.fire_ns.min()), int(part.fire_ns.max())) if len(part.fire_ns) else None,
                object_ids=frozenset(np.unique(part.object_id).tolist()),
            ))  # fmt: skip
        case ImageTruth():
            outline.images.append(Shown(
                sensor=part.sensor, seq=part.seq, capture_ns=part.capture_ns,
                count=len(part.detection_object_id), object_ids=frozenset(b.object_id for b in part.boxes),
                detected_ids=frozenset(part.detection_object_id),
            ))  # fmt: skip


def _faults_of(part: TruthPart) -> Iterator[str]:
    """What is wrong with a part by itself, in sentences without an end."""
    match part:
        case About():
            yield from _faults_of_about(part)
        case Calibration():
            yield from faults_of_calibration(part)
        case Placed():
            yield from (f"the poses of {show(part.body)} {fault}" for fault in _faults_of_poses(part.samples))
        case GnssReference():
            yield from _faults_of_reference(part)
        case ScanTruth():
            where = f"sweep {part.seq} of {show(part.sensor)}"
            yield from (f"{where}: {fault}" for fault in _faults_of_scan(part))
        case ImageTruth():
            where = f"image {part.seq} of {show(part.sensor)}"
            yield from (f"{where}: {fault}" for fault in _faults_of_image(part))


def _faults_of_whole(outline: Outline, *, whole: bool) -> Iterator[str]:
    about, calibration = outline.about, outline.calibration
    assert about is not None and calibration is not None  # else `truth_parts` raised
    ids = {info.object_id for info in about.objects}
    needed = [EGO, *(object_name(i) for i in ids), *map(sensor_name, calibration.T_ego_sensor)]
    for body in needed if whole else ():
        if body not in outline.spans_ns:
            yield f"nobody says where '{body[:60]}' is"
    times = [t for sweep in outline.sweeps if sweep.fire_ns is not None for t in sweep.fire_ns]
    times += [image.capture_ns for image in outline.images]
    for body, (first_ns, last_ns) in outline.spans_ns.items():
        if times and not first_ns <= min(times) <= max(times) <= last_ns:
            yield f"the poses of {show(body)} do not reach over all that happened"
    for kind, parts in (("sweep", outline.sweeps), ("image", outline.images)):
        if len({(one.sensor, one.seq) for one in parts}) < len(parts):
            yield f"there are two truths of one {kind}"
    for sweep in outline.sweeps:
        if not sweep.object_ids <= {NOTHING, *ids}:
            yield f"sweep {sweep.seq} of {show(sweep.sensor)}: a point lies on an object that is none"
    for image in outline.images:
        where = f"image {image.seq} of {show(image.sensor)}"
        if image.sensor not in calibration.cameras:
            yield f"{where}: the calibration knows no such camera"
        if not image.detected_ids <= {NOTHING, *ids}:
            yield f"{where}: a detection is of an object that is none"
        if not image.object_ids <= ids:
            yield f"{where}: a box is of an object that is none"


def _faults_of_match(outline: Outline, heard: Sequence[Heard], *, whole: bool) -> Iterator[str]:
    """Where messages and truth do not fit. whole: every message must have its truth."""
    scans = {(one.sensor, one.seq): one for one in outline.sweeps}
    images = {(one.sensor, one.seq): one for one in outline.images}
    known_ns = _known_ns(outline) if whole else (0, 0)
    period_ns = 0 if outline.about is None else outline.about.period_ns
    for message in heard:
        key = (message.sensor, message.seq)
        where = f"{message.seq} of {show(message.sensor)}"
        if message.kind is LidarScan:
            end_ns = max(message.last_ns, message.stamp_ns + period_ns)
            if key in scans and scans[key].count != message.count:
                yield f"sweep {where}: its truth has another number of points"
            if whole and key not in scans:
                yield f"sweep {where} has no truth"
            if whole and not known_ns[0] <= message.stamp_ns <= end_ns <= known_ns[1]:
                yield f"sweep {where}: its stamp lies where no poses are known"
        elif whole and key not in images:
            yield f"image {where} has no truth"
        elif message.kind is Detections and key in images and images[key].count != message.count:
            yield f"image {where}: its truth has another number of detections"


def _known_ns(outline: Outline) -> Span:
    """When ego and objects are known: scores ask for them throughout what a sweep's stamp claims."""
    assert outline.about is not None
    names = (EGO, *(object_name(info.object_id) for info in outline.about.objects))
    spans = [outline.spans_ns[name] for name in names]
    return max(first for first, _ in spans) + MARGIN_NS, min(last for _, last in spans) - MARGIN_NS


def _faults_of_about(about: About) -> Iterator[str]:
    if not 0 < about.period_ns <= LONGEST_PERIOD_NS:
        yield f"the LiDAR's period is {about.period_ns} ns"
    yield from _faults_of_objects(about.objects)
    ids = [info.object_id for info in about.objects]
    for target in (*about.targets, *(() if about.target_id is None else (about.target_id,))):
        if target not in ids:
            yield f"the target {target} is no object"
    if len(set(about.targets)) < len(about.targets):
        yield "a target stands twice"


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


def _faults_of_poses(samples: Samples) -> Iterator[str]:
    if not (np.abs(samples.translation_m) < FARTHEST_M).all():
        yield "are not finite, or too far away"
    if not _rotations(samples.rotation).all():
        yield "hold a matrix that is no rotation"
    if not _in_time(samples.t_ns):
        yield f"are of a time beyond {LATEST_NS} ns"


def _faults_of_scan(scan: ScanTruth) -> Iterator[str]:
    if not ((scan.true_range_m >= 0.0) & (scan.true_range_m < FARTHEST_M)).all():  # False for NaN
        yield "a true range is negative, not finite, or too large"
    if not _in_time(scan.fire_ns):
        yield f"a point was fired beyond {LATEST_NS} ns"


def _faults_of_image(image: ImageTruth) -> Iterator[str]:
    if abs(image.capture_ns) >= LATEST_NS:
        yield f"it was taken beyond {LATEST_NS} ns"
    if not (np.abs(image.T_world_camera.translation_m) < FARTHEST_M).all():
        yield "it was taken too far away"
    for box in image.boxes:
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
