"""What stamps claim: a clock that is off, drifts, jumps; a stamp of another instant."""

from __future__ import annotations

from simbench.faults.fault import DeliveryFault

DELIVERED: tuple[DeliveryFault, ...] = ()
