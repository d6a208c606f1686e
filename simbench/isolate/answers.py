"""What a pipeline answers, as frames: an output or nothing to a message, trajectories at the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate

import numpy as np

from fusion.messages import FusionOutput, LocalizedObject, Trajectory
from simbench.isolate.fields import Taken
from simbench.isolate.frames import Frame, FrameError

Steps = Mapping[str, tuple[int, ...]]


def output_frame(output: FusionOutput) -> Frame:
    """`output`. FrameError with one sentence where an object is not what it must be."""
    found = tuple(output.objects)
    where = f"scan {output.scan_seq} of {output.scan_sensor!r}"
    for one in found:
        if not isinstance(one, LocalizedObject):
            raise FrameError(f"{where}: objects must be LocalizedObject, not {type(one).__name__}")
        track = f"{where}, track {one.track_id!r}"
        if one.points.ndim != 1:
            raise FrameError(f"{track}: points has shape {one.points.shape}, not (k,)")
        if one.position_ego_m.shape != (3,):
            raise FrameError(f"{track}: position_ego_m has shape {one.position_ego_m.shape}, not (3,)")
    return Frame(
        kind="output",
        fields={
            "scan_sensor": _text("scan_sensor", output.scan_sensor),
            "scan_seq": int(_integers("scan_seq", [output.scan_seq])[0]),
            "category": [_text("category", one.category) for one in found],
            "sensor": [_text("sensor", one.sensor) for one in found],
        },
        arrays={
            "track_id": _integers("track_id", [one.track_id for one in found]),
            "stamp_ns": _integers("stamp_ns", [one.stamp_ns for one in found]),
            "position_ego_m": _rows([one.position_ego_m for one in found], (0, 3), np.float64),
            "distance_m": _floats("distance_m", [one.distance_m for one in found]),
            "azimuth_rad": _floats("azimuth_rad", [one.azimuth_rad for one in found]),
            "confidence": _floats("confidence", [one.confidence for one in found]),
            "count": np.array([len(one.points) for one in found], dtype=np.int64),
            "points": np.concatenate([np.zeros(0, dtype=np.int64), *(one.points for one in found)]),
        },
    )


def read_output(frame: Frame) -> FusionOutput:
    """The output of a frame. FrameError where it is malformed."""
    taken = Taken(frame)
    scan_sensor, scan_seq = taken.text("scan_sensor"), taken.integer("scan_seq")
    category, sensor = taken.texts("category", "n"), taken.texts("sensor", "n")
    track_id = taken.array("track_id", "i64", ("n",)).tolist()
    stamp_ns = taken.array("stamp_ns", "i64", ("n",)).tolist()
    position = taken.array("position_ego_m", "f64", ("n", 3))
    numbers = [
        taken.array(name, "f64", ("n",)).tolist() for name in ("distance_m", "azimuth_rad", "confidence")
    ]
    starts = _starts(taken, "points")
    points = taken.array("points", "i64", ("points",))
    taken.end()
    return FusionOutput(
        scan_sensor=scan_sensor,
        scan_seq=scan_seq,
        objects=tuple(
            LocalizedObject(
                track_id=track_id[i], category=category[i], sensor=sensor[i], stamp_ns=stamp_ns[i],
                points=points[starts[i] : starts[i + 1]], position_ego_m=position[i],
                distance_m=numbers[0][i], azimuth_rad=numbers[1][i], confidence=numbers[2][i],
            )
            for i in range(len(track_id))
        ),
    )  # fmt: skip


def trajectories_frame(tracks: Sequence[object], steps: Steps) -> Frame:
    """`trajectories`, with the nanoseconds of the pipeline's own steps. FrameError as in `output_frame`."""
    found: list[Trajectory] = []
    for one in tracks:
        if not isinstance(one, Trajectory):
            raise FrameError(f"trajectories must return Trajectory, not {type(one).__name__}")
        n = len(one.stamp_ns) if one.stamp_ns.ndim == 1 else -1
        shapes = (one.stamp_ns.shape, one.position_ego_m.shape, one.inlier.shape)
        if shapes != ((n,), (n, 3), (n,)):
            raise FrameError(
                f"trajectory {one.track_id!r}: stamps, positions and inliers have shapes {shapes}"
            )
        found.append(one)
    return Frame(
        kind="trajectories",
        fields={"step_ns": {_text("step", s): _integers(s, list(v)).tolist() for s, v in steps.items()}},
        arrays={
            "track_id": _integers("track_id", [one.track_id for one in found]),
            "count": np.array([len(one.stamp_ns) for one in found], dtype=np.int64),
            "stamp_ns": np.concatenate([np.zeros(0, dtype=np.int64), *(one.stamp_ns for one in found)]),
            "position_ego_m": np.concatenate([np.zeros((0, 3)), *(one.position_ego_m for one in found)]),
            "inlier": np.concatenate([np.zeros(0, dtype=bool), *(one.inlier for one in found)]).astype(
                np.uint8
            ),
        },
    )


