"""What a pipeline's answer must be like before it is scored (see `fusion/pipeline.py`).

A breach raises `ContractError` with one sentence. The drive loop calls this for every answer; it sees no
truth.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from fusion.messages import FusionOutput, LidarScan, LocalizedObject, Trajectory

ScanKey = tuple[str, int]


class ContractError(ValueError):
    """The pipeline broke its contract; the message is one sentence."""


def check_output(
    scan: LidarScan,
    output: object,
    *,
    period_ns: int | None = None,
    answered: Collection[ScanKey] = (),
) -> None:
    """Raise `ContractError` unless `output` is a valid answer to `scan`.

    period_ns: the sweep is [stamp, stamp + period]; None: it ends with the last firing that returned a point.
    answered: (sensor, seq) of the scans that have an answer already; a second one is an error.
    """
    if not isinstance(output, FusionOutput):
        raise ContractError(f"update must return a FusionOutput or None, not {type(output).__name__}.")
    key = (output.scan_sensor, output.scan_seq)
    if key != (scan.sensor, scan.seq):
        raise ContractError(f"The output names scan {key}, but it was checked as {(scan.sensor, scan.seq)}.")
    if key in answered:
        raise ContractError(f"Scan {key} got a second output; at most one per scan is allowed.")
    last_ns = int(scan.offset_ns.max()) if len(scan.offset_ns) else 0
    end_ns = scan.stamp_ns + max(last_ns, period_ns or 0)
    tracks: set[tuple[str, int]] = set()
    for found in output.objects:
        if not isinstance(found, LocalizedObject):
            raise ContractError(f"Scan {key}: objects must be LocalizedObject, not {type(found).__name__}.")
        where = f"Scan {key}, track {found.track_id!r} of {found.sensor!r}"
        _check_object(found, where, len(scan.xyz_m), scan.stamp_ns, end_ns)
        if (found.sensor, found.track_id) in tracks:
            raise ContractError(f"{where}: a camera's track may stand only once in an output.")
        tracks.add((found.sensor, found.track_id))


def _check_object(found: LocalizedObject, where: str, n_points: int, start_ns: int, end_ns: int) -> None:
    for name in ("track_id", "stamp_ns"):
        value = getattr(found, name)
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
            raise ContractError(f"{where}: {name} must be an integer, not {value!r}.")
    if not start_ns <= found.stamp_ns <= end_ns:
        raise ContractError(
            f"{where}: stamp {found.stamp_ns} ns lies outside its sweep [{start_ns}, {end_ns}] ns."
        )
    if found.position_ego_m.shape != (3,):
        raise ContractError(f"{where}: position_ego_m has shape {found.position_ego_m.shape}, not (3,).")
    numbers = (*found.position_ego_m, found.distance_m, found.azimuth_rad, found.confidence)
    if not np.isfinite(np.asarray(numbers, dtype=np.float64)).all():
        raise ContractError(f"{where}: position, distance, azimuth or confidence is not finite.")
    points = found.points
    if points.ndim != 1:
        raise ContractError(f"{where}: points has shape {points.shape}, not (k,).")
    if len(points) == 0:
        return
    if points.min() < 0 or points.max() >= n_points:
        raise ContractError(f"{where}: points must be indices in 0..{n_points - 1} of its scan.")
    if len(np.unique(points)) != len(points):
        raise ContractError(f"{where}: points holds an index twice.")


def check_trajectories(trajectories: Sequence[object]) -> None:
    """Raise `ContractError` unless track ids differ, stamps ascend, shapes agree and all numbers are
    finite.
    """
    tracks: set[int] = set()
    for track in trajectories:
        if not isinstance(track, Trajectory):
            raise ContractError(f"trajectories must return Trajectory, not {type(track).__name__}.")
        where = f"Trajectory {track.track_id!r}"
        if track.track_id in tracks:
            raise ContractError(f"{where}: a track may have only one trajectory.")
        tracks.add(track.track_id)
        n = len(track.stamp_ns)
        shapes = (track.stamp_ns.shape, track.position_ego_m.shape, track.inlier.shape)
        if shapes != ((n,), (n, 3), (n,)):
            raise ContractError(f"{where}: stamps, positions and inliers have shapes {shapes}.")
        if not np.isfinite(track.position_ego_m).all():
            raise ContractError(f"{where}: a position is not finite.")
        if (np.diff(track.stamp_ns) < 0).any():
            raise ContractError(f"{where}: stamps must ascend.")


__all__ = ["ContractError", "check_output", "check_trajectories"]
