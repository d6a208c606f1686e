"""What the LiDAR delivers: points that are lost, false or moved."""

from __future__ import annotations

from simbench.faults import points_dimmed, points_false, points_lost, points_moved, weather
from simbench.faults.fault import DeliveryFault

DELIVERED: tuple[DeliveryFault, ...] = (
    *weather.DELIVERED,
    *points_dimmed.DELIVERED,
    *points_lost.DELIVERED,
    *points_false.DELIVERED,
    *points_moved.DELIVERED,
)
"""As light goes: through the air and the window, to the receiver, which then reads ranges and angles."""
