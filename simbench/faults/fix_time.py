"""reference.period_s, outage_s, lag_ms: which fixes of the reference there are, and when they are known.

A fix that is missing takes all its parts with it; the fix before holds. Receipts: the fixes that are there
after, against those before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool

from scenarios.faults.reference import ReferenceLag, ReferenceOutage, ReferencePeriod
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.fixes import NO_REFERENCE, adds_up, own_period_s, shown_s, unverifiable
from simbench.faults.receipt import Receipt, judge
from simbench.truth import GnssReference

SD_S = 1e-6
SD_MS = 1e-6
SLACK_NS = 1000  # instants of fixes are whole nanoseconds
FIXES_NOTE = "instants of the fixes"


def period(spec: ReferencePeriod, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None or spec.period_s == 0.0 or not len(reference.fix_ns):
        return Acted(delivery=delivery, realised={})
    period_ns = round(spec.period_s * 1e9)
    # The first at or after a multiple of the period: the one before lies in another period.
    count = (reference.fix_ns - reference.fix_ns[0] + SLACK_NS) // period_ns
    kept = _kept(reference, np.diff(count, prepend=-1) > 0)
    steps_s = np.diff(kept.fix_ns) * 1e-9
    realised = {"period_s": float(steps_s.mean())} if len(steps_s) else {}
    return Acted(delivery=replace(delivery, reference=kept), realised=realised)


def outage(spec: ReferenceOutage, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None:
        return Acted(delivery=delivery, realised={})
    begin_ns, length_ns = round(spec.at_s * 1e9), round(spec.duration_s * 1e9)
    lost = (reference.fix_ns >= begin_ns) & (reference.fix_ns < begin_ns + length_ns)
    realised = {"duration_s": int(lost.sum()) * own_period_s(reference)}
    return Acted(delivery=replace(delivery, reference=_kept(reference, ~lost)), realised=realised)


def lag(spec: ReferenceLag, delivery: Delivery, site: Site) -> Acted:
    reference = delivery.reference
    if reference is None:
        return Acted(delivery=delivery, realised={})
    lag_ns = round(spec.lag_ms * 1e6)
    late = replace(reference, available_ns=reference.available_ns + lag_ns)
    return Acted(delivery=replace(delivery, reference=late), realised={"lag_ms": lag_ns * 1e-6})


def _kept(reference: GnssReference, kept: Bool[np.ndarray, " m"]) -> GnssReference:
    """Only some of the fixes."""
    return GnssReference(
        fix_ns=reference.fix_ns[kept],
        available_ns=reference.available_ns[kept],
        position_ego_m=reference.position_ego_m[kept],
        centre_ego_m=reference.centre_ego_m[kept],
        lever_m=reference.lever_m[kept],
        heading_m=reference.heading_m[kept],
        noise_m=reference.noise_m[kept],
    )


# -- receipts -----------------------------------------------------------------------------------------------


def period_receipts(spec: ReferencePeriod, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Mean time between fixes."""
    before, after, quantity = step.before.reference, step.after.reference, "time between fixes"
    if before is None or after is None or not len(before.fix_ns):
        return unverifiable(spec, quantity, spec.period_s, NO_REFERENCE)
    own_s = own_period_s(before)
    run_s = float(before.fix_ns[-1] - before.fix_ns[0]) * 1e-9
    if spec.period_s <= own_s:
        return unverifiable(spec, quantity, spec.period_s, f"the receivers give a fix every {own_s:g} s only")
    if spec.period_s > run_s:
        return unverifiable(spec, quantity, spec.period_s, f"the fixes span {run_s:g} s only")
    span_s = np.ptp(after.fix_ns) * 1e-9 if len(after.fix_ns) else 0.0
    steps = max(len(after.fix_ns) - 1, 1)
    return (
        judge(
            fault=spec.name, quantity=quantity, unit="s", requested=spec.period_s,
            realised=step.realised.get("period_s", 0.0), measured=float(span_s) / steps,
            systematic=5.0 * SD_S, allowed=0.01 * spec.period_s + own_s / max(int(run_s / spec.period_s), 1),
            note=FIXES_NOTE,
        ),
        *adds_up(spec, step),
    )  # fmt: skip


def outage_receipts(spec: ReferenceOutage, step: Step, site: Site) -> tuple[Receipt, ...]:
    """How many fixes there are less than before; and that they are missing where they should."""
    before, after, quantity = step.before.reference, step.after.reference, "time without a fix"
    if before is None or after is None or not len(before.fix_ns):
        return unverifiable(spec, quantity, spec.duration_s, NO_REFERENCE)
    own_s = own_period_s(before)
    gone_s = np.setdiff1d(before.fix_ns, after.fix_ns) * 1e-9
    stray = int(((gone_s < spec.at_s - 1e-6) | (gone_s >= spec.at_s + spec.duration_s)).sum())
    return (
        judge(
            fault=spec.name, quantity=quantity, unit="s",
            requested=shown_s(before, spec.at_s, spec.duration_s), realised=step.realised["duration_s"],
            measured=(len(gone_s) if not stray else -stray) * own_s, systematic=5.0 * SD_S,
            allowed=1.01 * own_s, note=FIXES_NOTE,
        ),
        *adds_up(spec, step),
    )  # fmt: skip


def lag_receipts(spec: ReferenceLag, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Mean shift of the instants at which fixes are known."""
    before, after, quantity = step.before.reference, step.after.reference, "lag"
    if before is None or after is None or not len(before.fix_ns):
        return unverifiable(spec, quantity, spec.lag_ms, NO_REFERENCE)
    _, old, new = np.intersect1d(before.fix_ns, after.fix_ns, return_indices=True)
    late_ms = (after.available_ns[new] - before.available_ns[old]) * 1e-6
    return (
        judge(
            fault=spec.name, quantity=quantity, unit="ms", requested=spec.lag_ms,
            realised=step.realised["lag_ms"], measured=float(np.mean(late_ms)) if len(late_ms) else None,
            systematic=5.0 * SD_MS, allowed=max(0.01 * spec.lag_ms, SD_MS), note="when each fix is known",
        ),
        *adds_up(spec, step),
    )  # fmt: skip


DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=ReferencePeriod, act=period, receipts=period_receipts),
    DeliveryFault(spec=ReferenceOutage, act=outage, receipts=outage_receipts),
    DeliveryFault(spec=ReferenceLag, act=lag, receipts=lag_receipts),
)
"""In the order in which they act: the receivers' rate, what is lost, when the rest is known."""
