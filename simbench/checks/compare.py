"""Answers to a story against those to the same story told otherwise, object by object.

The objects of two runs are the same where scan, camera and track id are. Positions may differ by rounding:
`ROUNDING_M` is 64 roundings in single precision, all to the same side, at 100 m, where LiDAR points end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.messages import LocalizedObject, Trajectory
from simbench.checks.finding import NOTHING, Finding, said_nothing
from simbench.drive import Driven

ROUNDING_M = 64 * 2.0**-24 * 100.0  # 0.4 mm, a fiftieth of the range noise
Key = tuple[str, int, str, int]  # LiDAR, scan, camera, track id
Move = Callable[[Float64[np.ndarray, "n 3"]], Float64[np.ndarray, "n 3"]]
Origin = Mapping[tuple[str, int], Int64[np.ndarray, " n"]]


def as_it_is(xyz_m: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
    """No movement."""
    return xyz_m


@dataclass(frozen=True, kw_only=True)
class Off:
    """How far apart two objects, or two trajectories, are that should be the same."""

    distance_m: float
    where: str


def compare(plain: Driven, retold: Driven, *, move: Move = as_it_is, origin: Origin | None = None) -> Finding:
    """Whether the answers to the story told otherwise are those to the plain one, moved.

    move: positions of the plain answers to those that the others must have. origin: by scan (LiDAR, seq),
    which point of the plain scan each point is; None: the same. Objects that only one side has, other points,
    trajectories of other instants and distances beyond rounding are deviations.
    """
    if said_nothing((plain, retold)):
        return NOTHING
    a, b = _objects(plain), _objects(retold)
    common = [key for key in a if key in b]
    alone = [key for key in (*a, *b) if (key in a) != (key in b)]
    others = [key for key in common if not _same_points(key, a[key], b[key], origin)]
    broken, offs = _paths(plain, retold, move)
    offs += [_off(a[key], b[key], move, _place(key)) for key in common]
    beyond = sorted(off.distance_m for off in offs if not off.distance_m <= ROUNDING_M)
    worst = max(offs, key=lambda off: off.distance_m, default=None)
    words = []
    if alone:
        words.append(f"{len(alone)} objects in one run only, first {_place(alone[0])}")
    if others:
        words.append(f"{len(others)} of {len(common)} objects with other points, first {_place(others[0])}")
    if broken:
        words.append(f"{len(broken)} trajectories with other instants, first of track {broken[0]}")
    if beyond and worst is not None:
        half = f"half of them within {beyond[(len(beyond) - 1) // 2]:.2g} m, " if len(beyond) > 1 else ""
        words.append(f"{len(beyond)} places off, {half}the worst by {worst.distance_m:.2g} m: {worst.where}")
    if words:
        return Finding(verdict="does not hold", why="; ".join(words))
    far_mm = 0.0 if worst is None else 1e3 * worst.distance_m
    return Finding(verdict="holds", why=f"{len(common)} objects, the worst {far_mm:.2g} mm off")


def _objects(driven: Driven) -> dict[Key, LocalizedObject]:
    return {
        (output.scan_sensor, output.scan_seq, thing.sensor, thing.track_id): thing
        for output in driven.outputs
        for thing in output.objects
    }


def _off(a: LocalizedObject, b: LocalizedObject, move: Move, where: str) -> Off:
    return Off(distance_m=_apart_m(move(a.position_ego_m[None]), b.position_ego_m[None]), where=where)


def _apart_m(a: Float64[np.ndarray, "n 3"], b: Float64[np.ndarray, "n 3"]) -> float:
    """The largest distance row by row; infinite where it is no number."""
    far_m = float(np.linalg.norm(a - b, axis=1).max(initial=0.0))
    return far_m if np.isfinite(far_m) else np.inf


def _paths(plain: Driven, retold: Driven, move: Move) -> tuple[list[int], list[Off]]:
    """Tracks with a trajectory in one run only or with other instants; of the rest, the farthest of each."""
    a = {path.track_id: path for path in plain.trajectories}
    b = {path.track_id: path for path in retold.trajectories}
    broken, offs = [], []
    for track_id in sorted(a.keys() | b.keys()):
        one, other = a.get(track_id), b.get(track_id)
        if one is None or other is None or not _same_instants(one, other):
            broken.append(track_id)
            continue
        far_m = _apart_m(move(one.position_ego_m), other.position_ego_m)
        offs.append(Off(distance_m=far_m, where=f"the trajectory of track {track_id}"))
    return broken, offs


def _same_instants(a: Trajectory, b: Trajectory) -> bool:
    """Since the first one: when a story begins does not matter."""
    return np.array_equal(a.stamp_ns - a.stamp_ns[:1], b.stamp_ns - b.stamp_ns[:1])


def _same_points(key: Key, a: LocalizedObject, b: LocalizedObject, origin: Origin | None) -> bool:
    points = b.points if origin is None else origin[key[:2]][b.points]
    return np.array_equal(np.sort(a.points), np.sort(points))


def _place(key: Key) -> str:
    _, seq, camera, track_id = key
    return f"track {track_id} in {camera}, scan {seq}"
