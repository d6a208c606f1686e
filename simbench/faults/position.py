"""What the GNSS reference says."""

from __future__ import annotations

from simbench.faults.fault import DeliveryFault

DELIVERED: tuple[DeliveryFault, ...] = ()
