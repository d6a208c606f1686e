"""calibration.rotation_deg: the fusion is told a rotated extrinsic; the world stays as it is.

T_told = T_before * R(axis, angle) in the axes of the viewing direction (x along it, y left, z up; those of
the LiDAR are its own), about the sensor's own origin. axis: roll, pitch, yaw, or random (uniform on the
sphere, one per sensor).
Receipt: the turn between what the fusion is told and the camera's mean attitude by PnP; of the LiDAR, between
what known points around it show before and after.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64

from fusion.geometry import Transform, rotation_exp, rotation_log
from fusion.messages import Calibration
from scenarios.faults import CalibrationRotation
from scenarios.seeding import stream
from simbench.axes import R_BODY_OPTICAL
from simbench.faults.estimate import PoseEvidence, bracket_turn_rad, detrended
from simbench.faults.known import told_pose
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import spared, struck
from simbench.faults.telling import CalibrationFault, Place, Telling, Told, Witness

KEY = CalibrationRotation.name
NOTE = "told extrinsic against the mean attitude by PnP"
NO_WITNESS = "known points of its frame, before and after"
EXACT_DEG = 0.002
AXES = {"roll": (1.0, 0.0, 0.0), "pitch": (0.0, 1.0, 0.0), "yaw": (0.0, 0.0, 1.0)}


def turned(spec: CalibrationRotation, told: Calibration, place: Place) -> Told:
    """The calibration with the struck sensors turned."""
    poses, realised = dict(told.T_ego_sensor), dict[str, float]()
    for sensor in struck(spec, place):
        if spec.axis == "random":
            axis = stream(place.seed, "fault", KEY, sensor).standard_normal(3)
            axis = axis / np.linalg.norm(axis)
        else:
            axis = np.array(AXES[spec.axis])
        before, R_view_sensor = told.T_ego_sensor[sensor], _view(sensor, told)
        view = before.rotation @ R_view_sensor.T
        poses[sensor] = Transform(
            rotation=view @ rotation_exp(np.deg2rad(spec.angle_deg) * axis) @ R_view_sensor,
            translation_m=before.translation_m,
        )
        for name, share in zip(AXES, axis, strict=True):
            realised[f"{sensor} {name}"] = spec.angle_deg * float(share)
    return Told(calibration=Calibration(T_ego_sensor=poses, cameras=told.cameras), realised=realised)


def _view(sensor: str, told: Calibration) -> Float64[np.ndarray, "3 3"]:
    """From the sensor's axes to those of its view."""
    return R_BODY_OPTICAL if sensor in told.cameras else np.eye(3)


def _wrapped_deg(angle_deg: float) -> float:
    """The same direction within -180 (included) to 180 degrees."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def receipts(spec: CalibrationRotation, step: Telling, witness: Witness) -> tuple[Receipt, ...]:
    """Per struck sensor: the turn of what the fusion is told, about the drawn axis and signed. Where the
    fault names sensors: that the others are told what was told before.
    """
    seen = {item.sensor: item for item in witness.evidence}
    result: list[Receipt] = []
    others: list[tuple[float, float]] = []
    for sensor in (*witness.place.cameras, witness.place.lidar_name):
        drawn_deg = np.array([step.realised.get(f"{sensor} {name}", 0.0) for name in AXES])
        if sensor in spared(spec, witness.place):
            turn_deg, sd_deg = _excess_deg(sensor, np.zeros(3), step, seen, witness)
            others.append((float(np.linalg.norm(turn_deg)), sd_deg))
        if sensor not in struck(spec, witness.place):
            continue
        excess_deg, sd_deg = _excess_deg(sensor, drawn_deg, step, seen, witness)
        size_deg = float(np.linalg.norm(drawn_deg))
        if spec.axis != "random":
            axis = np.array(AXES[spec.axis])
        elif size_deg > 0.0:
            axis = drawn_deg / size_deg
        else:
            axis = np.zeros(3)
        requested_deg = abs(spec.angle_deg) if spec.axis == "random" else spec.angle_deg
        realised_deg = requested_deg + _wrapped_deg(float(drawn_deg @ axis) - requested_deg)
        result.append(
            judge(
                fault=KEY,
                quantity=f"{sensor} {spec.axis}",
                unit="deg",
                requested=requested_deg,
                realised=realised_deg,
                measured=realised_deg + float(excess_deg @ axis),
                systematic=5.0 * sd_deg,
                allowed=max(0.01 * abs(spec.angle_deg), 0.05),
                note=NOTE if sensor in seen else NO_WITNESS,
            )
        )
    result += untouched(fault=KEY, quantity="turn of the other cameras", unit="deg", found=others, note=NOTE)
    return tuple(result)


def _excess_deg(
    sensor: str,
    drawn_deg: Float64[np.ndarray, "3"],
    step: Telling,
    seen: Mapping[str, PoseEvidence],
    witness: Witness,
) -> tuple[Float64[np.ndarray, "3"], float]:
    """What the told attitude is turned by beyond the drawn turn, a rotation vector in the axes of the view,
    and its SD. Against what was drawn, so that a half turn is not taken for the opposite one. A camera's turn
    counts from where its mean attitude over the run really was, with the steps before.
    """
    before, after = told_pose(step.before, sensor).rotation, told_pose(step.after, sensor).rotation
    sd_deg, view = EXACT_DEG, _view(sensor, step.before)
    if sensor in seen:
        bias, world_sd_deg = _mean_attitude(seen[sensor], witness)
        before, sd_deg = bias @ before, sd_deg + world_sd_deg
    expected = before @ view.T @ rotation_exp(np.deg2rad(drawn_deg)) @ view
    excess_deg: np.ndarray = np.rad2deg(view @ rotation_log(expected.T @ after))
    return excess_deg, sd_deg


def _mean_attitude(item: PoseEvidence, witness: Witness) -> tuple[Float64[np.ndarray, "3 3"], float]:
    """How a camera was turned against its rest over the run on average (in ego axes), and its SD in degrees.

    Flex averages out over the frames. The shake's own mean over the run stays, which no gyro sees: 0.5 s over
    the run's length of its RMS, computed for both spectra.
    """
    body = witness.body
    bending = item.turn_rad if body is None else bracket_turn_rad(item, body)
    run_s = max(float(item.taken_ns[-1] - item.taken_ns[0]) * 1e-9, 0.5)
    flex_rad = float(np.sqrt(np.mean(np.var(detrended(bending), axis=0)) / item.frames))
    rms_rad = float(bending.std(axis=0).max()) if body is None else body.rms_rad
    shake_rad = rms_rad * min(0.5 / run_s, 1.0)
    return rotation_exp(bending.mean(axis=0)), float(np.rad2deg(flex_rad + shake_rad))


TOLD: tuple[CalibrationFault, ...] = (
    CalibrationFault(spec=CalibrationRotation, tell=turned, receipts=receipts),
)
