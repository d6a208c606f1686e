"""reference.lever_arm_m, bias_cm, noise_cm, float_s, heading_deg: where the reference says the target is.

With p = T (c + l + n), T the turn by the pass's heading error: an error d of the receivers gives p + T d, of
which d goes to its own part (lever or noise) and T d - d to the heading part. A further heading error e gives
R(-e) p, all of the change to the heading part. So the parts add up as before. Receipts: the shift of each fix,
in the axes in which the error was asked for.
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
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.fixes import NO_REFERENCE, adds_up, fixes_of, own_period_s, unverifiable
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.motion import Motion
from simbench.truth import GnssReference

SD_M = 1e-6
SD_DEG = 1e-6
SAME_M = 0.05  # a centre that is this near to an object's is that object's
SHIFT_NOTE = "shift of each fix"


def lever(spec: ReferenceLever, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None:
        return Acted(delivery=delivery, realised={})
    arm_m = np.array([spec.forward_m, spec.left_m, spec.up_m])
    world_m = _carrier(spec.of, reference, site.motion) @ arm_m
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


def _carrier(
    of: Literal["target", "ego"], reference: GnssReference, motion: Motion
) -> Float64[np.ndarray, "m 3 3"]:
    """Attitude in the world of who carries the antenna, at each fix."""
    if of == "ego":
        return np.asarray(motion.shaken_ego(reference.fix_ns)[0])
    R_ego, p_ego = motion.ego(reference.fix_ns)
    centre_m = p_ego + np.einsum("nij,nj->ni", R_ego, reference.centre_ego_m)
    for info in motion.world.objects:
        R_object, p_object = motion.object_centre(info.object_id, reference.fix_ns)
        if np.all(np.abs(p_object - centre_m) < SAME_M):
            return np.asarray(R_object)
    raise ValueError("the reference's centre is no object's")


# -- receipts -----------------------------------------------------------------------------------------------


def lever_receipts(spec: ReferenceLever, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Mean shift along the arm, in the carrier's axes; and what of the shift is not along it."""
    before, after = step.before.reference, step.after.reference
    arm_m = np.array([spec.forward_m, spec.left_m, spec.up_m])
    length_m = float(np.linalg.norm(arm_m))
    quantity = f"lever arm of the {spec.of}"
    if before is None or after is None or not len(before.fix_ns):
        return unverifiable(spec, quantity, length_m, NO_REFERENCE)
    fixes = fixes_of(before, after)
    R_ego, _ = site.motion.ego(before.fix_ns)
    R_carrier = _carrier(spec.of, before, site.motion)
    in_carrier = np.einsum("nji,njk,nk->ni", R_carrier, R_ego, fixes.moved_m)
    found_m = in_carrier if spec.of == "target" else -in_carrier
    along = arm_m / length_m
    measured_m = float(np.mean(found_m @ along))
    # The pass's own heading error turns the arm as it turns everything else.
    straight = before.centre_ego_m + before.lever_m + before.noise_m
    far_m = np.maximum(np.linalg.norm(straight[:, :2], axis=1), 1e-6)
    turn_rad = float(np.max(np.linalg.norm(before.heading_m, axis=1) / far_m))
    across_m = float(np.abs(found_m - measured_m * along).max())
    return (
        judge(
            fault=spec.name, quantity=quantity, unit="m", requested=length_m,
            realised=step.realised["arm_m"], measured=measured_m,
            estimator_sd=SD_M + 0.1 * length_m * turn_rad**2, allowed=0.01 * length_m, note=SHIFT_NOTE,
        ),
        *untouched(
            fault=spec.name, quantity="shift across the arm", unit="m",
            found=((across_m, SD_M + 0.25 * length_m * turn_rad),), note=SHIFT_NOTE,
        ),
        *adds_up(spec, step),
    )  # fmt: skip


