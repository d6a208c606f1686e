"""How messages travel: late, lost, twice, out of order. Stamps and content stay (but see `stale.py`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool

from scenarios.faults import Dropped, Duplicated, FaultSpec, Latency, Reordered
from scenarios.seeding import stream
from simbench.faults import stale, transport_receipts
from simbench.faults.chances import late_ns
from simbench.faults.delivery import Delivery, Shot, Sweep
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.flow import items, with_items
from simbench.faults.receipt import Receipt
from simbench.faults.struck import struck
from simbench.sensors.clock import queued_ns

HELD_NS = 1_000_000  # how long after its successor a message arrives that was held back

Items = Sequence[Sweep | Shot]
Carried = tuple[Items, dict[str, float]]
"""What arrives of one sensor's messages, and what was drawn for them by quantity."""


def _arriving(item: Sweep | Shot, arrival_ns: int) -> Sweep | Shot:
    return item.timed(item.stamp_ns, arrival_ns)


def lost(spec: Dropped, n: int, rng: np.random.Generator) -> Bool[np.ndarray, " n"]:
    """Which of n messages in a row are lost. A chain of two states that starts in its long-run share."""
    p, chance = 0.01 * spec.percent, rng.uniform(size=n)
    if spec.burst_frames == 0.0:
        alone: np.ndarray = chance < p
        return alone
    begins, goes_on = p / (spec.burst_frames * (1.0 - p)), 1.0 - 1.0 / spec.burst_frames
    gone = np.zeros(n, dtype=bool)
    for i in range(n):
        gone[i] = chance[i] < (p if i == 0 else goes_on if gone[i - 1] else begins)
    return gone


def _dropped(spec: Dropped, now: Items, rng: np.random.Generator) -> Carried:
    gone = lost(spec, len(now), rng)
    starts = int(np.sum(gone & ~np.concatenate([[False], gone[:-1]])))
    drawn = {"lost": 100.0 * float(gone.mean())}
    if starts:
        drawn["burst"] = float(gone.sum()) / starts
    return [item for item, out in zip(now, gone, strict=True) if not out], drawn


def _duplicated(spec: Duplicated, now: Items, rng: np.random.Generator) -> Carried:
    again = rng.uniform(size=len(now)) < 0.01 * spec.percent
    after_ns = round(spec.after_ms * 1e6)
    copies = [
        _arriving(item, item.arrival_ns + after_ns) for item, twice in zip(now, again, strict=True) if twice
    ]
    drawn = {"twice": 100.0 * float(again.mean()), "copy after": spec.after_ms}
    return [*now, *copies], drawn


def _latency(spec: Latency, now: Items, rng: np.random.Generator) -> Carried:
    arrival = np.array([item.arrival_ns for item in now], dtype=np.int64)
    carried = queued_ns(arrival + late_ns(spec.latency_ms, spec.jitter_ms, len(now), rng))
    later_ms = (carried - arrival) * 1e-6
    drawn = {"mean latency": float(later_ms.mean()), "least latency": float(later_ms.min())}
    return [_arriving(item, int(at)) for item, at in zip(now, carried, strict=True)], drawn


def _reordered(spec: Reordered, now: Items, rng: np.random.Generator) -> Carried:
    share = 0.01 * spec.percent
    drawn = rng.uniform(size=len(now))
    held = drawn < share / (1.0 - share)  # of those whose predecessor was not held back
    held[:1] = drawn[:1] < share
    held[-1:] = False  # nothing comes behind the last one
    for i in range(1, len(held)):
        held[i] = held[i] and not held[i - 1]
    arrival = [item.arrival_ns for item in now]
    carried = [_arriving(item, arrival[i + 1] + HELD_NS) if held[i] else item for i, item in enumerate(now)]
    return carried, {"overtaken": 100.0 * float(held[:-1].mean()) if len(held) > 1 else 0.0}


def _entry(
    kind: type[FaultSpec],
    carry: Callable[[Any, Items, np.random.Generator], Carried],
    receipts: Callable[[Any, Step, Site], tuple[Receipt, ...]],
) -> DeliveryFault:
    """A fault that carries the messages of every struck sensor as `carry` says."""

    def act(spec: FaultSpec, delivery: Delivery, site: Site) -> Acted:
        if spec.is_off:
            return Acted(delivery=delivery, realised={})
        changed: dict[str, Items] = {}
        realised: dict[str, float] = {}
        for sensor in struck(spec, site.rig):
            now = items(delivery, site.rig, sensor)
            if not now:
                continue
            arrived, drawn = carry(spec, now, stream(site.seed, "fault", spec.name, sensor))
            changed[sensor] = arrived
            realised |= {f"{sensor} {quantity}": value for quantity, value in drawn.items()}
        return Acted(delivery=with_items(delivery, site.rig, changed), realised=realised)

    return DeliveryFault(spec=kind, act=act, receipts=receipts)


DELIVERED: tuple[DeliveryFault, ...] = (
    *stale.DELIVERED,
    _entry(Dropped, _dropped, transport_receipts.dropped),
    _entry(Latency, _latency, transport_receipts.latency),
    _entry(Reordered, _reordered, transport_receipts.reordered),
    _entry(Duplicated, _duplicated, transport_receipts.duplicated),
)
"""What the driver hands over, then what the network loses, delays, mixes up and repeats.

Copies come last: nobody could see that one of them overtook the other.
"""
