"""motion.knock_deg and calibration.drift_deg: a bracket that does not stay where it was calibrated.

Knock: angle_deg (1 - cos(pi u)) / 2 about an ego axis, u from 0 at at_s to 1 after rise_ms. Drift: angle_deg
t / T and shift_cm t / T, T the length of the run.
Receipts: attitude and place of the sensor (a camera by PnP, the LiDAR by plates) less what the body was drawn
to do, fitted with a straight line and (knock) a step at the instant that was asked for: the height of the
step, or the slope times T.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from scenarios.faults import Drift, Knock
from simbench.faults.estimate import PoseEvidence, lever_shift_m, others_of
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.mount import BracketMotion, Ramp
from simbench.shake import BodyShake

TURNS, SHIFTS = ("roll", "pitch", "yaw"), ("x", "y", "z")
TURN_NOTE = "attitude by {} less the drawn shake, over time"
SHIFT_NOTE = "place by {} less the script and the drawn shake, over time"
SD_DEG, SD_CM = 2e-4, 2e-3  # PnP or plates, and turns about several axes that do not commute
FEWEST = 4  # frames on either side


def knocked(spec: Knock) -> Ramp:
    """The bracket's motion."""
    begin_ns = round(spec.at_s * 1e9)
    return Ramp(
        begin_ns=begin_ns, end_ns=begin_ns + round(spec.rise_ms * 1e6), smooth=True,
        end=np.array([np.deg2rad(spec.angle_deg) if a == spec.axis else 0.0 for a in TURNS] + [0.0] * 3),
    )  # fmt: skip


def drifting(spec: Drift, duration_s: float) -> Ramp:
    """The bracket's motion."""
    turn = [np.deg2rad(spec.angle_deg) if a == spec.axis else 0.0 for a in TURNS]
    shift = [0.01 * spec.shift_cm if a == spec.along else 0.0 for a in SHIFTS]
    return Ramp(begin_ns=0, end_ns=round(duration_s * 1e9), smooth=False, end=np.array(turn + shift))


def knock_receipts(
    spec: Knock, cameras: Sequence[str], drawn: Mapping[str, Ramp], evidence: Sequence[PoseEvidence],
    body: BodyShake | None, rest: Mapping[str, Sequence[BracketMotion]], duration_s: float,
) -> tuple[Receipt, ...]:  # fmt: skip
    """Per struck sensor: the step of its attitude. `rest`: what else moves the brackets."""
    result: list[Receipt] = []
    others: list[tuple[float, float]] = []
    column = TURNS.index(spec.axis)
    for item in evidence:
        t_s = item.taken_ns * 1e-9
        after = t_s >= spec.at_s + 1e-3 * spec.rise_ms
        clear = after | (t_s < spec.at_s)
        turn_deg = np.rad2deg(_left_rad(item, body, rest.get(item.sensor, ()))[:, column])
        found, sd, note = None, SD_DEG, TURN_NOTE.format(item.by)
        if min(after.sum(), (clear & ~after).sum()) >= FEWEST:
            found, sd = _fitted(turn_deg[clear], t_s[clear], after[clear].astype(np.float64))
        else:
            note = f"fewer than {FEWEST} frames before or after the knock"
        if item.sensor not in cameras:
            if found is not None:  # what was not measured is not said to be untouched
                others.append((found, SD_DEG + sd))
            continue
        ramp = drawn.get(item.sensor)
        happens = spec.at_s < duration_s
        result.append(
            judge(
                fault=spec.name, quantity=f"{item.sensor} {spec.axis}", unit="deg",
                requested=spec.angle_deg if happens else 0.0,
                realised=float(np.rad2deg(ramp.end[column])) if ramp is not None and happens else 0.0,
                measured=found, systematic=5.0 * (SD_DEG + sd), allowed=0.01 * abs(spec.angle_deg), note=note,
            )
        )  # fmt: skip
    called, by = others_of(evidence, cameras)
    return (
        *result,
        *untouched(
            fault=spec.name,
            quantity=f"step of the other {called}",
            unit="deg",
            found=others,
            note=TURN_NOTE.format(by),
        ),
    )


