"""What pictures lose: light, sharpness, bytes."""

from __future__ import annotations

from simbench.faults.fault import DeliveryFault

DELIVERED: tuple[DeliveryFault, ...] = ()
