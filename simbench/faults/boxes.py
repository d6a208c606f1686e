"""What the detector delivers: classes, misses, merged and split boxes, false boxes; then what a tracker makes
of them: lag, swapped ids.
"""

from __future__ import annotations

from simbench.faults import (
    box_classes,
    box_hard_misses,
    box_identity,
    box_lag,
    box_merging,
    box_misses,
    box_splitting,
    false_boxes,
)
from simbench.faults.fault import DeliveryFault

DELIVERED: tuple[DeliveryFault, ...] = (
    box_classes.FAULT,
    box_misses.FAULT,
    box_hard_misses.FAULT,
    box_merging.FAULT,
    box_splitting.FAULT,
    false_boxes.FAULT,
    box_lag.FAULT,
    box_identity.FAULT,
)
"""In the order in which they act."""
