"""The truth of a recording read part by part, so that whoever keeps none of them takes no memory for all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TypeAlias, cast

import numpy as np

from fusion.geometry import Transform
from fusion.messages import BoxPx, Calibration
from simbench.formats.sampled import SampledPoses, Samples
from simbench.formats.truth_frames import REFERENCE
from simbench.isolate.fields import MOST_NAMES, Taken
from simbench.isolate.frames import Frame, FrameError
from simbench.isolate.told import read_reset
from simbench.truth import GnssReference, ImageTruth, ObjectInfo, ScanTruth, TrueBox, Truth


@dataclass(frozen=True, kw_only=True)
class About:
    """What a truth says once: see `Truth`."""

    objects: tuple[ObjectInfo, ...]
    target_id: int | None
    targets: tuple[int, ...]
    period_ns: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Where one body was; `SampledPoses` says what bodies are called."""

    body: str
    samples: Samples


TruthPart: TypeAlias = About | Calibration | Placed | GnssReference | ScanTruth | ImageTruth


def truth_parts(frames: Iterator[Frame]) -> Iterator[TruthPart]:
    """The parts of a truth, frame by frame. FrameError: one is malformed, or at the end, what is needed is
    missing."""
    told: set[str] = set()
    for frame in frames:
        what = f"poses of {frame.fields.get('body')}" if frame.kind == "poses" else frame.kind
        if what in told:
            raise FrameError(f"there are two '{what[:60]}'")
        if frame.kind not in ("scan_truth", "image_truth"):
            told.add(what)
        yield _read(frame)
    if not {"truth_about", "reset"} <= told or not any(what.startswith("poses of") for what in told):
        raise FrameError("the truth does not say what its objects, its calibration and its poses are")


def truth_of(parts: Iterable[TruthPart]) -> Truth:
    """All parts of `truth_parts` as one."""
    about: About | None = None
    calibration: Calibration | None = None
    reference: GnssReference | None = None
    bodies, scans, images = dict[str, Samples](), list[ScanTruth](), list[ImageTruth]()
    for part in parts:
        match part:
            case About():
                about = part
            case Calibration():
                calibration = part
            case Placed():
                bodies[part.body] = part.samples
            case GnssReference():
                reference = part
            case ScanTruth():
                scans.append(part)
            case ImageTruth():
                images.append(part)
    assert about is not None and calibration is not None  # else `truth_parts` raised
    return Truth(
        objects=about.objects, target_id=about.target_id, targets=about.targets, period_ns=about.period_ns,
        calibration=calibration, poses=SampledPoses(bodies), reference=reference, scans=tuple(scans),
        images=tuple(images),
    )  # fmt: skip


def _read(frame: Frame) -> TruthPart:
    match frame.kind:
        case "truth_about":
            return _read_about(Taken(frame))
        case "reset":
            return read_reset(frame)[0]
        case "poses":
            return _read_poses(Taken(frame))
        case "reference":
            return _read_reference(Taken(frame))
        case "scan_truth":
            return _read_scan(Taken(frame))
        case "image_truth":
            return _read_image(Taken(frame))
        case other:
            raise FrameError(f"a '{other[:40]}' is no truth")


def _read_about(taken: Taken) -> About:
    target = taken.optional("target_id", False)
    if target is not None and (type(target) is not int or abs(target) >= 2**31):
        raise taken.error("'target_id' is neither a number nor null")
    names, categories = taken.texts("name", "n"), taken.texts("category", "n")
    ids = taken.array("object_id", "i32", ("n",)).tolist()
    sizes = taken.array("size_m", "f64", ("n", 3)).tolist()
    targets = tuple(taken.array("targets", "i32", ("t",)).tolist())
    period_ns = taken.integer("period_ns")
    taken.end()
    objects = tuple(
        ObjectInfo(
            object_id=i, name=name, category=category, size_m=cast(tuple[float, float, float], tuple(size))
        )
        for i, name, category, size in zip(ids, names, categories, sizes, strict=True)
    )
    return About(objects=objects, target_id=target, targets=targets, period_ns=period_ns)


def _read_poses(taken: Taken) -> Placed:
    body = taken.text("body")
    samples = Samples(
        t_ns=taken.array("t_ns", "i64", ("k",)), rotation=taken.array("rotation", "f64", ("k", 3, 3)),
        translation_m=taken.array("translation_m", "f64", ("k", 3)),
    )  # fmt: skip
    taken.end()
    if len(samples.t_ns) < 2 or not (np.diff(samples.t_ns) > 0).all():
        raise taken.error("its times do not rise, or are fewer than two")
    return Placed(body=body, samples=samples)


def _read_reference(taken: Taken) -> GnssReference:
    held = taken.optional("held", None)
    if not isinstance(held, bool):
        raise taken.error("'held' is neither true nor false")
    found = GnssReference(
        held=held, fix_ns=taken.array("fix_ns", "i64", ("m",)),
        available_ns=taken.array("available_ns", "i64", ("m",)),
        **{name: taken.array(name, "f64", ("m", 3)) for name in REFERENCE},
    )  # fmt: skip
    taken.end()
    return found


def _read_scan(taken: Taken) -> ScanTruth:
    first_ns, offset_ns = taken.integer("first_fire_ns"), taken.array("fire_offset_ns", "i32", ("n",))
    if offset_ns.min() != 0 if len(offset_ns) else first_ns != 0:
        raise taken.error("'fire_offset_ns' does not count from the first firing")
    found = ScanTruth(
        sensor=taken.text("sensor"), seq=taken.integer("seq"),
        object_id=taken.array("object_id", "i16", ("n",)).astype(np.int32),
        part_id=taken.array("part_id", "i16", ("n",)).astype(np.int32),
        fire_ns=offset_ns + np.int64(first_ns),
        true_range_m=taken.array("true_range_m", "f64", ("n",)),
        incidence_rad=taken.array("incidence_rad", "f32", ("n",)),
    )  # fmt: skip
    taken.end()
    return found


def _read_image(taken: Taken) -> ImageTruth:
    sensor, seq, capture_ns = taken.text("sensor"), taken.integer("seq"), taken.integer("capture_ns")
    rotation, translation = taken.array("rotation", "f64", (3, 3)), taken.array("translation_m", "f64", (3,))
    ids = taken.array("object_id", "i32", ("b",)).tolist()
    if len(ids) > MOST_NAMES:
        raise taken.error(f"it has {len(ids)} boxes; {MOST_NAMES} are allowed")
    amodal = taken.array("amodal_px", "f64", ("b", 4)).tolist()
    visible = taken.array("visible_px", "f64", ("b", 4))
    share = taken.array("visible_fraction", "f64", ("b",)).tolist()
    detected = tuple(taken.array("detection_object_id", "i32", ("d",)).tolist())
    taken.end()
    try:
        pose = Transform(rotation=rotation, translation_m=translation)
    except ValueError as error:
        raise taken.error(str(error)) from error
    boxes = tuple(
        TrueBox(
            object_id=i,
            amodal_px=cast(BoxPx, tuple(outline)),
            visible_px=None if np.isnan(seen).all() else cast(BoxPx, tuple(seen.tolist())),
            visible_fraction=part,
        )
        for i, outline, seen, part in zip(ids, amodal, visible, share, strict=True)
    )
    return ImageTruth(
        sensor=sensor, seq=seq, capture_ns=capture_ns, T_world_camera=pose, boxes=boxes,
        detection_object_id=detected,
    )  # fmt: skip
