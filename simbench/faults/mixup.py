"""calibration.mixup: the calibration is handed on in another convention than it is read in.

Poses are T_ego_sensor of the cameras. Every told rotation stays a rotation.
Receipt: how much of the mix-up known points show, by poses from PnP: 1 - |where the told pose puts them less
where the mix-up puts them| / |what the mix-up moves them by|. 1: all of it, 0: none.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fusion.geometry import Transform, rotation_exp, rotation_log
from fusion.messages import Calibration
from scenarios.faults import CalibrationMixup
from simbench.faults.known import AHEAD_M, pixels, told_pose
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import spared, struck
from simbench.faults.telling import CalibrationFault, Place, Telling, Told, Witness

NOTE = "known points by the told pose, before and after"
SD_SHARE = 1e-3
LEAST_M = 1e-3  # that a mix-up must move known points by, to show
SD_M = 1e-4
LEAST_PX = 0.01


def mixed_up(spec: CalibrationMixup, told: Calibration, place: Place) -> Told:
    """The calibration as it is read. Two cameras are swapped where the rig has two."""
    names = _mixed(spec, place)
    poses, cameras = dict(told.T_ego_sensor), dict(told.cameras)
    for i, name in enumerate(names):
        pose = told.T_ego_sensor[name]
        if spec.what == "cameras_swapped":
            other = names[1 - i]
            poses[name], cameras[name] = told.T_ego_sensor[other], told.cameras[other]
        elif spec.what == "transposed_rotation":
            poses[name] = replace(pose, rotation=pose.rotation.T)
        elif spec.what == "degrees_for_radians":
            poses[name] = replace(pose, rotation=rotation_exp(np.rad2deg(rotation_log(pose.rotation))))
        elif spec.what == "inverse":
            poses[name] = pose.inverse()
    return Told(
        calibration=Calibration(T_ego_sensor=poses, cameras=cameras), realised=dict.fromkeys(names, 1.0)
    )


def _mixed(spec: CalibrationMixup, place: Place) -> tuple[str, ...]:
    """The cameras that are mixed up; none where two are to be swapped and there is one."""
    names = struck(spec, place)
    if spec.what == "cameras_swapped":
        names = names[:2] if len(names) >= 2 else ()
    return names


def receipts(spec: CalibrationMixup, step: Telling, witness: Witness) -> tuple[Receipt, ...]:
    """Per camera that is mixed up: how much of it is found. The other cameras: that they stay."""
    place = witness.place
    asked = struck(spec, place)[:2] if spec.what == "cameras_swapped" else struck(spec, place)
    result: list[Receipt] = []
    for i, name in enumerate(asked):
        share, note = None, "the rig has no second camera to swap with"
        if spec.what != "cameras_swapped" or len(asked) == 2:
            share, note = _share(spec, step, name, asked[1 - i] if len(asked) == 2 else name)
        result.append(
            judge(
                fault=spec.name, quantity=f"{name} {spec.what}", unit="share", requested=1.0,
                realised=1.0 if share is None else step.realised.get(name, 0.0), measured=share,
                systematic=5.0 * SD_SHARE, allowed=0.0, note=note,
            )
        )  # fmt: skip
    rest = place.cameras if spec.what == "cameras_swapped" else spared(spec, place)
    others = [
        (_apart_m(told_pose(step.before, name), told_pose(step.after, name)), SD_M)
        for name in rest
        if name not in asked
    ]
    result += untouched(fault=spec.name, quantity="the other sensors", unit="m", found=others, note=NOTE)
    return tuple(result)


def _apart_m(one: Transform, two: Transform) -> float:
    """How far two poses put known points of a sensor apart, RMS."""
    return float(np.sqrt(np.mean((one.apply(AHEAD_M) - two.apply(AHEAD_M)) ** 2)))


def _share(spec: CalibrationMixup, step: Telling, name: str, other: str) -> tuple[float | None, str]:
    """How much of the mix-up is found; None and why where it moves nothing."""
    before, after = told_pose(step.before, name), told_pose(step.after, name)
    as_read = before
    if spec.what == "cameras_swapped":
        as_read = told_pose(step.before, other)
    elif spec.what == "transposed_rotation":
        as_read = Transform(rotation=np.linalg.inv(before.rotation), translation_m=before.translation_m)
    elif spec.what == "degrees_for_radians":
        vector_deg = Rotation.from_matrix(before.rotation).as_rotvec(degrees=True)
        as_read = replace(before, rotation=Rotation.from_rotvec(vector_deg).as_matrix())
    elif spec.what == "inverse":
        back = np.linalg.inv(before.rotation)
        as_read = Transform(rotation=back, translation_m=-back @ before.translation_m)
    moves_m = _apart_m(before, as_read)
    if moves_m < LEAST_M:
        return None, f"moves known points by {1e3 * moves_m:.2g} mm, too little to show"
    share = 1.0 - _apart_m(after, as_read) / moves_m
    if spec.what == "cameras_swapped":
        lens = pixels(step.after.cameras[name], AHEAD_M) - pixels(step.before.cameras[other], AHEAD_M)
        if float(np.abs(lens).max()) > LEAST_PX:
            return 0.0, "the intrinsics are not those of the other camera"
    return share, NOTE


TOLD: tuple[CalibrationFault, ...] = (
    CalibrationFault(spec=CalibrationMixup, tell=mixed_up, receipts=receipts),
)
