"""What the receipts of reference faults share: the same fixes before and after, and a sum that must hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64

from scenarios.faults import FaultSpec
from simbench.faults.fault import Step
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.motion import Motion
from simbench.truth import GnssReference

EXACT_M = 1e-9  # of a difference of two stored positions
SAME_M = 0.05  # a centre that is this near to an object's is that object's
NO_REFERENCE = "this run has no GNSS reference"
PARTS_NOTE = "position less centre, lever, heading and noise"


@dataclass(frozen=True, kw_only=True, eq=False)
class Fixes:
    """Fixes that there are both before and after: their instants and how far each was moved, ego frame."""

    fix_ns: Int64[np.ndarray, " m"]
    moved_m: Float64[np.ndarray, "m 3"]
    before_m: Float64[np.ndarray, "m 3"]
    after_m: Float64[np.ndarray, "m 3"]


def fixes_of(before: GnssReference, after: GnssReference) -> Fixes:
    """Pair the fixes by their instant."""
    fix_ns, old, new = np.intersect1d(before.fix_ns, after.fix_ns, return_indices=True)
    was, now = before.position_ego_m[old], after.position_ego_m[new]
    return Fixes(fix_ns=fix_ns, moved_m=now - was, before_m=was, after_m=now)


def own_period_s(reference: GnssReference) -> float:
    """Of the receivers; 0 with fewer than two fixes."""
    return float(np.median(np.diff(reference.fix_ns))) * 1e-9 if len(reference.fix_ns) > 1 else 0.0


def unverifiable(spec: FaultSpec, quantity: str, requested: float, why: str) -> tuple[Receipt, ...]:
    """Nothing that the fault could act on."""
    return (
        judge(
            fault=spec.name, quantity=quantity, unit=spec.unit, requested=requested, realised=requested,
            measured=None, systematic=5.0 * EXACT_M, allowed=0.0, note=why,
        ),
    )  # fmt: skip


def adds_up(spec: FaultSpec, step: Step) -> tuple[Receipt, ...]:
    """That the parts still add up to the position, and that the exact centre is that of before."""
    after, before = step.after.reference, step.before.reference
    if after is None or before is None or not len(after.fix_ns):
        return ()
    parts = after.centre_ego_m + after.lever_m + after.heading_m + after.noise_m
    off_m = float(np.abs(after.position_ego_m - parts).max())
    _, old, new = np.intersect1d(before.fix_ns, after.fix_ns, return_indices=True)
    moved_m = float(np.abs(before.centre_ego_m[old] - after.centre_ego_m[new]).max(initial=0.0))
    return untouched(
        fault=spec.name,
        quantity="sum of the parts, true centre",
        unit="m",
        found=((off_m, EXACT_M), (moved_m, EXACT_M)),
        note=PARTS_NOTE,
    )


def shown_s(reference: GnssReference, at_s: float, duration_s: float) -> float:
    """How much of a stretch of time lies within the fixes of a run."""
    first_s, last_s = float(reference.fix_ns[0]) * 1e-9, float(reference.fix_ns[-1]) * 1e-9
    end_s = min(at_s + duration_s, last_s + own_period_s(reference))
    return max(end_s - max(at_s, first_s), 0.0)


def carrier(
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
