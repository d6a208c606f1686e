"""Receipts of reference.lever_arm_m, bias_cm, noise_cm, float_s, heading_deg: the shift of each fix."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from scenarios.faults.reference import (
    ReferenceBias,
    ReferenceFloat,
    ReferenceHeading,
    ReferenceLever,
    ReferenceNoise,
)
from simbench.faults.fault import Site, Step
from simbench.faults.fixes import (
    NO_REFERENCE,
    adds_up,
    carrier,
    fixes_of,
    own_period_s,
    shown_s,
    unverifiable,
)
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.motion import Motion

SD_M = 1e-6
SD_DEG = 1e-6
SHIFT_NOTE = "shift of each fix"


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
    R_carrier = carrier(spec.of, before, site.motion)
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
            systematic=5.0 * SD_M + 0.5 * length_m * turn_rad**2, allowed=0.01 * length_m, note=SHIFT_NOTE,
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
            systematic=5e2 * SD_M, allowed=0.01 * spec.bias_cm, note=SHIFT_NOTE,
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
            systematic=5e2 * SD_M, allowed=5.0 * spec.noise_cm / np.sqrt(2.0 * moved_m.size),
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
        systematic=5.0 * SD_M, allowed=1.01 * period_s, note=SHIFT_NOTE,
    )  # fmt: skip
    if not step.realised["duration_s"] and not hit.any():
        return (duration,)
    size = judge(
        fault=spec.name, quantity="offset while floating", unit="m",
        requested=0.5 * (spec.least_m + spec.most_m), realised=step.realised["length_m"],
        measured=float(far_m[hit].mean()) if hit.any() else 0.0, systematic=5.0 * SD_M,
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
            realised=step.realised["heading_deg"], measured=found_deg, systematic=5.0 * SD_DEG,
            allowed=max(0.01 * abs(spec.heading_deg), SD_DEG), note="turn of the fixes about the ego",
        ),
        *untouched(
            fault=spec.name, quantity="change of distance", unit="m", found=((short_m, SD_M),),
            note="distance of each fix",
        ),
        *adds_up(spec, step),
    )  # fmt: skip


def _to_world(moved_m: np.ndarray, fix_ns: np.ndarray, motion: Motion) -> Float64[np.ndarray, "m 3"]:
    R_world_ego, _ = motion.ego(fix_ns)
    turned: np.ndarray = np.einsum("nij,nj->ni", R_world_ego, moved_m)
    return turned
