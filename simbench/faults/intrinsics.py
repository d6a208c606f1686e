"""calibration.focal_percent and calibration.shift_px: the fusion is told other intrinsics.

focal_percent: f_told = f_before (1 + percent / 100). shift_px: c_told = c_before + (right_px, down_px).
Receipts: known points in the camera's frame, projected by OpenCV with what is told before and after: how much
larger the picture became about its middle, and how far it moved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fusion.camera import PinholeCamera
from fusion.messages import Calibration
from scenarios.faults import FocalLength, PixelShift
from simbench.faults.known import AHEAD_M, pixels
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import spared, struck
from simbench.faults.telling import CalibrationFault, Place, Telling, Told, Witness

NOTE = "known points by the told camera, before and after"
SHIFT_SD_PX = 1e-3
SCALE_SD_PERCENT = 1e-3
SIDES = ("right", "down")


def _with(
    told: Calibration, cameras: Sequence[str], change: Callable[[PinholeCamera], PinholeCamera]
) -> Calibration:
    changed = {name: change(told.cameras[name]) for name in cameras}
    return Calibration(T_ego_sensor=told.T_ego_sensor, cameras={**told.cameras, **changed})


def zoomed(spec: FocalLength, told: Calibration, place: Place) -> Told:
    """The calibration with other focal lengths."""
    scale, names = 1.0 + 0.01 * spec.percent, struck(spec, place)
    return Told(
        calibration=_with(told, names, lambda c: replace(c, fx_px=scale * c.fx_px, fy_px=scale * c.fy_px)),
        realised={name: spec.percent for name in names},
    )


def shifted(spec: PixelShift, told: Calibration, place: Place) -> Told:
    """The calibration with other image centres."""
    names, shift = struck(spec, place), (spec.right_px, spec.down_px)
    return Told(
        calibration=_with(
            told, names, lambda c: replace(c, cx_px=c.cx_px + shift[0], cy_px=c.cy_px + shift[1])
        ),
        realised={f"{name} {side}": px for name in names for side, px in zip(SIDES, shift, strict=True)},
    )


def _both(step: Telling, camera: str) -> tuple[np.ndarray, np.ndarray]:
    return pixels(step.before.cameras[camera], AHEAD_M), pixels(step.after.cameras[camera], AHEAD_M)


def _larger_percent(step: Telling, camera: str) -> np.ndarray:
    """Of the picture's width and height: least squares of pixels after on those before."""
    before, after = (uv - uv.mean(axis=0) for uv in _both(step, camera))
    larger: np.ndarray = 100.0 * ((before * after).sum(axis=0) / (before**2).sum(axis=0) - 1.0)
    return larger


def _moved_px(step: Telling, camera: str) -> np.ndarray:
    before, after = _both(step, camera)
    moved: np.ndarray = (after - before).mean(axis=0)
    return moved


def focal_receipts(spec: FocalLength, step: Telling, witness: Witness) -> tuple[Receipt, ...]:
    """Per struck camera and axis of its picture. Where the fault names cameras: that the others stay."""
    result = [
        judge(
            fault=spec.name, quantity=f"{camera} {side}", unit="%", requested=spec.percent,
            realised=step.realised.get(camera, 0.0), measured=float(larger),
            systematic=5.0 * SCALE_SD_PERCENT, allowed=0.01 * abs(spec.percent), note=NOTE,
        )
        for camera in struck(spec, witness.place)
        for side, larger in zip(("width", "height"), _larger_percent(step, camera), strict=True)
    ]  # fmt: skip
    others = [
        (float(np.abs(_larger_percent(step, name)).max()), SCALE_SD_PERCENT)
        for name in spared(spec, witness.place)
        if name in witness.place.cameras
    ]
    result += untouched(fault=spec.name, quantity="the other cameras", unit="%", found=others, note=NOTE)
    return tuple(result)


def shift_receipts(spec: PixelShift, step: Telling, witness: Witness) -> tuple[Receipt, ...]:
    """Per struck camera and direction that was asked for. Where the fault names cameras: that the others
    stay."""
    result: list[Receipt] = []
    for camera in struck(spec, witness.place):
        moved = _moved_px(step, camera)
        for i, side in enumerate(SIDES):
            requested, realised = (spec.right_px, spec.down_px)[i], step.realised.get(f"{camera} {side}", 0.0)
            if requested == realised == 0.0 and abs(moved[i]) <= 5.0 * SHIFT_SD_PX:
                continue
            result.append(
                judge(
                    fault=spec.name, quantity=f"{camera} {side}", unit="px", requested=requested,
                    realised=realised, measured=float(moved[i]), systematic=5.0 * SHIFT_SD_PX,
                    allowed=max(0.01 * abs(requested), 1e-6), note=NOTE,
                )
            )  # fmt: skip
    others = [
        (float(np.abs(_moved_px(step, name)).max()), SHIFT_SD_PX)
        for name in spared(spec, witness.place)
        if name in witness.place.cameras
    ]
    result += untouched(fault=spec.name, quantity="the other cameras", unit="px", found=others, note=NOTE)
    return tuple(result)


TOLD: tuple[CalibrationFault, ...] = (
    CalibrationFault(spec=FocalLength, tell=zoomed, receipts=focal_receipts),
    CalibrationFault(spec=PixelShift, tell=shifted, receipts=shift_receipts),
)
