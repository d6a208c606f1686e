"""What the GNSS reference says: first where the target is, then which fixes there are and when.

An error of the receivers comes before the turn into the ego frame, so that the heading's error turns it too.
"""

from __future__ import annotations

from simbench.faults import fix_error, fix_time
from simbench.faults.fault import DeliveryFault

DELIVERED: tuple[DeliveryFault, ...] = (*fix_error.DELIVERED, *fix_time.DELIVERED)
