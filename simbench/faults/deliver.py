"""Faults that act on what was measured, one after the other in the order in which a vehicle does it.

The detector's first (it sees the picture as it was taken), then those of the LiDAR and of the pictures, then
what drivers and networks do to stamps and arrivals, and apart from all of them the reference.
"""

from __future__ import annotations

from scenarios.fault_set import FaultSet
from simbench.faults import boxes, pixels, points, position, stamps, transport
from simbench.faults.delivery import Delivery, counted
from simbench.faults.fault import DeliveryFault, Site, Step

DELIVERY_FAULTS: tuple[DeliveryFault, ...] = (
    *boxes.DELIVERED,
    *points.DELIVERED,
    *pixels.DELIVERED,
    *stamps.DELIVERED,
    *transport.DELIVERED,
    *position.DELIVERED,
)
"""In the order in which they act."""


def deliver(measured: Delivery, faults: FaultSet, site: Site) -> tuple[Delivery, tuple[Step, ...]]:
    """What arrives of what was measured, and every step on the way."""
    steps: list[Step] = []
    now = measured
    for fault in DELIVERY_FAULTS:
        spec = faults.get(fault.spec)
        if spec is None:
            continue
        acted = fault.act(spec, now, site)
        steps.append(Step(spec=spec, before=now, after=acted.delivery, realised=acted.realised))
        now = acted.delivery
    return (counted(now) if steps else now), tuple(steps)
