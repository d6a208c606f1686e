"""timing.trigger_angle_deg: cameras are fired when the beam points elsewhere than where they look.

The rig's trigger angle is off: an exposure and its stamp come angle_deg / 360 of a turn later, while the
LiDAR still passes the camera's axis when it did. Receipt: how far the beam turned between when a camera would
have exposed and when it did, by the azimuths and firing times of the first sweeps' points.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarios.errors import BadInput
from scenarios.faults import TriggerAngle
from simbench.capture import Captured
from simbench.faults.delivery import Sweep
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import spared, struck
from simbench.sensors.rig import SensorRig

NOTE = "turn of the beam (points of the sweeps) between the exposures without the fault and those with it"
SD_DEG = 0.02  # of a turn: azimuths of points scatter by the sensor's angular noise
FEWEST = 5  # points of a ring, all around


def fire_elsewhere(spec: TriggerAngle, rig: SensorRig) -> SensorRig:
    """The rig with other trigger angles. BadInput: a camera that runs freely is named, or all do."""
    if spec.is_off:
        return rig
    angles = dict(rig.trigger_deg)
    free = [name for name, sensor in rig.cameras.items() if sensor.trigger == "free_run"]
    wanted = [name for name in struck(spec, rig) if name in rig.cameras]
    if any(name in free for name in spec.named_cameras) or all(name in free for name in wanted):
        names = ", ".join(name for name in wanted if name in free)
        raise BadInput(f"{spec.name}: no beam triggers {names}, which run freely")
    for name in wanted:
        if name not in free:
            angles[name] = angles[name] + spec.angle_deg
    return replace(rig, trigger_deg=angles)


def receipts(
    spec: TriggerAngle, before: SensorRig, after: SensorRig, captured: Captured
) -> tuple[Receipt, ...]:
    """Per struck camera that is triggered. Where the fault names cameras: that the others fire when they
    did."""
    rate = _deg_per_ns(captured.measured.sweeps)
    result = [
        judge(
            fault=spec.name, quantity=f"{name} trigger angle", unit="deg", requested=_wrapped(spec.angle_deg),
            realised=_wrapped(after.trigger_deg[name] - before.trigger_deg[name]),
            measured=None if rate is None else _turned_deg(name, rate, before, captured),
            systematic=5.0 * SD_DEG, allowed=max(0.01 * abs(spec.angle_deg), 1e-6),
            note=NOTE if rate is not None else "no sweep has points enough to show how the beam turns",
        )
        for name in struck(spec, before)
        if before.cameras[name].trigger != "free_run"
    ]  # fmt: skip
    others = [
        (_turned_deg(name, rate, before, captured), SD_DEG)
        for name in spared(spec, before)
        if name in before.cameras and rate is not None  # else nothing is known of them
    ]
    result += untouched(
        fault=spec.name, quantity="trigger angle of the other cameras", unit="deg", found=others, note=NOTE
    )
    return tuple(result)


def _turned_deg(name: str, deg_per_ns: float, before: SensorRig, captured: Captured) -> float:
    """How far the beam turns in between, wrapped to half a turn."""
    site = captured.site
    nominal_ns = before.timing(name, site.duration_s, site.seed).mid_ns
    taken_ns = np.array([shot.truth.capture_ns for shot in captured.measured.shots[name]], dtype=np.int64)
    if not len(taken_ns):
        return 0.0
    later_ns = taken_ns[0] - nominal_ns[0] - int(captured.drawn.delays_ns.get(name, np.zeros(1))[0])
    return _wrapped(deg_per_ns * float(later_ns))


def _deg_per_ns(sweeps: tuple[Sweep, ...]) -> float | None:
    """How fast the beam turns (counter-clockwise is positive), by the fullest ring of the first sweep."""
    for sweep in sweeps:
        ring = sweep.scan.ring
        if len(ring) < FEWEST:
            continue
        on = ring == np.bincount(ring).argmax()
        if on.sum() < FEWEST:
            continue
        x, y = sweep.scan.xyz_m[on, 0].astype(np.float64), sweep.scan.xyz_m[on, 1].astype(np.float64)
        azimuth_deg = np.rad2deg(np.unwrap(np.arctan2(y, x)))
        since_ns = (sweep.truth.fire_ns[on] - sweep.truth.fire_ns[on][0]).astype(np.float64)
        return float(np.polyfit(since_ns, azimuth_deg, 1)[0])
    return None


def _wrapped(angle_deg: float) -> float:
    return float((angle_deg + 180.0) % 360.0 - 180.0)
