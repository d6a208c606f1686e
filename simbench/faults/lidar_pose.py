"""Where the LiDAR really was: plates that are known, and the points that its beams left on them.

Each point x = p(t) + R(t) (exp(w) q + s) of a surveyed field lies on its plate: n (x - c) = 0. R, p: the ego
and the LiDAR's place by script at the point's own firing; q: the point by the rest calibration, in ego axes
about the LiDAR; c, n: the plate. Turn w and shift s of one firing are fitted by Gauss-Newton; where the beams
of a column fire one after the other, with their rates, over some columns. Nothing of this is shared with what
moves a bracket.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float64, Int64

from fusion.geometry import rotation_exp, rotation_log
from fusion.messages import LidarScan
from scenarios.scenario import LidarSensor
from simbench.motion import Motion
from simbench.sensors import lidar
from simbench.sensors.survey import Field, field, in_field
from simbench.truth import ScanTruth

INSTANTS = 4  # of a sweep
TOGETHER_NS = 120_000  # of a LiDAR whose columns are no instants: those that begin so near the middle one
ROUNDS = 20
CONVERGED = 1e-12
MANY = 600  # points all around that are enough to begin with
START = (np.eye(3), np.zeros(3))
EDGE_M = 0.01  # a point that far off its plate in the end lies on a plate's edge
AGREE_M = 1e-3  # RMS that points stay off their plates where the pose is the true one
SPARE = 2  # points more than what is sought


@dataclass(frozen=True, kw_only=True, eq=False)
class Turned:
    """At some true instants: turn (rotation vector) and shift against script and rest, in ego axes."""

    taken_ns: Int64[np.ndarray, " f"]
    turn_rad: Float64[np.ndarray, "f 3"]
    shift_m: Float64[np.ndarray, "f 3"]


Pose = tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3"]]
"""Turn and shift against script and rest, in ego axes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """Points as the rest calibration puts them about the LiDAR, their plates and when they were fired; all by
    script in the ego's axes of that instant."""

    q: Float64[np.ndarray, "n 3"]
    c: Float64[np.ndarray, "n 3"]
    n: Float64[np.ndarray, "n 3"]
    fired_ns: Int64[np.ndarray, " n"]

    def of(self, which: np.ndarray) -> Seen:
        """Some of them."""
        return Seen(q=self.q[which], c=self.c[which], n=self.n[which], fired_ns=self.fired_ns[which])


def turned(name: str, sensor: LidarSensor, real: Motion, script: Motion, count: int) -> Turned:
    """By some firings of each of the first `count` sweeps. real: the motion that the sweeps were made in."""
    table, period_ns = lidar.beam_table(sensor), lidar.period_ns(sensor)
    middles = table.column_offset_ns[((2 * np.arange(INSTANTS) + 1) * sensor.columns) // (2 * INSTANTS)]
    apart_ns = 0 if len(table.slots) == 1 else TOGETHER_NS
    found = []
    for seq in range(count):
        start_ns = seq * period_ns
        _, (place_m,) = script.sensor(name, np.array([start_ns + period_ns // 2], dtype=np.int64))
        plates = field(place_m)
        scan, truth = lidar.sweep(name, sensor, in_field(real, plates), start_ns, seq, None)
        column = np.searchsorted(table.column_offset_ns, scan.offset_ns, side="right") - 1
        begun_ns, seen = table.column_offset_ns[column], partial(_seen, name, script, scan, truth, plates)

        # All around first: a few plates alone may fit a pose that is far from the true one, too.
        about = _solved(seen(np.arange(0, len(column), max(len(column) // MANY, 1))), None, START)[0]
        for middle_ns in middles:
            firing = seen(np.flatnonzero(np.abs(begun_ns - middle_ns) <= apart_ns))
            fit = _fit(firing, about)
            if fit is not None:
                found.append((round(float(firing.fired_ns.mean())), rotation_log(fit[0]), fit[1]))
    return Turned(
        taken_ns=np.array([t for t, _, _ in found], dtype=np.int64),
        turn_rad=np.array([w for _, w, _ in found]).reshape(-1, 3),
        shift_m=np.array([s for _, _, s in found]).reshape(-1, 3),
    )


def _seen(
    name: str,
    script: Motion,
    scan: LidarScan,
    truth: ScanTruth,
    plates: Field,
    which: Int64[np.ndarray, " n"],
) -> Seen:
    fired_ns, plate = truth.fire_ns[which], truth.part_id[which]
    R_ego, _ = script.ego(fired_ns)
    R_lidar, at_m = script.sensor(name, fired_ns)
    return Seen(
        q=np.einsum("nji,njk,nk->ni", R_ego, R_lidar, scan.xyz_m[which].astype(np.float64)),
        c=np.einsum("nji,nj->ni", R_ego, plates.centre_m[plate] - at_m),
        n=np.einsum("nji,nj->ni", R_ego, plates.normal[plate]),
        fired_ns=fired_ns,
    )


def _fit(firing: Seen, about: Pose) -> Pose | None:
    """From a pose that is near; None where there are too few points, or they do not agree."""
    since = firing.fired_ns - firing.fired_ns.mean() if len(firing.q) else np.zeros(0)
    late = since / np.abs(since).max() if np.any(since) else None
    sought = 6 if late is None else 12
    on = np.full(len(since), True)
    for _ in range(2):  # with all points, and without those on edges
        if on.sum() < sought + SPARE:
            return None
        about, left_m = _solved(firing.of(on), None if late is None else late[on], about)
        on[on] = np.abs(left_m) < EDGE_M
    return about if np.sqrt(np.mean(left_m**2)) < AGREE_M else None


def _solved(
    seen: Seen, late: Float64[np.ndarray, " n"] | None, about: Pose
) -> tuple[Pose, Float64[np.ndarray, " n"]]:
    """The pose that brings the points onto their plates, at the middle instant where they are more or less
    `late` (-1..1), and how far off the plates they stay. Begins at `about`."""
    (rotation, shift), turning, moving = about, np.zeros(3), np.zeros(3)
    when = np.zeros((len(seen.q), 1)) if late is None else late[:, None]
    left = np.zeros(len(seen.q))
    for _ in range(ROUNDS):
        arm = seen.q @ rotation.T
        arm = arm + when * np.cross(turning, arm)
        left = np.einsum("ni,ni->n", seen.n, arm + shift + when * moving - seen.c)
        design = np.concatenate([np.cross(arm, seen.n), seen.n], axis=1)
        if late is not None:
            design = np.concatenate([design, when * design], axis=1)
        step = np.zeros(12)
        step[: design.shape[1]] = np.linalg.lstsq(design, -left, rcond=None)[0]
        rotation, shift = rotation_exp(step[:3]) @ rotation, shift + step[3:6]
        turning, moving = turning + step[6:9], moving + step[9:]
        if np.abs(step).max() < CONVERGED:
            break
    return (rotation, shift), left
