"""What the detector delivers: misses, false boxes, swaps, merged and split boxes, lag."""

from __future__ import annotations

from simbench.faults.fault import DeliveryFault

DELIVERED: tuple[DeliveryFault, ...] = ()
