"""calibration.rotation_deg: the fusion is told a rotated extrinsic; the world stays as it is.

T_told = T_true * R(axis, angle) in the axes of the viewing direction (x along it, y left, z up), about the
camera's own optical centre. axis: roll, pitch, yaw, or random (uniform on the sphere, one per camera).
Receipt: the turn between what the fusion is told and the camera's mean attitude by PnP.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from fusion.geometry import Transform, rotation_exp, rotation_log
from fusion.messages import Calibration
from scenarios.faults import CalibrationRotation
from scenarios.seeding import stream
from simbench.axes import R_BODY_OPTICAL
from simbench.faults.estimate import BodyAttitude, CameraEvidence, bracket_turn_rad, detrended
from simbench.faults.receipt import Receipt, judge, untouched

KEY = "calibration.rotation_deg"
NOTE = "told extrinsic against the mean attitude by PnP"
AXES = {"roll": (1.0, 0.0, 0.0), "pitch": (0.0, 1.0, 0.0), "yaw": (0.0, 0.0, 1.0)}


def miscalibrate(
    true: Calibration, spec: CalibrationRotation, cameras: Sequence[str], seed: int
) -> Calibration:
    """The calibration that the fusion is told."""
    told = dict(true.T_ego_sensor)
    for camera in cameras:
        if spec.axis == "random":
            axis = stream(seed, "fault", KEY, camera).standard_normal(3)
            axis = axis / np.linalg.norm(axis)
        else:
            axis = np.array(AXES[spec.axis])
        rest = true.T_ego_sensor[camera]
        view = rest.rotation @ R_BODY_OPTICAL.T
        turned = view @ rotation_exp(np.deg2rad(spec.angle_deg) * axis) @ R_BODY_OPTICAL
        told[camera] = Transform(rotation=turned, translation_m=rest.translation_m)
    return Calibration(T_ego_sensor=told, cameras=true.cameras)


def _turn_deg(told: np.ndarray, true: np.ndarray) -> Float64[np.ndarray, "3"]:
    """The turn from `true` to `told` (camera rotations in the ego frame): a rotation vector in viewing
    axes.
    """
    turn: np.ndarray = np.rad2deg(R_BODY_OPTICAL @ rotation_log(true.T @ told))
    return turn


def _wrapped_deg(angle_deg: float) -> float:
    """The same direction within -180 (included) to 180 degrees."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def receipts(
    spec: CalibrationRotation,
    cameras: Sequence[str],
    true: Calibration,
    drawn: Calibration,
    told: Calibration,
    evidence: Sequence[CameraEvidence],
    body: BodyAttitude | None,
) -> tuple[Receipt, ...]:
    """Per struck camera: the turn of the calibration that was handed out (`told`) against the camera's mean
    attitude, about the drawn axis and signed. Where the fault names cameras: that the others are told the
    truth.
    """
    result: list[Receipt] = []
    others: list[tuple[float, float]] = []
    for item in evidence:
        bending = item.turn_rad if body is None else bracket_turn_rad(item, body)
        mean = rotation_exp(bending.mean(axis=0)) @ item.R_ego_camera
        found_deg = _turn_deg(told.T_ego_sensor[item.camera].rotation, mean)
        # Flex averages out over the frames. The shake's own mean over the run stays, which no gyro sees: 0.5
        # s over the run's length of its RMS, computed for both spectra.
        run_s = max(float(item.taken_ns[-1] - item.taken_ns[0]) * 1e-9, 0.5)
        flex_rad = float(np.sqrt(np.mean(np.var(detrended(bending), axis=0)) / item.frames))
        rms_rad = float(bending.std(axis=0).max()) if body is None else body.rms_rad
        shake_rad = rms_rad * min(0.5 / run_s, 1.0)
        sd_deg = 0.002 + float(np.rad2deg(flex_rad + shake_rad))
        if item.camera not in cameras:
            others.append((float(np.linalg.norm(found_deg)), sd_deg))
            continue
        told_R, true_R = told.T_ego_sensor[item.camera].rotation, true.T_ego_sensor[item.camera].rotation
        drawn_R = drawn.T_ego_sensor[item.camera].rotation
        drawn_deg = _turn_deg(drawn_R, true_R)
        # Against what was drawn, so that a half turn is not taken for the opposite one.
        excess_deg = _turn_deg(mean.T @ told_R, true_R.T @ drawn_R)
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
                quantity=f"{item.camera} {spec.axis}",
                unit="deg",
                requested=requested_deg,
                realised=realised_deg,
                measured=realised_deg + float(excess_deg @ axis),
                estimator_sd=sd_deg,
                allowed=max(0.01 * abs(spec.angle_deg), 0.05),
                note=NOTE,
            )
        )
    result += untouched(fault=KEY, quantity="turn of the other cameras", unit="deg", found=others, note=NOTE)
    return tuple(result)
