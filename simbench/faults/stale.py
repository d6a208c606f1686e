"""Pictures of another time: the image and boxes of frames before, under the stamp of this one.

Message and truth move together: what is delivered tells, in the truth, when it was really taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from scenarios.faults import Frozen, StaleFrames
from scenarios.seeding import stream
from simbench.faults.chances import share_allowed
from simbench.faults.delivery import Delivery, Shot
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.flow import COUNT_SD, elsewhere
from simbench.faults.receipt import Receipt, judge
from simbench.faults.struck import struck

NOTE = "boxes and picture of every frame against those delivered before, and their true exposures"


def _under(shown: Shot, now: Shot) -> Shot:
    """What one exposure shows under the times of another."""
    return shown.timed(now.stamp_ns, now.arrival_ns)


def _stale(spec: StaleFrames, delivery: Delivery, site: Site) -> Acted:
    if spec.is_off:
        return Acted(delivery=delivery, realised={})
    shots, k = dict(delivery.shots), spec.frames
    for name in struck(spec, site.rig):
        now = _in_order(delivery.shots[name])
        shots[name] = tuple(_under(now[i - k], now[i]) for i in range(k, len(now)))
    realised = {f"{name} delay": float(k) for name in struck(spec, site.rig)}
    return Acted(delivery=_with(delivery, shots), realised=realised)


def _frozen(spec: Frozen, delivery: Delivery, site: Site) -> Acted:
    if spec.is_off:
        return Acted(delivery=delivery, realised={})
    shots, realised = dict(delivery.shots), {}
    for name in struck(spec, site.rig):
        now = _in_order(delivery.shots[name])
        frozen = stream(site.seed, "fault", spec.name, name).uniform(size=len(now)) < 0.01 * spec.percent
        frozen[:1] = False
        source = np.maximum.accumulate(np.where(frozen, 0, np.arange(len(now))))
        shots[name] = tuple(_under(now[s], now[i]) for i, s in enumerate(source))
        realised[f"{name} frozen"] = 100.0 * float(frozen[1:].mean()) if len(now) > 1 else 0.0
    return Acted(delivery=_with(delivery, shots), realised=realised)


def _in_order(shots: Sequence[Shot]) -> list[Shot]:
    return sorted(shots, key=lambda shot: shot.arrival_ns)


def _with(delivery: Delivery, shots: dict[str, tuple[Shot, ...]]) -> Delivery:
    return Delivery(
        sweeps=delivery.sweeps, shots=shots, motions=delivery.motions, reference=delivery.reference
    )


# -- receipts ---------------------------------------------------------------------------------------------


def _ages(step: Step, camera: str) -> list[int] | None:
    """How many frames old what every delivered frame shows is; None where message and truth disagree.

    Age by the truth: places between the exposure that this arrival had and the one that is shown. Boxes and
    picture must be those that the shown exposure had.
    """
    before = _in_order(step.before.shots[camera])
    place = {shot.arrival_ns: i for i, shot in enumerate(before)}
    taken = {shot.truth.capture_ns: i for i, shot in reversed(list(enumerate(before)))}
    ages = []
    for shot in _in_order(step.after.shots[camera]):
        i, shown = place.get(shot.arrival_ns), taken.get(shot.truth.capture_ns)
        if i is None or shown is None or not _shows(shot, before[shown]):
            return None
        ages.append(i - shown)
    return ages


def _shows(delivered: Shot, taken: Shot) -> bool:
    """Whether one exposure has the boxes and the picture of another."""
    if delivered.detections.boxes != taken.detections.boxes:
        return False
    if delivered.image is None or taken.image is None:
        return delivered.image is taken.image
    return np.array_equal(delivered.image.rgb, taken.image.rgb)


def _stale_receipts(spec: StaleFrames, step: Step, site: Site) -> tuple[Receipt, ...]:
    result = []
    for name in struck(spec, site.rig):
        ages, many = _ages(step, name), len(step.before.shots[name])
        measured: float | None = float("nan") if ages is None else None
        if ages:
            measured = float(np.mean(ages))
        lost = many - len(step.after.shots[name])
        result.append(
            judge(
                fault=spec.name, quantity=f"{name} delay", unit="frames", requested=float(spec.frames),
                realised=step.realised.get(f"{name} delay", 0.0), measured=measured,
                systematic=5.0 * COUNT_SD, allowed=0.0, note=NOTE if ages else "no frame was delivered",
            )
        )  # fmt: skip
        result.append(
            judge(
                fault=spec.name, quantity=f"{name} frames without a picture", unit="frames",
                requested=float(min(spec.frames, many)), realised=float(min(spec.frames, many)),
                measured=float(lost), systematic=5.0 * COUNT_SD, allowed=0.0, note="messages counted",
            )
        )  # fmt: skip
    return (*result, *elsewhere(spec, step, site.rig, ("stamp_ns", "arrival_ns")))


def _frozen_receipts(spec: Frozen, step: Step, site: Site) -> tuple[Receipt, ...]:
    """The share of frames after a camera's first that show what the frame before showed."""
    result = []
    counted = {name: _repeats(step, name) for name in struck(spec, site.rig)}
    for name, (repeats, many) in counted.items():
        result.append(
            judge(
                fault=spec.name, quantity=f"{name} frozen", unit="%", requested=spec.percent,
                realised=step.realised.get(f"{name} frozen", 0.0),
                measured=100.0 * repeats / many if many else None, systematic=5.0 * COUNT_SD,
                allowed=100.0 * share_allowed(0.01 * spec.percent, many), note=NOTE,
            )
        )  # fmt: skip
    return (*result, *elsewhere(spec, step, site.rig, ("stamp_ns", "arrival_ns")))


def _repeats(step: Step, camera: str) -> tuple[float, int]:
    """Frames that repeat the one before, of how many; nan where message and truth disagree."""
    ages = _ages(step, camera)
    if ages is None or len(ages) != len(step.before.shots[camera]):
        return float("nan"), max(len(step.before.shots[camera]) - 1, 1)
    shots = _in_order(step.after.shots[camera])
    again = sum(a.truth.capture_ns == b.truth.capture_ns for a, b in pairwise(shots))
    return float(again), max(len(shots) - 1, 0)


DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=StaleFrames, act=_stale, receipts=_stale_receipts),
    DeliveryFault(spec=Frozen, act=_frozen, receipts=_frozen_receipts),
)
