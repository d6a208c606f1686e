"""calibration.undistorted_px: the lens bends the picture, and the fusion is told that it does not.

Acts at two places: on the lens that measures (`refit.py`), k1 = -corner_px / (f r^3), r being the slope of
the farthest corner, and on what is told of it (`tell.py`), distortion 0. Receipt: where a known point in the
corner lies by the lens that measures and by the lens that is told, by OpenCV.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion.camera import PinholeCamera
from fusion.messages import Calibration
from scenarios.faults import Undistorted
from simbench.axes import pinhole
from simbench.faults.known import pixels
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import spared, struck
from simbench.faults.telling import CalibrationFault, Place, Telling, Told, Witness
from simbench.sensors.rig import SensorRig

NOTE = "a known point in the farthest corner, by the lens that measures and by the one that is told"
SD_PX = 1e-3
STRAIGHT = (0.0, 0.0, 0.0, 0.0, 0.0)


def bend(spec: Undistorted, rig: SensorRig) -> SensorRig:
    """The rig with lenses that distort, in place of what distortion they had."""
    if spec.is_off:
        return rig
    cameras, pinholes = dict(rig.cameras), dict(rig.pinholes)
    for name in struck(spec, rig):
        if name not in cameras:  # refused elsewhere, with its place in the file
            continue
        lens = pinholes[name]
        slope = float(np.hypot(*_corner(lens)))
        k1 = -spec.corner_px / (0.5 * (lens.fx_px + lens.fy_px) * slope**3)
        cameras[name] = cameras[name].model_copy(update={"distortion": (k1, 0.0, 0.0, 0.0, 0.0)})
        pinholes[name] = pinhole(cameras[name])
    return replace(rig, cameras=cameras, pinholes=pinholes)


def straightened(spec: Undistorted, told: Calibration, place: Place) -> Told:
    """The calibration without distortion."""
    if spec.is_off:
        return Told(calibration=told, realised={})
    names = struck(spec, place)
    straight = {name: replace(told.cameras[name], distortion=STRAIGHT) for name in names}
    return Told(
        calibration=Calibration(T_ego_sensor=told.T_ego_sensor, cameras={**told.cameras, **straight}),
        realised={name: spec.corner_px for name in names},
    )


def receipts(spec: Undistorted, step: Telling, witness: Witness) -> tuple[Receipt, ...]:
    """Per struck camera: how much farther from the middle the told lens puts a point in the corner. Where the
    fault names cameras: that the others are told what they are."""
    result = [
        judge(
            fault=spec.name, quantity=f"{name} corner", unit="px", requested=spec.corner_px,
            realised=step.realised.get(name, 0.0), measured=_farther_px(step, name), systematic=5.0 * SD_PX,
            allowed=0.01 * abs(spec.corner_px), note=NOTE,
        )
        for name in struck(spec, witness.place)
    ]  # fmt: skip
    others = [
        (_farther_px(step, name), SD_PX)
        for name in spared(spec, witness.place)
        if name in witness.place.cameras
    ]
    result += untouched(
        fault=spec.name, quantity="corner of the other cameras", unit="px", found=others, note=NOTE
    )
    return tuple(result)


def _corner(lens: PinholeCamera) -> tuple[float, float]:
    """Slopes (right, down) of the corner that is farthest from the optical axis, through a straight lens."""
    right = (0.0 if lens.cx_px > 0.5 * lens.width_px else lens.width_px) - lens.cx_px
    down = (0.0 if lens.cy_px > 0.5 * lens.height_px else lens.height_px) - lens.cy_px
    return right / lens.fx_px, down / lens.fy_px


def _farther_px(step: Telling, name: str) -> float:
    lens, told = step.before.cameras[name], step.after.cameras[name]
    point_m = np.array([[*_corner(lens), 1.0]])
    middle = np.array([lens.cx_px, lens.cy_px])
    away = [float(np.linalg.norm(pixels(camera, point_m)[0] - middle)) for camera in (lens, told)]
    return away[1] - away[0]


TOLD: tuple[CalibrationFault, ...] = (
    CalibrationFault(spec=Undistorted, tell=straightened, receipts=receipts),
)
