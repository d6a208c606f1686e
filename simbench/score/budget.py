"""The signed error budget of the raw positions against the paper's held GNSS reference, per axis of the ego
frame.

With s the position's stamp, f the true firing time of the representative q (the median-rule point of the
target's true points in that pair), C the true centre, G the held fix (made at time g), T_told what the fusion
is told:

    position(s) - G = surface_to_centre   T_ego_world(f) T_world_lidar(f) q_true - C(f)
                    + reference_lag       C(s) - C(g)
                    + lever_arm           - lever part of G
                    + heading             - heading part of G
                    + reference_noise     - noise part of G
                    + sensor_attitude     (T_told - T_ego_world(f) T_world_lidar(f)) q_true
                    + wrong_cluster       position(s) - T_told q_measured
                    + rest                T_told (q_measured - q_true) + C(f) - C(s)

so that the parts add up exactly. `wrong_cluster` holds all that the pipeline chose otherwise than "the median
of the right points": wrong points, but also a push from surface to centre or a motion compensation. `rest` is
range noise and the motion between firing and stamp.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from fusion.geometry import readonly
from simbench.recording import Recording
from simbench.score.frames import Frame
from simbench.score.localization import FrameScore
from simbench.score.metrics import BUDGET_AXES, BUDGET_PARTS, Estimate, mean_of, null
from simbench.score.pairs import (
    EligiblePair,
    held_fix,
    held_position,
    lidar_to_world,
    median_point,
    poses_at,
    to_child,
)

PARTS = tuple(part for part in BUDGET_PARTS if part != "total")


@dataclass(frozen=True, kw_only=True, eq=False)
class Budget:
    """Signed parts and their sum, metres in the ego frame (x longitudinal, y lateral), one row per frame.

    `frames` holds the frame indices: eligible frames whose raw position comes from an eligible pair and has a
    fix.
    """

    frames: tuple[int, ...]
    parts_m: Mapping[str, Float64[np.ndarray, "n 3"]]
    total_m: Float64[np.ndarray, "n 3"]

    def mean_m(self, part: str) -> Float64[np.ndarray, " 3"]:
        """Mean over frames of a part, or of 'total'; NaN without frames."""
        rows = self.total_m if part == "total" else self.parts_m[part]
        return rows.mean(axis=0) if len(rows) else np.full(3, np.nan)


def budget_estimates(budget: Budget | None, has_target: bool) -> dict[str, Estimate]:
    """The means over frames as metrics, null with a reason where there is no budget."""
    result: dict[str, Estimate] = {}
    for column, axis in enumerate(BUDGET_AXES):
        for part in BUDGET_PARTS:
            if budget is None:
                estimate = null("no GNSS reference" if has_target else "the scenario has no target")
            else:
                rows = budget.total_m if part == "total" else budget.parts_m[part]
                estimate = mean_of(rows[:, column], of="frames with a position and a fix")
            result[f"budget_{axis}_m.{part}"] = estimate
    return result


def error_budget(
    recording: Recording,
    frames: Sequence[Frame],
    pairs: Sequence[EligiblePair],
    scores: Sequence[FrameScore],
) -> Budget | None:
    """The budget of the frames' raw positions; None without target or GNSS reference."""
    truth = recording.truth
    if truth.reference is None or truth.target_id is None:
        return None
    by_view = {(pair.frame, pair.camera): pair for pair in pairs}
    used: list[int] = []
    rows: list[dict[str, np.ndarray]] = []
    totals: list[np.ndarray] = []
    for score in scores:
        pair = by_view.get((score.frame, score.camera or ""))
        if score.raw is None or pair is None:
            continue
        stamp = np.array([score.raw.stamp_ns], dtype=np.int64)
        fix = int(held_fix(truth.reference, stamp)[0])
        if fix < 0:
            continue
        position = np.array(score.raw.position_ego_m)
        used.append(score.frame)
        rows.append(_parts(recording, frames[score.frame], pair, position, stamp, fix))
        totals.append(position - held_position(truth, fix, score.raw.stamp_ns)[0])
    return Budget(
        frames=tuple(used),
        parts_m={part: readonly(np.array([r[part] for r in rows]).reshape(-1, 3)) for part in PARTS},
        total_m=readonly(np.array(totals).reshape(-1, 3)),
    )


def _parts(
    recording: Recording,
    frame: Frame,
    pair: EligiblePair,
    position: Float64[np.ndarray, " 3"],
    stamp_ns: np.ndarray,
    fix: int,
) -> dict[str, np.ndarray]:
    truth = recording.truth
    reference = truth.reference
    assert reference is not None
    lidar = frame.scan.sensor
    at = median_point(pair.true_xyz_lidar_m)
    q_true = pair.true_xyz_lidar_m[at]
    q_measured = frame.scan.xyz_m[pair.points[at]].astype(np.float64)
    fire_ns = frame.truth.fire_ns[pair.points[[at]]]
    world = lidar_to_world(truth, lidar, fire_ns, q_true[None])
    q_ego = to_child(poses_at(truth.poses.ego, fire_ns), world)[0]
    told = recording.calibration.T_ego_sensor[lidar]
    centre_fire = truth.target_centre_ego_m(fire_ns)[0]
    centre_stamp = truth.target_centre_ego_m(stamp_ns)[0]
    return {
        "surface_to_centre": q_ego - centre_fire,
        "reference_lag": centre_stamp - held_position(truth, fix, int(stamp_ns[0]))[1],
        "lever_arm": -reference.lever_m[fix],
        "heading": -reference.heading_m[fix],
        "reference_noise": -reference.noise_m[fix],
        "sensor_attitude": told.apply(q_true) - q_ego,
        "wrong_cluster": position - told.apply(q_measured),
        "rest": told.rotation @ (q_measured - q_true) + centre_fire - centre_stamp,
    }
