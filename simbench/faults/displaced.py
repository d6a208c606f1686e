"""calibration.translation_cm: the fusion is told that a sensor sits elsewhere; the world stays as it is.

t_told = t_before + 0.01 shift_cm * a, a an ego axis or random (uniform on the sphere, one per sensor).
Receipt: how far the pose moved that known points show: a camera's by PnP, the LiDAR's by a rigid fit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion.messages import Calibration
from scenarios.faults import CalibrationTranslation
from scenarios.seeding import stream
from simbench.faults.known import told_pose
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import spared, struck
from simbench.faults.telling import CalibrationFault, Place, Telling, Told, Witness

NOTE = "place by known points, before and after"
SD_CM = 0.005
AXES = "xyz"


def displaced(spec: CalibrationTranslation, told: Calibration, place: Place) -> Told:
    """The calibration with the struck sensors moved."""
    poses, realised = dict(told.T_ego_sensor), dict[str, float]()
    for sensor in struck(spec, place):
        if spec.axis == "random":
            axis = stream(place.seed, "fault", spec.name, sensor).standard_normal(3)
            axis = axis / np.linalg.norm(axis)
        else:
            axis = np.eye(3)[AXES.index(spec.axis)]
        shift_cm = spec.shift_cm * axis
        before = told.T_ego_sensor[sensor]
        poses[sensor] = replace(before, translation_m=before.translation_m + 0.01 * shift_cm)
        realised.update({f"{sensor} {a}": float(cm) for a, cm in zip(AXES, shift_cm, strict=True)})
    return Told(calibration=Calibration(T_ego_sensor=poses, cameras=told.cameras), realised=realised)


def receipts(spec: CalibrationTranslation, step: Telling, witness: Witness) -> tuple[Receipt, ...]:
    """Per struck sensor: how far it was moved along the drawn direction, signed. Where the fault names
    sensors: that the others stay."""

    def moved_cm(sensor: str) -> np.ndarray:
        before, after = told_pose(step.before, sensor), told_pose(step.after, sensor)
        shift: np.ndarray = 100.0 * (after.translation_m - before.translation_m)
        return shift

    result: list[Receipt] = []
    for sensor in struck(spec, witness.place):
        drawn_cm = np.array([step.realised.get(f"{sensor} {a}", 0.0) for a in AXES])
        size_cm = float(np.linalg.norm(drawn_cm))
        if spec.axis == "random":
            axis = drawn_cm / size_cm if size_cm > 0.0 else np.zeros(3)
        else:
            axis = np.eye(3)[AXES.index(spec.axis)]
        result.append(
            judge(
                fault=spec.name, quantity=f"{sensor} {spec.axis}", unit="cm",
                requested=abs(spec.shift_cm) if spec.axis == "random" else spec.shift_cm,
                realised=float(drawn_cm @ axis), measured=float(moved_cm(sensor) @ axis),
                systematic=5.0 * SD_CM, allowed=max(0.01 * abs(spec.shift_cm), 1e-6), note=NOTE,
            )
        )  # fmt: skip
    others = [(float(np.linalg.norm(moved_cm(name))), SD_CM) for name in spared(spec, witness.place)]
    result += untouched(
        fault=spec.name, quantity="shift of the other sensors", unit="cm", found=others, note=NOTE
    )
    return tuple(result)


TOLD: tuple[CalibrationFault, ...] = (
    CalibrationFault(spec=CalibrationTranslation, tell=displaced, receipts=receipts),
)
