"""Where the LiDAR really was: plates that are known, and the points that its beams left on them.

Each point x = p(t) + R(t) (exp(w) q + s) of a surveyed field lies on its plate: n (x - c) = 0. R, p: the ego
and the LiDAR's place by script at the point's own firing; q: the point by the rest calibration, in ego axes
about the LiDAR; c, n: the plate. Turn w and shift s of one firing are fitted by Gauss-Newton; where the beams
of a column fire one after the other, with their rates, over some columns. Nothing of this is shared with what
moves a bracket.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.geometry import rotation_exp, rotation_log
from scenarios.scenario import LidarSensor
from simbench.motion import Motion
from simbench.sensors import lidar
from simbench.sensors.survey import field, in_field

INSTANTS = 4  # of a sweep
TOGETHER_NS = 120_000  # of a LiDAR whose columns are no instants: those that begin so near the middle one
ROUNDS = 20
CONVERGED = 1e-12
EDGE_M = 0.01  # a point that far off its plate in the end lies on a plate's edge
SPARE = 2  # points more than what is sought


@dataclass(frozen=True, kw_only=True, eq=False)
class Turned:
    """At some true instants: turn (rotation vector) and shift against script and rest, in ego axes."""

    taken_ns: Int64[np.ndarray, " f"]
    turn_rad: Float64[np.ndarray, "f 3"]
    shift_m: Float64[np.ndarray, "f 3"]


def turned(name: str, sensor: LidarSensor, real: Motion, script: Motion, count: int) -> Turned:
    """By some firings of each of the first `count` sweeps. real: the motion that the sweeps were made in."""
    table, period_ns = lidar.beam_table(sensor), lidar.period_ns(sensor)
    middles = table.column_offset_ns[((2 * np.arange(INSTANTS) + 1) * sensor.columns) // (2 * INSTANTS)]
    at_once = table.slots.shape[0] == 1
    found = []
    for seq in range(count):
        start_ns = seq * period_ns
        _, (place_m,) = script.sensor(name, np.array([start_ns + period_ns // 2], dtype=np.int64))
        plates = field(place_m)
        scan, truth = lidar.sweep(name, sensor, in_field(real, plates), start_ns, seq, None)
        column = np.searchsorted(table.column_offset_ns, scan.offset_ns, side="right") - 1
        begun_ns = table.column_offset_ns[column]
        for middle_ns in middles:
            near = np.flatnonzero(np.abs(begun_ns - middle_ns) <= (0 if at_once else TOGETHER_NS))
            plate, fired_ns = truth.part_id[near], truth.fire_ns[near]
            fit = _fit(
                scan.xyz_m[near].astype(np.float64), fired_ns, plates.centre_m[plate], plates.normal[plate],
                name, script,
            )  # fmt: skip
            if fit is not None:
                found.append((round(float(fired_ns.mean())), *fit))
    return Turned(
        taken_ns=np.array([t for t, _, _ in found], dtype=np.int64),
        turn_rad=np.array([w for _, w, _ in found]).reshape(-1, 3),
        shift_m=np.array([s for _, _, s in found]).reshape(-1, 3),
    )


def _fit(
    xyz_m: Float64[np.ndarray, "n 3"], fired_ns: Int64[np.ndarray, " n"],
    centre_m: Float64[np.ndarray, "n 3"], normal: Float64[np.ndarray, "n 3"], name: str, script: Motion,
) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]] | None:  # fmt: skip
    """Turn and shift; None where there are too few points, or they do not agree."""
    R_ego, _ = script.ego(fired_ns)
    R_lidar, at_m = script.sensor(name, fired_ns)
    q = np.einsum("nji,njk,nk->ni", R_ego, R_lidar, xyz_m)
    c = np.einsum("nji,nj->ni", R_ego, centre_m - at_m)
    n = np.einsum("nji,nj->ni", R_ego, normal)
    on = np.full(len(q), True)
    since = fired_ns - fired_ns.mean() if len(fired_ns) else fired_ns
    late = since / max(float(np.abs(since).max()), 1.0) if np.ptp(fired_ns) > 0 else None
    on = np.full(len(q), True)
    for _ in range(2):  # with all points, and without those on edges
        if on.sum() < SPARE + (6 if late is None else 12):
            return None
        rotation, shift, left_m = _solved(q[on], c[on], n[on], None if late is None else late[on])
        on[on] = np.abs(left_m) < EDGE_M
    return rotation_log(rotation), shift


def _solved(
    q: Float64[np.ndarray, "n 3"], c: Float64[np.ndarray, "n 3"], n: Float64[np.ndarray, "n 3"],
    late: Float64[np.ndarray, " n"] | None,
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3"], Float64[np.ndarray, " n"]]:  # fmt: skip
    """Rotation and shift that bring q onto the planes (c, n), at the middle instant where the points are more
    or less `late` (-1..1); and how far off the planes the points stay."""
    rotation, found = (
        np.eye(3),
        np.zeros(12),
    )  # of found: 3:6 shift, 6:9 and 9:12 what turn and shift add when late
    when = np.zeros(len(q)) if late is None else late
    for _ in range(ROUNDS):
        moved = q @ rotation.T + when[:, None] * np.cross(found[6:9], q @ rotation.T)
        left = np.einsum("ni,ni->n", n, moved + found[3:6] + when[:, None] * found[9:] - c)
        design = np.concatenate([np.cross(moved, n), n], axis=1)
        if late is not None:
            design = np.concatenate([design, when[:, None] * design], axis=1)
        step = np.zeros(12)
        step[: design.shape[1]] = np.linalg.lstsq(design, -left, rcond=None)[0]
        rotation, found = rotation_exp(step[:3]) @ rotation, found + step
        if np.abs(step).max() < CONVERGED:
            break
    return rotation, found[3:6], left
