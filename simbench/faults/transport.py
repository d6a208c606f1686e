"""How messages travel: late, lost, twice, out of order."""

from __future__ import annotations

from simbench.faults.fault import DeliveryFault

DELIVERED: tuple[DeliveryFault, ...] = ()