def read_trajectories(frame: Frame) -> tuple[tuple[Trajectory, ...], Steps]:
    """Trajectories, and the nanoseconds of the steps. FrameError where they are malformed."""
    taken = Taken(frame)
    steps = taken.optional("step_ns", {})
    track_id = taken.array("track_id", "i64", ("n",)).tolist()
    starts = _starts(taken, "samples")
    stamp_ns = taken.array("stamp_ns", "i64", ("samples",))
    position = taken.array("position_ego_m", "f64", ("samples", 3))
    inlier = taken.array("inlier", "u8", ("samples",))
    taken.end()
    if inlier.max(initial=0) > 1:
        raise taken.error("'inlier' holds a byte that is neither 0 nor 1")
    tracks = tuple(
        Trajectory(
            track_id=track, stamp_ns=stamp_ns[a:b], position_ego_m=position[a:b], inlier=inlier[a:b] == 1
        )
        for track, a, b in zip(track_id, starts[:-1], starts[1:], strict=True)
    )
    return tracks, _steps(taken, steps)


def _steps(taken: Taken, steps: object) -> Steps:
    if not isinstance(steps, dict):
        raise taken.error("'step_ns' is no object")
    for values in steps.values():
        good = isinstance(values, list) and all(type(n) is int and 0 <= n < 2**63 for n in values)
        if not good:
            raise taken.error("'step_ns' holds what is no list of nanoseconds")
    return {name: tuple(values) for name, values in steps.items()}


def _starts(taken: Taken, what: str) -> list[int]:
    """Where each of n parts begins in the rows of `what`, and where the last ends."""
    count = taken.array("count", "i64", ("n",)).tolist()
    if any(n < 0 for n in count):
        raise taken.error("'count' holds a negative number")
    taken.counts[what] = sum(count)
    return [0, *accumulate(count)]


def _text(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise FrameError(f"{name} must be text, not {value!r}"[:200])
    return value


def _integers(name: str, values: Sequence[object]) -> np.ndarray:
    for value in values:
        if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer):
            raise FrameError(f"{name} must be an integer, not {value!r}"[:200])
        if abs(int(value)) >= 2**63:
            raise FrameError(f"{name} must be an integer of 64 bits")
    return np.array([int(value) for value in values], dtype=np.int64)  # type: ignore[call-overload]


def _floats(name: str, values: Sequence[object]) -> np.ndarray:
    for value in values:
        if not isinstance(value, int | float | np.integer | np.floating):
            raise FrameError(f"{name} must be a number, not {value!r}"[:200])
    return np.array(values, dtype=np.float64)


def _rows(rows: Sequence[np.ndarray], empty: tuple[int, ...], dtype: type) -> np.ndarray:
    return np.array(rows, dtype=dtype) if rows else np.zeros(empty, dtype=dtype)
