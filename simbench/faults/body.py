"""What shakes the whole body: one entry a fault, of which one at most is on (`FaultSet.check`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int64

from scenarios.fault_set import FaultSet
from scenarios.faults import FaultSpec, Mode, RoadShake, Spectrum, Trace, Vibration
from scenarios.severity import Profile
from simbench.dynamics.ride import Ride
from simbench.faults import motion, road, scripted, trace
from simbench.faults.estimate import BodyAttitude, PoseEvidence
from simbench.faults.receipt import Receipt
from simbench.path import Track
from simbench.shake import BodyShake, Shake

TRACE_ALLOWED = 0.02  # trapezoids and a spline against Simpson's rule


@dataclass(frozen=True, kw_only=True, eq=False)
class Carriage:
    """What carries the sensors in a run. origin_m: of the ego frame on the carrying part. exposures_ns: when
    each camera really exposes."""

    profile: Profile
    track: Track
    origin_m: tuple[float, float]
    exposures_ns: Sequence[Int64[np.ndarray, " f"]]
    duration_s: float
    seed: int


@dataclass(frozen=True, kw_only=True)
class BodyFault:
    """One entry of the catalogue. `receipts` gets the spec, what was drawn (None: nothing), the length of the
    run, and what gyro and cameras say."""

    spec: type[FaultSpec]
    shake: Callable[[Any, Carriage], BodyShake | None]
    receipts: Callable[
        [Any, BodyShake | None, float, BodyAttitude | None, Sequence[PoseEvidence]], tuple[Receipt, ...]
    ]


def _road(spec: RoadShake, carriage: Carriage) -> Ride | None:
    if spec.is_off:
        return None
    c = carriage
    return road.ride(spec, c.profile, c.track, c.origin_m, c.exposures_ns, c.duration_s, c.seed)


def _road_receipts(
    spec: RoadShake, drawn: BodyShake | None, duration_s: float, body: BodyAttitude | None,
    evidence: Sequence[PoseEvidence],
) -> tuple[Receipt, ...]:  # fmt: skip
    return road.road_receipts(spec, drawn if isinstance(drawn, Ride) else None, duration_s, body, evidence)


def _trace_receipts(
    spec: Trace, drawn: BodyShake | None, duration_s: float, body: BodyAttitude | None,
    evidence: Sequence[PoseEvidence],
) -> tuple[Receipt, ...]:  # fmt: skip
    asked = trace.trace_rms(spec, duration_s)
    return motion.shake_receipts(spec.name, asked, drawn, duration_s, body, evidence, allowed=TRACE_ALLOWED)


BODY_FAULTS: tuple[BodyFault, ...] = (
    BodyFault(
        spec=Vibration,
        shake=lambda spec, c: motion.body_shake(spec, c.profile, c.duration_s, c.seed),
        receipts=lambda spec, *found: motion.shake_receipts(spec.name, motion.requested_rms(spec), *found),
    ),
    BodyFault(spec=RoadShake, shake=_road, receipts=_road_receipts),
    BodyFault(
        spec=Mode,
        shake=lambda spec, c: scripted.mode_shake(spec, c.duration_s, c.seed),
        receipts=lambda spec, *found: motion.shake_receipts(spec.name, scripted.mode_rms(spec), *found),
    ),
    BodyFault(
        spec=Spectrum,
        shake=lambda spec, c: scripted.spectrum_shake(spec, c.duration_s, c.seed),
        receipts=lambda spec, *found: motion.shake_receipts(spec.name, scripted.spectrum_rms(spec), *found),
    ),
    BodyFault(
        spec=Trace,
        shake=lambda spec, c: trace.trace_shake(spec, c.duration_s),
        receipts=_trace_receipts,
    ),
)


def shaking(faults: FaultSet) -> tuple[BodyFault, FaultSpec] | None:
    """The fault of a set that shakes the body, if there is one."""
    for fault in BODY_FAULTS:
        spec = faults.get(fault.spec)
        if spec is not None:
            return fault, spec
    return None


def words(drawn: BodyShake | None, profile: Profile, spec: FaultSpec | None, duration_s: float) -> str:
    """What a body's shake is, in words; empty where there is none."""
    if drawn is None or spec is None:
        return ""
    if isinstance(drawn, Ride):
        return road.describe_ride(drawn, profile, duration_s)
    if isinstance(spec, Vibration) and isinstance(drawn, Shake):
        return motion.describe_shake(drawn, profile, duration_s)
    return f"{motion.shake_sizes(drawn, motion.BAND_HZ[profile], duration_s)}: {spec.name}"
