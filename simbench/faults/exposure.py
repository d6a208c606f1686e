"""A longer exposure: what moves leaves a streak, and the middle of the exposure comes later.

camera.motion_blur_ms acts in the sensor (`sensors/camera.py` integrates the light), as pixels cannot be
unmixed afterwards. A real camera starts to expose when it did, so the middle moves by half of what is added;
read-out, and a stamp made by the host, come later by all of it. Receipts: true middles of the exposures
against their starts without the fault, and the length of the streaks (`streak.py`).
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np

from scenarios.errors import BadInput
from scenarios.faults.camera import MotionBlur
from scenarios.scenario import CameraSensor
from simbench.capture import Captured
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.streak import streak_ms
from simbench.faults.struck import spared, struck
from simbench.sensors.rig import SensorRig

INSTANT_SD_MS = 1e-5  # instants are whole nanoseconds, and so is half an exposure
NO_PICTURES = "no pictures are taken: give --images raycast and a pipeline that reads them"
STREAKS = "sharp pictures of many instants, mixed until they show the streaks of a delivered one"
INSTANTS = "twice the true middle of the exposure after its start without the fault, less the read-out"


def expose_longer(spec: MotionBlur, rig: SensorRig) -> SensorRig:
    """The rig with longer exposures. BadInput: one would not fit into its camera's period."""
    if spec.is_off:
        return rig
    cameras = dict(rig.cameras)
    for name in struck(spec, rig):
        if name in cameras:  # a camera that is not there is refused elsewhere, with its place in the file
            cameras[name] = _longer(spec, name, cameras[name])
    return replace(rig, cameras=cameras)


def _longer(spec: MotionBlur, name: str, sensor: CameraSensor) -> CameraSensor:
    exposure_ms, period_ms = sensor.exposure_ms + spec.longer_ms, 1e3 / sensor.rate_hz
    if exposure_ms + sensor.readout_ms > period_ms:
        room_ms = period_ms - sensor.exposure_ms - sensor.readout_ms
        raise BadInput(
            f"{spec.name}: {name} exposes for {sensor.exposure_ms:g} ms and reads out in "
            f"{sensor.readout_ms:g} ms, in a period of {period_ms:g} ms; {spec.longer_ms:g} ms do not fit",
            allowed=f"up to {room_ms:g} ms",
        )
    delay = sensor.stamp_delay_ms  # from the middle of the exposure to the host
    if sensor.stamp == "arrival":
        half_ms = 0.5 * spec.longer_ms
        delay = (delay[0] + half_ms, delay[1] + half_ms) if isinstance(delay, tuple) else delay + half_ms
    return sensor.model_copy(
        update={
            "exposure_ms": exposure_ms,
            "motion_blur_samples": max(spec.samples, sensor.motion_blur_samples),
            "stamp_delay_ms": delay,
        }
    )


def receipts(
    spec: MotionBlur, before: SensorRig, after: SensorRig, captured: Captured
) -> tuple[Receipt, ...]:
    """Of every struck camera how much longer it exposed, by its instants and by its streaks."""
    result: list[Receipt] = []
    for name in struck(spec, before):
        found = _longer_ms(name, before, captured)
        realised = after.cameras[name].exposure_ms - before.cameras[name].exposure_ms
        result.append(
            judge(
                fault=spec.name, quantity=f"{name} longer exposure", unit="ms", requested=spec.longer_ms,
                realised=realised, measured=found, systematic=5.0 * INSTANT_SD_MS, allowed=1e-6,
                note=INSTANTS,
            )
        )  # fmt: skip
        result.append(_streaks(spec, name, before, after, captured))
    beside = [(_longer_ms(name, before, captured) or 0.0, INSTANT_SD_MS) for name in spared(spec, before)
              if name in before.cameras]  # fmt: skip
    return (
        *result,
        *untouched(
            fault=spec.name, quantity="longer exposure of the other cameras", unit="ms", found=beside,
            note=INSTANTS,
        ),
    )  # fmt: skip


def _longer_ms(name: str, before: SensorRig, captured: Captured) -> float | None:
    """By the middles of the exposures, in which the sensor does not say how long they were."""
    shots, site = captured.measured.shots[name], captured.site
    start_ns = before.timing(name, site.duration_s, site.seed).start_ns
    mid_ns = np.array([shot.truth.capture_ns for shot in shots], dtype=np.int64)
    if not len(mid_ns) or len(mid_ns) != len(start_ns):
        return None if not len(mid_ns) else float("nan")
    mid_ns = mid_ns - captured.drawn.delays_ns.get(name, 0)
    camera = before.cameras[name]
    open_ms = 2e-6 * float(np.mean(mid_ns - start_ns)) - camera.readout_ms
    return open_ms - camera.exposure_ms


def _streaks(spec: MotionBlur, name: str, before: SensorRig, after: SensorRig, captured: Captured) -> Receipt:
    """Against the exposure that has the spread of as many instants: n even ones of an exposure T spread as
    T sqrt(1 - 1 / n^2)."""
    sensor, was_ms = after.cameras[name], before.cameras[name].exposure_ms
    requested = was_ms + spec.longer_ms
    realised = sensor.exposure_ms * sqrt(1.0 - sensor.motion_blur_samples**-2.0)
    shots = captured.measured.shots[name]
    found, note = None, NO_PICTURES
    if any(shot.image is not None for shot in shots):
        found = streak_ms(shots, sensor, after.pinholes[name], captured.motion, requested)
        note = STREAKS if found is not None else "nothing moves in the picture"
    measured, sd, most = found or (None, 0.0, 0.0)
    return judge(
        fault=spec.name, quantity=f"{name} exposure by its streaks", unit="ms", requested=requested,
        realised=realised, measured=measured, estimator_sd=sd, systematic=most,
        allowed=requested * (1.0 - sqrt(1.0 - spec.samples**-2.0)) + 1e-6, note=note,
    )  # fmt: skip