def drift_receipts(
    spec: Drift, cameras: Sequence[str], drawn: Mapping[str, Ramp], evidence: Sequence[PoseEvidence],
    body: BodyShake | None, rest: Mapping[str, Sequence[BracketMotion]], duration_s: float,
) -> tuple[Receipt, ...]:  # fmt: skip
    """Per struck sensor: how far it turned, and where one was asked for, moved, by the end of the run."""
    result: list[Receipt] = []
    others: list[tuple[float, float]] = []
    turn, shift = TURNS.index(spec.axis), SHIFTS.index(spec.along)
    for item in evidence:
        share = item.taken_ns / (duration_s * 1e9)
        turn_deg = np.rad2deg(_left_rad(item, body, rest.get(item.sensor, ()))[:, turn])
        found_deg, sd_deg = _fitted(turn_deg, share)
        if item.sensor not in cameras:
            others.append((found_deg, SD_DEG + sd_deg))
            continue
        ramp = drawn.get(item.sensor)
        end = np.zeros(6) if ramp is None else ramp.end
        if spec.angle_deg or end[turn]:
            result.append(
                judge(
                    fault=spec.name, quantity=f"{item.sensor} {spec.axis}", unit="deg",
                    requested=spec.angle_deg, realised=float(np.rad2deg(end[turn])), measured=found_deg,
                    systematic=5.0 * (SD_DEG + sd_deg), allowed=0.01 * abs(spec.angle_deg),
                    note=TURN_NOTE.format(item.by),
                )
            )  # fmt: skip
        if spec.shift_cm or end[3 + shift]:
            moved_m = settled(item, rest.get(item.sensor, ()))[1] - _carried_m(item, body)
            found_cm, sd_cm = _fitted(100.0 * moved_m[:, shift], share)
            result.append(
                judge(
                    fault=spec.name, quantity=f"{item.sensor} {spec.along}", unit="cm",
                    requested=spec.shift_cm, realised=100.0 * float(end[3 + shift]), measured=found_cm,
                    systematic=5.0 * (SD_CM + sd_cm), allowed=0.01 * abs(spec.shift_cm),
                    note=SHIFT_NOTE.format(item.by),
                )
            )  # fmt: skip
    called, by = others_of(evidence, cameras)
    return (
        *result,
        *untouched(
            fault=spec.name,
            quantity=f"drift of the other {called}",
            unit="deg",
            found=others,
            note=TURN_NOTE.format(by),
        ),
    )


def settled(
    item: PoseEvidence, rest: Sequence[BracketMotion]
) -> tuple[Float64[np.ndarray, "f 3"], Float64[np.ndarray, "f 3"]]:
    """Turn and shift of a sensor less those of some drawn motions of its bracket."""
    turn, shift = item.turn_rad, item.shift_m
    for motion in rest:
        moved = motion.at(item.taken_ns)
        turn = turn - moved[:, :3]
        if moved.shape[1] > 3:
            shift = shift - moved[:, 3:]
    return turn, shift


def _left_rad(
    item: PoseEvidence, body: BodyShake | None, rest: Sequence[BracketMotion]
) -> Float64[np.ndarray, "f 3"]:
    turn, _ = settled(item, rest)
    return turn if body is None else turn - body.at(item.taken_ns)[:, :3]


def _carried_m(item: PoseEvidence, body: BodyShake | None) -> Float64[np.ndarray, "f 3"]:
    """How the turning body moves the sensor. A turn of its bracket, which is about itself, does not."""
    if body is None:
        return np.zeros_like(item.shift_m)
    return lever_shift_m(replace(item, turn_rad=body.at(item.taken_ns)[:, :3]))


def _fitted(
    value: Float64[np.ndarray, " f"],
    t: Float64[np.ndarray, " f"],
    step: Float64[np.ndarray, " f"] | None = None,
) -> tuple[float, float]:
    """The height of a step in a straight line, or the slope of the line over t = 1; and its SD."""
    columns = [np.ones_like(t), t] if step is None else [np.ones_like(t), t, step]
    design = np.stack(columns, axis=1)
    if len(t) <= design.shape[1]:
        return 0.0, float("inf")
    coefficient, *_ = np.linalg.lstsq(design, value, rcond=None)
    left = value - design @ coefficient
    variance = float(left @ left) / (len(t) - design.shape[1])
    spread = np.linalg.pinv(design.T @ design)[-1, -1]
    return float(coefficient[-1]), float(np.sqrt(variance * spread))
