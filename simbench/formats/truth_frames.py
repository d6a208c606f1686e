"""The truth of a recording as frames, beside those of its messages. The round trip is equal bit by bit; poses
are samples (`sampled.py`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, cast

import numpy as np

from fusion.geometry import Transform
from fusion.messages import BoxPx
from simbench.formats.sampled import SampledPoses, Samples, sampled
from simbench.isolate.fields import MOST_NAMES, Taken
from simbench.isolate.frames import Frame, FrameError
from simbench.isolate.told import read_reset, reset_frame
from simbench.truth import GnssReference, ImageTruth, ObjectInfo, ScanTruth, TrueBox, Truth

REFERENCE = ("position_ego_m", "centre_ego_m", "lever_m", "heading_m", "noise_m")


def truth_frames(truth: Truth, claimed_ns: Sequence[int] = ()) -> Iterator[tuple[str, int, Frame]]:
    """Topic, time [ns] and frame. First what does not belong to a message, then per scan and image.
    claimed_ns: times of sweeps that their stamps claim; a clock that is off may claim any."""
    first_ns, last_ns = _span(truth)
    asked_ns = (min((first_ns, *claimed_ns)), max((last_ns, *claimed_ns)))
    yield "/truth/about", first_ns, _about(truth)
    yield "/truth/calibration", first_ns, reset_frame(truth.calibration, {})
    ids = [info.object_id for info in truth.objects]
    sensors = truth.calibration.T_ego_sensor
    for body, samples in sampled(truth.poses, ids, sensors, (first_ns, last_ns), asked_ns).items():
        yield "/truth/poses", first_ns, _poses(body, samples)
    if truth.reference is not None:
        yield "/truth/reference", first_ns, _reference(truth.reference)
    timed = [(int(s.fire_ns.min()) if len(s.fire_ns) else first_ns, _scan(s)) for s in truth.scans]
    timed += [(image.capture_ns, _image(image)) for image in truth.images]
    for t_ns, frame in sorted(timed, key=lambda item: item[0]):
        yield f"/truth/{frame.kind.removesuffix('_truth')}/{frame.fields['sensor']}", t_ns, frame


def read_truth(frames: Iterator[Frame]) -> Truth:
    """The truth of its frames. FrameError: one is malformed, or what is needed is missing."""
    one: dict[str, Any] = {}
    bodies: dict[str, Samples] = {}
    scans, images = list[ScanTruth](), list[ImageTruth]()
    told: set[str] = set()
    for frame in frames:
        what = f"poses of {frame.fields.get('body')}" if frame.kind == "poses" else frame.kind
        if what in told:
            raise FrameError(f"there are two '{what[:60]}'")
        if frame.kind not in ("scan_truth", "image_truth"):
            told.add(what)
        match frame.kind:
            case "truth_about":
                one |= _read_about(Taken(frame))
            case "reset":
                one["calibration"], _ = read_reset(frame)
            case "poses":
                body, samples = _read_poses(Taken(frame))
                bodies[body] = samples
            case "reference":
                one["reference"] = _read_reference(Taken(frame))
            case "scan_truth":
                scans.append(_read_scan(Taken(frame)))
            case "image_truth":
                images.append(_read_image(Taken(frame)))
            case other:
                raise FrameError(f"a '{other[:40]}' is no truth")
    missing = {"objects", "calibration"} - set(one)
    if missing or not bodies:
        raise FrameError("the truth does not say what its objects, its calibration and its poses are")
    return Truth(
        scans=tuple(scans), images=tuple(images), poses=SampledPoses(bodies),
        reference=one.pop("reference", None), **one,
    )  # fmt: skip


def _span(truth: Truth) -> tuple[int, int]:
    times = [scan.fire_ns for scan in truth.scans]
    times += [np.array([image.capture_ns for image in truth.images], dtype=np.int64)]
    if truth.reference is not None:
        times += [truth.reference.fix_ns, truth.reference.available_ns]
    ends = [(int(t.min()), int(t.max())) for t in times if len(t)]
    return (min(first for first, _ in ends), max(last for _, last in ends)) if ends else (0, 0)


def _about(truth: Truth) -> Frame:
    return Frame(
        kind="truth_about",
        fields={
            "target_id": truth.target_id, "period_ns": int(truth.period_ns),
            "name": [info.name for info in truth.objects],
            "category": [info.category for info in truth.objects],
        },
        arrays={
            "object_id": np.array([info.object_id for info in truth.objects], dtype=np.int32),
            "size_m": np.array([info.size_m for info in truth.objects], dtype=np.float64).reshape(-1, 3),
            "targets": np.array(truth.targets, dtype=np.int32),
        },
    )  # fmt: skip


def _read_about(taken: Taken) -> dict[str, Any]:
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
    return {"objects": objects, "target_id": target, "targets": targets, "period_ns": period_ns}


def _poses(body: str, samples: Samples) -> Frame:
    arrays = {name: getattr(samples, name) for name in ("t_ns", "rotation", "translation_m")}
    return Frame(kind="poses", fields={"body": body}, arrays=arrays)


def _read_poses(taken: Taken) -> tuple[str, Samples]:
    body = taken.text("body")
    samples = Samples(
        t_ns=taken.array("t_ns", "i64", ("k",)), rotation=taken.array("rotation", "f64", ("k", 3, 3)),
        translation_m=taken.array("translation_m", "f64", ("k", 3)),
    )  # fmt: skip
    taken.end()
    if len(samples.t_ns) < 2 or not (np.diff(samples.t_ns) > 0).all():
        raise taken.error("its times do not rise, or are fewer than two")
    return body, samples


def _reference(reference: GnssReference) -> Frame:
    arrays = {name: getattr(reference, name) for name in ("fix_ns", "available_ns", *REFERENCE)}
    return Frame(kind="reference", fields={"held": reference.held}, arrays=arrays)


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


def _scan(scan: ScanTruth) -> Frame:
    """Numbers as narrow as they fit: half of a recording is this. Firing times count from the first."""
    first_ns = int(scan.fire_ns.min()) if len(scan.fire_ns) else 0
    return Frame(
        kind="scan_truth",
        fields={"sensor": scan.sensor, "seq": int(scan.seq), "first_fire_ns": first_ns},
        arrays={
            "object_id": _narrow(scan.object_id, np.int16), "part_id": _narrow(scan.part_id, np.int16),
            "fire_offset_ns": _narrow(scan.fire_ns - first_ns, np.int32),
            "true_range_m": scan.true_range_m, "incidence_rad": scan.incidence_rad,
        },
    )  # fmt: skip


def _narrow(values: np.ndarray, dtype: type[np.int16] | type[np.int32]) -> np.ndarray:
    """FrameError: a value does not fit."""
    limits = np.iinfo(dtype)
    if len(values) and (values.min() < limits.min or values.max() > limits.max):
        raise FrameError(f"a scan's truth has numbers beyond {limits.min} to {limits.max}")
    return values.astype(dtype)


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


def _image(image: ImageTruth) -> Frame:
    nothing = (np.nan,) * 4  # of what is not visible
    boxes = image.boxes
    return Frame(
        kind="image_truth",
        fields={"sensor": image.sensor, "seq": int(image.seq), "capture_ns": int(image.capture_ns)},
        arrays={
            "rotation": image.T_world_camera.rotation,
            "translation_m": image.T_world_camera.translation_m,
            "object_id": np.array([box.object_id for box in boxes], dtype=np.int32),
            "amodal_px": _rows([box.amodal_px for box in boxes]),
            "visible_px": _rows([box.visible_px or nothing for box in boxes]),
            "visible_fraction": np.array([box.visible_fraction for box in boxes], dtype=np.float64),
            "detection_object_id": np.array(image.detection_object_id, dtype=np.int32),
        },
    )


def _rows(boxes: list[BoxPx]) -> np.ndarray:
    return np.array(boxes, dtype=np.float64).reshape(-1, 4)


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
