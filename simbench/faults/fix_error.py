"""reference.lever_arm_m, bias_cm, noise_cm, float_s, heading_deg: where the reference says the target is.

With p = T (c + l + n), T the turn by the pass's heading error: an error d of the receivers gives p + T d, of
which d goes to its own part (lever or noise) and T d - d to the heading part. A further heading error e gives
R(-e) p, all of the change to the heading part. So the parts add up as before. Receipts: the shift of each
fix, in the axes in which the error was asked for.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from jaxtyping import Float64

from scenarios.faults.reference import (
    ReferenceBias,
    ReferenceFloat,
    ReferenceHeading,
    ReferenceLever,
    ReferenceNoise,
)
from scenarios.seeding import stream
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, DeliveryFault, Site
from simbench.faults.fix_proof import (
    bias_receipts,
    float_receipts,
    heading_receipts,
    lever_receipts,
    noise_receipts,
)
from simbench.faults.fixes import carrier, own_period_s
from simbench.motion import Motion
from simbench.truth import GnssReference


def lever(spec: ReferenceLever, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None:
        return Acted(delivery=delivery, realised={})
    arm_m = np.array([spec.forward_m, spec.left_m, spec.up_m])
    world_m = carrier(spec.of, reference, site.motion) @ arm_m
    error_m = _into_ego(world_m if spec.of == "target" else -world_m, reference, site.motion)
    moved = _with_error(reference, error_m, "lever_m")
    return Acted(
        delivery=replace(delivery, reference=moved), realised={"arm_m": float(np.linalg.norm(arm_m))}
    )


def bias(spec: ReferenceBias, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None:
        return Acted(delivery=delivery, realised={})
    length_m = 0.01 * spec.bias_cm
    direction_rad = stream(site.seed, "fault", spec.name).uniform(0.0, 2.0 * np.pi)
    world_m = length_m * np.array([np.cos(direction_rad), np.sin(direction_rad), 0.0])
    error_m = _into_ego(np.tile(world_m, (len(reference.fix_ns), 1)), reference, site.motion)
    moved = _with_error(reference, error_m, "noise_m")
    return Acted(delivery=replace(delivery, reference=moved), realised={"bias_cm": 1e2 * length_m})


def noise(spec: ReferenceNoise, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None:
        return Acted(delivery=delivery, realised={})
    draw = stream(site.seed, "fault", spec.name).standard_normal((len(reference.fix_ns), 3))
    error_m = 0.01 * spec.noise_cm * draw
    moved = _with_error(reference, error_m, "noise_m")
    rms_cm = 1e2 * float(np.sqrt(np.mean(error_m**2))) if len(error_m) else 0.0
    return Acted(delivery=replace(delivery, reference=moved), realised={"noise_cm": rms_cm})


def floating(spec: ReferenceFloat, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None:
        return Acted(delivery=delivery, realised={})
    length, turn = stream(site.seed, "fault", spec.name).random(2)
    length_m = spec.least_m + (spec.most_m - spec.least_m) * float(length)
    angle_rad = 2.0 * np.pi * turn
    begin_ns, length_ns = round(spec.at_s * 1e9), round(spec.duration_s * 1e9)
    hit = (reference.fix_ns >= begin_ns) & (reference.fix_ns < begin_ns + length_ns)
    world_m = hit[:, None] * (length_m * np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0]))
    moved = _with_error(reference, _into_ego(world_m, reference, site.motion), "noise_m")
    realised = {"length_m": length_m, "duration_s": int(hit.sum()) * own_period_s(reference)}
    return Acted(delivery=replace(delivery, reference=moved), realised=realised)


def heading(spec: ReferenceHeading, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None:
        return Acted(delivery=delivery, realised={})
    turn_rad = np.full(len(reference.fix_ns), -np.deg2rad(spec.heading_deg))
    position_m = _turned(reference.position_ego_m, turn_rad)
    moved = replace(
        reference,
        position_ego_m=position_m,
        heading_m=reference.heading_m + (position_m - reference.position_ego_m),
    )
    return Acted(
        delivery=replace(delivery, reference=moved), realised={"heading_deg": float(spec.heading_deg)}
    )


def _with_error(
    reference: GnssReference, error_m: Float64[np.ndarray, "m 3"], part: Literal["lever_m", "noise_m"]
) -> GnssReference:
    """An error of the receivers, given in true ego axes."""
    straight = reference.centre_ego_m + reference.lever_m + reference.noise_m
    (x, y, _), (u, v, _) = straight.T, reference.position_ego_m.T
    seen_m = _turned(error_m, np.arctan2(x * v - y * u, x * u + y * v))
    return replace(
        reference,
        position_ego_m=reference.position_ego_m + seen_m,
        heading_m=reference.heading_m + (seen_m - error_m),
        **{part: getattr(reference, part) + error_m},
    )


def _turned(value_m: Float64[np.ndarray, "m 3"], turn_rad: np.ndarray) -> Float64[np.ndarray, "m 3"]:
    """Each row turned about the upward axis, counter-clockwise."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    x, y, z = value_m.T
    return np.stack([c * x - s * y, s * x + c * y, z], axis=1)


def _into_ego(
    world_m: Float64[np.ndarray, "m 3"], reference: GnssReference, motion: Motion
) -> Float64[np.ndarray, "m 3"]:
    R_world_ego, _ = motion.ego(reference.fix_ns)
    turned: np.ndarray = np.einsum("nji,nj->ni", R_world_ego, world_m)
    return turned


DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=ReferenceLever, act=lever, receipts=lever_receipts),
    DeliveryFault(spec=ReferenceBias, act=bias, receipts=bias_receipts),
    DeliveryFault(spec=ReferenceNoise, act=noise, receipts=noise_receipts),
    DeliveryFault(spec=ReferenceFloat, act=floating, receipts=float_receipts),
    DeliveryFault(spec=ReferenceHeading, act=heading, receipts=heading_receipts),
)
"""In the order in which they act: receivers first, then the turn into the ego frame."""
