"""Results that are positions only: where something was said to be, without points and without 2-D boxes.

Nothing says which object such a position means, so the truth says it: a track is the object that most of its
positions are nearest to, not farther than `GATE_M`; a track of which most are near nothing is false. Errors
beyond the gate and swapped names thus show as false objects and missing coverage, not as metres. Where no
points are told there is no mapping to score.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fusion.messages import Detections, FusionOutput, LidarScan, LocalizedObject, Trajectory
from scenarios.errors import BadInput
from simbench.recording import Recording
from simbench.score.contract import ContractError, check_trajectories
from simbench.score.metrics import BUDGET, MAPPING
from simbench.score.objects import score_objects
from simbench.score.score import Scores

GATE_M = 2.0
KEPT = "false_objects_per_frame"
WHY = "the results are positions: no point was given to anything"


@dataclass(frozen=True, kw_only=True)
class Position:
    """One position in the ego frame [m]. where: its line or message, for words. track: a name that stays the
    same along a drive; None: nothing is known. stamp_ns: the instant that it describes."""

    where: str
    stamp_ns: int
    position_ego_m: tuple[float, float, float]
    track: str | None
    category: str
    confidence: float


def score_positions(recording: Recording, positions: Sequence[Position], file: str) -> Scores:
    """Scores of positions; mapping and error budget are null. BadInput: one lies in no sweep, or two of a
    track in one."""
    tracks = _tracks(recording, positions)
    outputs = _outputs(recording, positions, tracks, file)  # every position lies in a sweep
    objects = _objects(recording, positions)
    known = {number: _object(objects[rows]) for number, rows in tracks.items()}
    try:
        trajectories = _trajectories(positions, tracks)
        check_trajectories(trajectories)
        scores = score_objects(recording, outputs, trajectories, known_tracks=known)
    except ContractError as error:
        raise BadInput(str(error).rstrip("."), file=file) from error
    without = {metric.name for metric in (*MAPPING, *BUDGET)} - {KEPT}
    rows = tuple(
        replace(row, value=None, sd=None, n=0, why=WHY) if row.metric in without else row
        for row in scores.rows
    )
    return replace(scores, rows=rows, pairs=(), budget=None)


def _tracks(recording: Recording, positions: Sequence[Position]) -> dict[int, np.ndarray]:
    """Rows [k] by track: numbers below those of all detections; a position without a track is one itself."""
    used = {box.track_id for m in recording.messages if isinstance(m, Detections) for box in m.boxes}
    rows: dict[tuple[str, int], list[int]] = {}
    for row, position in enumerate(positions):
        key = ("", row) if position.track is None else (position.track, -1)
        rows.setdefault(key, []).append(row)
    first = min(used | {0}) - 1
    return {first - number: np.array(found) for number, found in enumerate(rows.values())}


def _objects(recording: Recording, positions: Sequence[Position]) -> np.ndarray:
    """The nearest object within the gate at each position's instant [n], -1: none."""
    if not positions:
        return np.empty(0, dtype=np.int64)
    t_ns = np.array([p.stamp_ns for p in positions], dtype=np.int64)
    said = np.array([p.position_ego_m for p in positions])
    truth = recording.truth
    ids = np.array([info.object_id for info in truth.objects], dtype=np.int64)
    away = np.stack([np.linalg.norm((said - truth.box_in_ego(int(i), t_ns)[1])[:, :2], axis=1) for i in ids])
    nearest = away.argmin(axis=0)
    return np.where(away[nearest, np.arange(len(t_ns))] <= GATE_M, ids[nearest], -1)


def _object(of_rows: np.ndarray) -> int:
    return int(Counter(of_rows.tolist()).most_common(1)[0][0])


def _outputs(
    recording: Recording, positions: Sequence[Position], tracks: Mapping[int, np.ndarray], file: str
) -> tuple[FusionOutput, ...]:
    scans = sorted((m for m in recording.messages if isinstance(m, LidarScan)), key=lambda m: m.stamp_ns)
    stamps = np.array([scan.stamp_ns for scan in scans], dtype=np.int64)
    camera = next(iter(recording.calibration.cameras), "")
    found: dict[tuple[str, int], list[LocalizedObject]] = {}
    for number, rows in tracks.items():
        for row in rows:
            one = positions[row]
            at = int(np.searchsorted(stamps, one.stamp_ns, side="right")) - 1
            if at < 0 or one.stamp_ns > stamps[at] + recording.truth.period_ns:
                raise BadInput(f"{one.where}: its stamp {one.stamp_ns} ns lies in no sweep", file=file)
            position = np.array(one.position_ego_m)
            origin = recording.calibration.T_ego_sensor[scans[at].sensor].translation_m
            here = found.setdefault((scans[at].sensor, scans[at].seq), [])
            if here and here[-1].track_id == number:  # those of a track come one after the other
                raise BadInput(f"{one.where}: track {one.track!r} has two positions in one sweep", file=file)
            here.append(
                LocalizedObject(
                    track_id=number, category=one.category, sensor=camera, stamp_ns=one.stamp_ns,
                    points=np.empty(0, dtype=np.int64), position_ego_m=position,
                    distance_m=float(np.hypot(*(position - origin)[:2])),
                    azimuth_rad=float(np.arctan2(*(position - origin)[1::-1])), confidence=one.confidence,
                )
            )  # fmt: skip
    return tuple(
        FusionOutput(scan_sensor=sensor, scan_seq=seq, objects=tuple(objects))
        for (sensor, seq), objects in found.items()
    )


def _trajectories(positions: Sequence[Position], tracks: Mapping[int, np.ndarray]) -> tuple[Trajectory, ...]:
    """Of every named track, its positions in order of their stamps."""
    found = []
    for number, rows in tracks.items():
        if positions[rows[0]].track is None:
            continue
        ordered = sorted((positions[row] for row in rows), key=lambda p: p.stamp_ns)
        found.append(
            Trajectory(
                track_id=number, stamp_ns=np.array([p.stamp_ns for p in ordered], dtype=np.int64),
                position_ego_m=np.array([p.position_ego_m for p in ordered]),
                inlier=np.ones(len(ordered), dtype=bool),
            )
        )  # fmt: skip
    return tuple(found)