def bias_receipts(spec: ReferenceBias, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Length of the mean shift in the world's axes."""
    before, after = step.before.reference, step.after.reference
    if before is None or after is None or not len(before.fix_ns):
        return unverifiable(spec, "bias", spec.bias_cm, NO_REFERENCE)
    fixes = fixes_of(before, after)
    shift_m = _to_world(fixes.moved_m, fixes.fix_ns, site.motion)
    mean_m = shift_m.mean(axis=0)
    return (
        judge(
            fault=spec.name, quantity="bias", unit="cm", requested=spec.bias_cm,
            realised=step.realised["bias_cm"], measured=1e2 * float(np.linalg.norm(mean_m)),
            estimator_sd=1e2 * SD_M, allowed=0.01 * spec.bias_cm, note=SHIFT_NOTE,
        ),
        *untouched(
            fault=spec.name, quantity="change of the bias", unit="m",
            found=((float(np.abs(shift_m - mean_m).max()), SD_M),), note=SHIFT_NOTE,
        ),
        *adds_up(spec, step),
    )  # fmt: skip


def noise_receipts(spec: ReferenceNoise, step: Step, site: Site) -> tuple[Receipt, ...]:
    """RMS of the shifts per axis."""
    before, after = step.before.reference, step.after.reference
    if before is None or after is None or not len(before.fix_ns):
        return unverifiable(spec, "noise (SD)", spec.noise_cm, NO_REFERENCE)
    moved_m = fixes_of(before, after).moved_m
    return (
        judge(
            fault=spec.name, quantity="noise (SD)", unit="cm", requested=spec.noise_cm,
            realised=step.realised["noise_cm"], measured=1e2 * float(np.sqrt(np.mean(moved_m**2))),
            estimator_sd=1e2 * SD_M, allowed=5.0 * spec.noise_cm / np.sqrt(2.0 * moved_m.size),
            note=SHIFT_NOTE,
        ),
        *adds_up(spec, step),
    )  # fmt: skip


def float_receipts(spec: ReferenceFloat, step: Step, site: Site) -> tuple[Receipt, ...]:
    """For how long fixes are moved, and how far. Of the duration only what lies in the run can show."""
    before, after = step.before.reference, step.after.reference
    quantity = "time without an integer fix"
    if before is None or after is None or not len(before.fix_ns):
        return unverifiable(spec, quantity, spec.duration_s, NO_REFERENCE)
    period_s, asked_s = own_period_s(before), shown_s(before, spec.at_s, spec.duration_s)
    far_m = np.linalg.norm(fixes_of(before, after).moved_m, axis=1)
    hit = far_m > 0.01 * spec.least_m
    duration = judge(
        fault=spec.name, quantity=quantity, unit="s", requested=asked_s,
        realised=step.realised["duration_s"], measured=float(hit.sum()) * period_s,
        estimator_sd=SD_M, allowed=1.01 * period_s, note=SHIFT_NOTE,
    )  # fmt: skip
    if not step.realised["duration_s"] and not hit.any():
        return (duration,)
    size = judge(
        fault=spec.name, quantity="offset while floating", unit="m",
        requested=0.5 * (spec.least_m + spec.most_m), realised=step.realised["length_m"],
        measured=float(far_m[hit].mean()) if hit.any() else 0.0, estimator_sd=SD_M,
        allowed=0.5 * (spec.most_m - spec.least_m) + SD_M, note=SHIFT_NOTE,
    )  # fmt: skip
    return duration, size, *adds_up(spec, step)


def heading_receipts(spec: ReferenceHeading, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Mean turn of the positions about the ego, clockwise as a heading that is too large gives."""
    before, after = step.before.reference, step.after.reference
    if before is None or after is None or not len(before.fix_ns):
        return unverifiable(spec, "heading", spec.heading_deg, NO_REFERENCE)
    fixes = fixes_of(before, after)
    was, now = (xyz[:, 0] + 1j * xyz[:, 1] for xyz in (fixes.before_m, fixes.after_m))
    found_deg = -float(np.rad2deg(np.angle(np.sum(now * np.conj(was)))))
    short_m = float(np.abs(np.abs(now) - np.abs(was)).max())
    # The same direction as what was asked for, so that half a turn has one sign.
    found_deg = spec.heading_deg + (found_deg - spec.heading_deg + 180.0) % 360.0 - 180.0
    return (
        judge(
            fault=spec.name, quantity="heading", unit="deg", requested=spec.heading_deg,
            realised=step.realised["heading_deg"], measured=found_deg, estimator_sd=SD_DEG,
            allowed=max(0.01 * abs(spec.heading_deg), SD_DEG), note="turn of the fixes about the ego",
        ),
        *untouched(
            fault=spec.name, quantity="change of distance", unit="m", found=((short_m, SD_M),),
            note="distance of each fix",
        ),
        *adds_up(spec, step),
    )  # fmt: skip


def shown_s(reference: GnssReference, at_s: float, duration_s: float) -> float:
    """How much of a stretch of time lies within the fixes of a run."""
    first_s, last_s = float(reference.fix_ns[0]) * 1e-9, float(reference.fix_ns[-1]) * 1e-9
    end_s = min(at_s + duration_s, last_s + own_period_s(reference))
    return max(end_s - max(at_s, first_s), 0.0)


def _to_world(moved_m: np.ndarray, fix_ns: np.ndarray, motion: Motion) -> Float64[np.ndarray, "m 3"]:
    R_world_ego, _ = motion.ego(fix_ns)
    turned: np.ndarray = np.einsum("nij,nj->ni", R_world_ego, moved_m)
    return turned


DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=ReferenceLever, act=lever, receipts=lever_receipts),
    DeliveryFault(spec=ReferenceBias, act=bias, receipts=bias_receipts),
    DeliveryFault(spec=ReferenceNoise, act=noise, receipts=noise_receipts),
    DeliveryFault(spec=ReferenceFloat, act=floating, receipts=float_receipts),
    DeliveryFault(spec=ReferenceHeading, act=heading, receipts=heading_receipts),
)
"""In the order in which they act: receivers first, then the turn into the ego frame."""
