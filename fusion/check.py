"""The conformance kit: does a pipeline keep the contract of `fusion/pipeline.py`?

`check_pipeline(factory)` returns the failures as sentences; none means that it does. It says nothing about
how good the pipeline is. Checked, on a small analytic scene of 0.8 seconds (a LiDAR, two cameras, a car, a
pedestrian, a wall):

* the same messages give the same output, byte for byte, from a new pipeline and from one that was reset;
* no message is changed;
* `reset` forgets: a run after another run equals that run alone;
* it survives an empty scan, a camera that never speaks, detections that come late, messages that come twice
  or out of order, images and ego motion, points that are not finite, a box without area, and no messages;
* at most one output per delivered scan, and only for a delivered scan;
* all numbers are finite, in range and of the declared shape; points index the scan, once each; an object
  belongs to a delivered detection, its stamp lies within its sweep; trajectories ascend in time.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace

import numpy as np

from fusion.aoi import clip
from fusion.camera import PinholeCamera
from fusion.geometry import Transform, rotation_rpy
from fusion.messages import (
    Calibration,
    CameraImage,
    CategorySize,
    Detection,
    Detections,
    EgoMotion,
    FusionOutput,
    LidarScan,
    LocalizedObject,
    Measurement,
    Trajectory,
)
from fusion.pipeline import Pipeline
from fusion.synthetic import Block, beams, cast

_PERIOD_NS = 100_000_000
_SCANS = 8
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # R_body_optical


def check_pipeline(factory: Callable[[], Pipeline]) -> tuple[str, ...]:
    """What is wrong with the pipelines that `factory()` makes; empty if nothing is."""
    calibration, categories, messages = synthetic_run()
    variants = _variants(messages)
    failures: list[str] = []
    for name, stream in variants.items():
        before = digest(stream)
        outcome = _run(factory, calibration, categories, stream)
        if isinstance(outcome, str):
            failures.append(f"{name}: {outcome}")
            continue
        failures += [f"{name}: {failure}" for failure in _validate(stream, *outcome)]
        if digest(stream) != before:
            failures.append(f"{name}: a message was changed")
    return tuple(failures) if failures else _repeatability(factory, calibration, categories, variants)


def _repeatability(
    factory: Callable[[], Pipeline],
    calibration: Calibration,
    categories: Mapping[str, CategorySize],
    variants: Mapping[str, Sequence[Measurement]],
) -> tuple[str, ...]:
    """Same input, same output; and `reset` forgets. Only asked of pipelines that survive everything."""
    whole, other = variants["plain"], variants["one camera only"]
    first = digest(_run(factory, calibration, categories, whole))
    failures = []
    if digest(_run(factory, calibration, categories, whole)) != first:
        failures.append("the same messages gave another output")
    pipeline = factory()
    _run(lambda: pipeline, calibration, categories, other)
    if digest(_run(lambda: pipeline, calibration, categories, whole)) != first:
        failures.append("reset does not reset: a run after another one gave another output")
    return tuple(failures)


def _run(
    factory: Callable[[], Pipeline],
    calibration: Calibration,
    categories: Mapping[str, CategorySize],
    messages: Sequence[Measurement],
) -> tuple[list[object], tuple[object, ...]] | str:
    """The answer to each message and the trajectories, or what was raised."""
    step = "the factory"
    try:
        pipeline = factory()
        step = "reset"
        pipeline.reset(calibration, categories)
        outputs: list[object] = []
        for index, message in enumerate(messages):
            step = f"update with message {index}, {type(message).__name__} {message.seq} of {message.sensor},"
            outputs.append(pipeline.update(message))
        step = "trajectories"
        return outputs, tuple(pipeline.trajectories())
    except Exception as error:  # a kit reports whatever foreign code raises
        return f"{step} raised {type(error).__name__}: {error}"


def _validate(
    messages: Sequence[Measurement],
    outputs: Sequence[object],
    trajectories: Sequence[object],
) -> list[str]:
    """Breaches of the contract in one run."""
    failures = []
    delivered: dict[tuple[str, int], LidarScan] = {}
    tracks: set[tuple[str, int]] = set()
    answered: set[tuple[str, int]] = set()
    for message, output in zip(messages, outputs, strict=True):
        if isinstance(message, LidarScan):
            delivered[message.sensor, message.seq] = message
        elif isinstance(message, Detections):
            tracks |= {(message.sensor, box.track_id) for box in message.boxes}
        if output is None:
            continue
        if not isinstance(output, FusionOutput):
            failures.append(f"update returned a {type(output).__name__}, not a FusionOutput")
            continue
        key = (output.scan_sensor, output.scan_seq)
        if key not in delivered:
            failures.append(f"an output for scan {key}, which was not delivered yet")
            continue
        if key in answered:
            failures.append(f"a second output for scan {key}")
        answered.add(key)
        things: tuple[object, ...] = output.objects
        for found in things:
            if not isinstance(found, LocalizedObject):
                failures.append(f"scan {key}: an object is a {type(found).__name__}, not a LocalizedObject")
                continue
            failures += [f"scan {key}: {failure}" for failure in _object(found, delivered[key], tracks)]
    tracked = [track for track in trajectories if isinstance(track, Trajectory)]
    for other in trajectories:
        if not isinstance(other, Trajectory):
            failures.append(f"trajectories returned a {type(other).__name__}, not a Trajectory")
    for track in tracked:
        failures += [f"trajectory {track.track_id}: {failure}" for failure in _trajectory(track)]
    known = {track_id for _, track_id in tracks}
    ids = [track.track_id for track in tracked]
    if len(set(ids)) < len(ids):
        failures.append("two trajectories of one track id")
    failures += [f"a trajectory of track {i}, which was never detected" for i in ids if i not in known]
    return failures


def _object(found: LocalizedObject, scan: LidarScan, tracks: set[tuple[str, int]]) -> list[str]:
    points, count = found.points, len(scan.xyz_m)
    last_ns = scan.stamp_ns + (int(scan.offset_ns.max()) if count else 0)
    numbers = (*found.position_ego_m.ravel(), found.distance_m, found.azimuth_rad, found.confidence)
    breaches = {
        f"camera {found.sensor!r} never detected track {found.track_id}": (
            (found.sensor, found.track_id) not in tracks
        ),
        "points must be indices [k] into the scan": points.ndim != 1
        or bool(len(points) and (points.min() < 0 or points.max() >= count)),
        "a point is mapped twice": len(np.unique(points)) < points.size,
        "position_ego_m must have shape [3]": found.position_ego_m.shape != (3,),
        "a number is not finite": not np.isfinite(numbers).all(),
        f"stamp {found.stamp_ns} lies outside the sweep {scan.stamp_ns} to {last_ns}": (
            not scan.stamp_ns <= found.stamp_ns <= last_ns
        ),
        "distance_m is negative": found.distance_m < 0.0,
        "azimuth_rad is not within -pi to pi": abs(found.azimuth_rad) > np.pi + 1e-9,
        "confidence is not within 0 to 1": found.confidence < 0.0 or found.confidence > 1.0,
    }
    return [text for text, broken in breaches.items() if broken]


def _trajectory(track: Trajectory) -> list[str]:
    count = len(track.stamp_ns)
    breaches = {
        "stamp_ns must ascend": bool((np.diff(track.stamp_ns) <= 0).any()),
        "position_ego_m must have shape [t 3]": track.position_ego_m.shape != (count, 3),
        "inlier must have shape [t]": track.inlier.shape != (count,),
        "a position is not finite": not np.isfinite(track.position_ego_m).all(),
    }
    return [text for text, broken in breaches.items() if broken]


def _variants(messages: Sequence[Measurement]) -> dict[str, Sequence[Measurement]]:
    """The run, and the ways in which a real one differs from it. Each is in order of arrival."""
    first_scan = next(m for m in messages if isinstance(m, LidarScan))
    second_scan = next(i for i, m in enumerate(messages) if isinstance(m, LidarScan) and m.seq == 1)
    swapped = [*messages[second_scan:], *messages[:second_scan]]
    return {
        "plain": messages,
        "no messages": (),
        "no detections": [m for m in messages if not isinstance(m, Detections)],
        "no scans": [m for m in messages if not isinstance(m, LidarScan)],
        "one scan only": [first_scan],
        "one camera only": [m for m in messages if m.sensor != "right"],
        "empty scans": [_cut(m, 0) if isinstance(m, LidarScan) and m.seq % 2 else m for m in messages],
        "scans of one point": [_cut(m, 1) if isinstance(m, LidarScan) else m for m in messages],
        "points that are not finite": [_spoil(m) if isinstance(m, LidarScan) else m for m in messages],
        "late detections": _delayed(messages, 250_000_000),
        "messages twice": [m for m in messages for _ in range(2)],
        "messages out of order": swapped,
        "stamps an hour off": [
            replace(m, stamp_ns=m.stamp_ns + 3_600_000_000_000) if m.sensor == "right" else m
            for m in messages
        ],
        "boxes without area or outside the image": [
            replace(m, boxes=tuple(_odd(box) for box in m.boxes)) if isinstance(m, Detections) else m
            for m in messages
        ],
        "images without boxes": [replace(m, boxes=()) if isinstance(m, Detections) else m for m in messages],
        "scans that drop out": [m for m in messages if not (isinstance(m, LidarScan) and m.seq in (3, 4, 5))],
    }


def _cut(scan: LidarScan, count: int) -> LidarScan:
    return replace(
        scan,
        xyz_m=scan.xyz_m[:count],
        intensity=scan.intensity[:count],
        offset_ns=scan.offset_ns[:count],
        ring=scan.ring[:count],
    )


def _spoil(scan: LidarScan) -> LidarScan:
    xyz_m = scan.xyz_m.copy()
    xyz_m[::7] = np.nan
    xyz_m[3::7, 0] = np.inf
    return replace(scan, xyz_m=xyz_m)


def _odd(box: Detection) -> Detection:
    x0, y0, x1, y1 = box.box_px
    shapes = ((x0, y0, x0, y0), (x1, y1, x0, y0), (x0 - 1e6, y0, x1 - 1e6, y1), (-1e6, -1e6, 1e6, 1e6))
    return replace(box, box_px=shapes[box.track_id % len(shapes)])


def _delayed(messages: Sequence[Measurement], late_ns: int) -> list[Measurement]:
    """Detections delivered later by `late_ns`, everything again in order of arrival."""
    moved = (
        replace(m, arrival_ns=m.arrival_ns + late_ns) if isinstance(m, Detections) else m for m in messages
    )
    return sorted(moved, key=lambda m: m.arrival_ns)


def digest(value: object) -> str:
    """SHA-256 of everything in messages or outputs: names, numbers bit by bit, shapes and types of arrays."""
    state = hashlib.sha256()

    def feed(item: object) -> None:
        if isinstance(item, np.ndarray):
            state.update(f"{item.dtype}{item.shape}".encode() + np.ascontiguousarray(item).tobytes())
        elif is_dataclass(item):
            state.update(type(item).__name__.encode())
            for entry in fields(item):
                feed(getattr(item, entry.name))
        elif isinstance(item, list | tuple):
            state.update(f"[{len(item)}]".encode())
            for part in item:
                feed(part)
        else:
            state.update(f"{type(item).__name__}:{item!r};".encode())

    feed(value)
    return state.hexdigest()


def synthetic_run() -> tuple[Calibration, dict[str, CategorySize], tuple[Measurement, ...]]:
    """A calibration, category sizes, and the messages of a small run in order of arrival.

    The car comes nearer, the pedestrian crosses, the wall stands. Detections are the boxes of the corners.
    """
    calibration = _calibration()
    categories = {
        "car": CategorySize(mean_m=(4.5, 1.8, 1.5), spread=0.08),
        "pedestrian": CategorySize(mean_m=(0.5, 0.5, 1.75), spread=0.08),
    }
    messages: list[Measurement] = []
    for seq in range(_SCANS):
        stamp_ns = 1_000_000_000 + seq * _PERIOD_NS
        blocks = _blocks(0.1 * seq)
        messages.append(_scan(seq, stamp_ns, blocks, calibration))
        for camera in sorted(calibration.cameras):
            messages += _seen(camera, seq, stamp_ns, blocks, calibration)
        messages.append(
            EgoMotion(
                sensor="odometer",
                seq=seq,
                stamp_ns=stamp_ns,
                arrival_ns=stamp_ns + 1_000_000,
                velocity_mps=np.array([5.0, 0.0, 0.0]),
                rate_radps=np.zeros(3),
                specific_force_mps2=np.array([0.0, 0.0, 9.81]),
            )
        )
    return calibration, categories, tuple(sorted(messages, key=lambda m: m.arrival_ns))


def _calibration() -> Calibration:
    camera = PinholeCamera(fx_px=200.0, fy_px=200.0, cx_px=160.0, cy_px=100.0, width_px=320, height_px=200)
    mounts = {
        name: Transform(
            rotation=rotation_rpy(0.0, 0.0, yaw_rad) @ _OPTICAL, translation_m=np.array([0.2, left_m, 1.6])
        )
        for name, yaw_rad, left_m in (("left", 0.3, 0.5), ("right", -0.3, -0.5))
    }
    lidar = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.8]))
    return Calibration(T_ego_sensor={"lidar": lidar, **mounts}, cameras={"left": camera, "right": camera})


def _blocks(time_s: float) -> dict[str, Block]:
    return {
        "car": Block(centre_m=(12.0 - 3.0 * time_s, 2.5, 0.8), size_m=(4.5, 1.8, 1.5), yaw_rad=0.1),
        "pedestrian": Block(centre_m=(9.0, -4.0 + 1.4 * time_s, 0.9), size_m=(0.4, 0.5, 1.75)),
        "wall": Block(centre_m=(25.0, 0.0, 2.0), size_m=(0.5, 40.0, 4.0)),
    }


def _scan(seq: int, stamp_ns: int, blocks: Mapping[str, Block], calibration: Calibration) -> LidarScan:
    rings, columns = 16, 512
    directions = beams(rings, columns, np.deg2rad(16.0))
    range_m, _ = cast(calibration.T_ego_sensor["lidar"].translation_m, directions, tuple(blocks.values()))
    hit = range_m < 60.0
    column = np.arange(rings * columns) // rings
    return LidarScan(
        sensor="lidar",
        seq=seq,
        stamp_ns=stamp_ns,
        arrival_ns=stamp_ns + _PERIOD_NS + 8_000_000,
        xyz_m=(directions[hit] * range_m[hit, None]).astype(np.float32),
        intensity=np.full(int(hit.sum()), 0.5, dtype=np.float32),
        offset_ns=(column * (_PERIOD_NS // columns))[hit].astype(np.int32),
        ring=(np.arange(rings * columns) % rings)[hit].astype(np.int16),
    )


def _seen(
    name: str, seq: int, stamp_ns: int, blocks: Mapping[str, Block], calibration: Calibration
) -> list[Measurement]:
    """One camera's image and detections, 20 and 40 ms after an exposure 5 ms after the scan's stamp."""
    camera, stamp_ns = calibration.cameras[name], stamp_ns + 5_000_000
    boxes = []
    for track_id, category in enumerate(("car", "pedestrian"), start=1):
        uv_px = camera.project(calibration.T_ego_sensor[name].inverse().apply(blocks[category].corners_m()))
        (x0, y0), (x1, y1) = uv_px.min(axis=0), uv_px.max(axis=0)
        box_px = clip((float(x0), float(y0), float(x1), float(y1)), camera)
        if np.isfinite(uv_px).all() and box_px is not None:
            boxes.append(Detection(track_id=track_id, category=category, box_px=box_px, confidence=0.9))
    return [
        CameraImage(
            sensor=name,
            seq=seq,
            stamp_ns=stamp_ns,
            arrival_ns=stamp_ns + 20_000_000,
            rgb=np.full((camera.height_px, camera.width_px, 3), 128, dtype=np.uint8),
        ),
        Detections(
            sensor=name, seq=seq, stamp_ns=stamp_ns, arrival_ns=stamp_ns + 40_000_000, boxes=tuple(boxes)
        ),
    ]
