"""motion.road: the ego drives over a rough road, and its body does what a vehicle's does.

The road is drawn from the seed; `simbench.dynamics` integrates the drive. Receipts: Gd of the class against
that of the drawn road and against what the gyro found of it; per axis, the RMS that the linearised vehicle
makes of this road (requested), what was integrated (realised), and what gyro and cameras found (measured).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil

import numpy as np
from jaxtyping import Int64

from scenarios.errors import BadInput
from scenarios.faults import RoadShake
from scenarios.seeding import stream
from scenarios.severity import Profile
from simbench.dynamics.ride import Overturned, Ride, drive_over
from simbench.dynamics.road import ROUGHNESS_M3, draw_road
from simbench.faults.estimate import BodyAttitude, PoseEvidence, detrended, gain
from simbench.faults.motion import AXES, TO_DEG_AND_M, drawn_rms, found_rms, shake_sizes
from simbench.faults.receipt import Receipt, judge
from simbench.motion import PIVOT_M
from simbench.path import Track
from simbench.shake import times_ns

ROAD = "motion.road"
BEFORE_S, AFTER_S = 0.5, 1.0  # beyond the first and the last exposure: rows, rates, late messages
LINEAR_SHARE = 0.1  # how far large angles may take the vehicle from its linearised self
VEHICLE: Mapping[Profile, str] = {"car": "a car", "rider": "an e-scooter and its rider"}


def ride(
    spec: RoadShake,
    profile: Profile,
    track: Track,
    ego_xy_m: tuple[float, float],
    exposures_ns: Sequence[Int64[np.ndarray, " f"]],
    duration_s: float,
    seed: int,
) -> Ride:
    """The ego's drive. ego_xy_m: the ego frame's origin on the carrying part. exposures_ns: when the cameras
    really expose: the ride covers those and the run, and more on either side. BadInput: the vehicle falls.
    """
    first_ns = min([0, *(int(t.min()) for t in exposures_ns if len(t))])
    last_ns = max([ceil(duration_s * 1e9), *(int(t.max()) for t in exposures_ns if len(t))])
    try:
        return drive_over(
            draw_road(stream(seed, "fault", ROAD), spec.roughness, spec.events),
            spec.roughness,
            profile,
            track,
            (PIVOT_M[0] + ego_xy_m[0], PIVOT_M[1] + ego_xy_m[1], PIVOT_M[2]),
            first_ns - round(BEFORE_S * 1e9),
            last_ns + round(AFTER_S * 1e9),
        )
    except Overturned as fall:
        raise BadInput(f"{ROAD}: {fall}; drive slower or over lower events") from fall


def describe_ride(driven: Ride, profile: Profile, duration_s: float) -> str:
    """One sentence on what a ride is: size, rate, the band that holds its pitch, vehicle and road."""
    events = f" and {driven.events} event{'s' * (driven.events > 1)}" if driven.events else ""
    road = "a smooth road" if driven.roughness == "smooth" else f"ISO 8608 road class {driven.roughness}"
    sizes = shake_sizes(driven, pitch_band_hz(driven, duration_s), duration_s)
    return f"{sizes}: {VEHICLE[profile]} on {road}{events}, integrated"


def pitch_band_hz(driven: Ride, duration_s: float) -> tuple[float, float]:
    """Between these frequencies lie 90 % of the power of the pitch, to two digits."""
    pitch = detrended(driven.at(times_ns(duration_s)))[:, 1]
    power = np.abs(np.fft.rfft(pitch)) ** 2
    hertz = np.fft.rfftfreq(len(pitch), 1e-3)
    share = np.cumsum(power) / max(float(power.sum()), 1e-300)
    low, high = hertz[np.minimum(np.searchsorted(share, [0.05, 0.95]), len(hertz) - 1)]
    return float(f"{low:.2g}"), float(f"{high:.2g}")


def road_receipts(
    spec: RoadShake,
    realised: Ride | None,
    duration_s: float,
    body: BodyAttitude | None,
    evidence: Sequence[PoseEvidence],
) -> tuple[Receipt, ...]:
    """The class of the road, and roll, pitch and heave wherever the vehicle has them."""
    if realised is None:
        return (_missing(spec),)
    result = [] if spec.roughness == "smooth" else [_roughness(spec, realised, duration_s, body)]
    asked = realised.linear_rms(duration_s) * TO_DEG_AND_M
    drawn = drawn_rms(realised, duration_s)
    found = found_rms(realised, duration_s, body, evidence)
    for axis, (name, unit, note) in enumerate(AXES):
        if asked[axis] <= 1e-6 * float(asked.max()) + 1e-9:
            continue
        result.append(
            judge(
                fault=ROAD,
                quantity=f"{name} RMS",
                unit=unit,
                requested=float(asked[axis]),
                realised=float(drawn[axis]),
                measured=found[axis].value,
                estimator_sd=found[axis].sd,
                systematic=found[axis].systematic,
                allowed=LINEAR_SHARE * float(asked[axis]),
                note=f"requested: the linearised vehicle on this road; {note}",
            )
        )
    return tuple(result)


def _missing(spec: RoadShake) -> Receipt:
    smooth = spec.roughness == "smooth"
    return judge(
        fault=ROAD,
        quantity="events on the road" if smooth else "roughness Gd(0.1 cycles/m)",
        unit="1" if smooth else "1e-6 m3",
        requested=float(len(spec.events)) if smooth else 1e6 * ROUGHNESS_M3[spec.roughness],
        realised=0.0,
        measured=None,
        estimator_sd=0.0,
        allowed=0.0,
        note="nothing was integrated",
    )


def _roughness(spec: RoadShake, realised: Ride, duration_s: float, body: BodyAttitude | None) -> Receipt:
    """Gd by the class, by the drawn road's own table, and by the gyro's pitch against the linearised one."""
    drawn = 1e6 * realised.roughness_m3
    measured, sd, most = None, 0.0, 0.0
    if body is not None:
        inside = (body.stamp_ns >= 0) & (body.stamp_ns < duration_s * 1e9)
        row = (body.stamp_ns[inside] - realised.start_ns) / realised.step_ns
        pitch = np.interp(row, np.arange(len(realised.linear)), realised.linear[:, 1])
        expected = body.seen(pitch[:, None], body.stamp_ns[inside])
        size = float(np.std(expected))
        if size > 0.0:
            times = gain(body.seen(body.angle_rad[inside][:, 1:2], body.stamp_ns[inside]), expected)
            measured = drawn * times * abs(times)
            sd = drawn * 2.0 * body.gain_sd(expected, body.stamp_ns[inside])
            most = drawn * 2.0 * LINEAR_SHARE
    return judge(
        fault=ROAD,
        quantity="roughness Gd(0.1 cycles/m)",
        unit="1e-6 m3",
        requested=1e6 * ROUGHNESS_M3[spec.roughness],
        realised=drawn,
        measured=measured,
        estimator_sd=sd,
        systematic=most,
        allowed=0.1e6 * ROUGHNESS_M3[spec.roughness],  # a class is four times the one before
        note="class, table of the drawn road, pitch by gyro over that of the linearised vehicle, squared",
    )
