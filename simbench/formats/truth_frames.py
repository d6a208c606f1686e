"""The truth of a recording as frames, beside those of its messages; `truth_parts.py` reads them. The round
trip is equal bit by bit; poses are samples (`sampled.py`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fusion.messages import BoxPx
from simbench.formats.sampled import Samples, sampled
from simbench.isolate.frames import Frame, FrameError
from simbench.isolate.told import reset_frame
from simbench.truth import GnssReference, ImageTruth, ScanTruth, Truth

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
    for body, samples in sampled(truth.poses, ids, sensors, (first_ns, last_ns), asked_ns):
        yield "/truth/poses", first_ns, _poses(body, samples)
    if truth.reference is not None:
        yield "/truth/reference", first_ns, _reference(truth.reference)
    timed: list[tuple[int, ScanTruth | ImageTruth]]
    timed = [(int(s.fire_ns.min()) if len(s.fire_ns) else first_ns, s) for s in truth.scans]
    timed += [(image.capture_ns, image) for image in truth.images]
    for t_ns, part in sorted(timed, key=lambda item: item[0]):
        frame = _scan(part) if isinstance(part, ScanTruth) else _image(part)
        yield f"/truth/{frame.kind.removesuffix('_truth')}/{frame.fields['sensor']}", t_ns, frame


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


def _poses(body: str, samples: Samples) -> Frame:
    arrays = {name: getattr(samples, name) for name in ("t_ns", "rotation", "translation_m")}
    return Frame(kind="poses", fields={"body": body}, arrays=arrays)


def _reference(reference: GnssReference) -> Frame:
    arrays = {name: getattr(reference, name) for name in ("fix_ns", "available_ns", *REFERENCE)}
    return Frame(kind="reference", fields={"held": reference.held}, arrays=arrays)


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
