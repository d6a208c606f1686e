"""Points that are fired at the same instant, in another order, are the same objects.

The contract lists a scan's points in firing order. A LiDAR fires all beams of a column at once, and in which
order they are then listed is the driver's own business; `ring` says which beam each is. So only points of
equal `offset_ns` change places. The objects must have the same points, the indices permuted with them.
Tolerance: rounding, as sums of the same numbers in another order differ by that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Int64

from fusion.messages import LidarScan
from scenarios.seeding import stream
from simbench.checks.compare import compare
from simbench.checks.finding import Finding, Story, ask
from simbench.plugins import Factory


def find(factory: Factory, story: Story) -> Finding:
    """The answers to a story and to the one with its points in another order."""
    scans = [message for message in story.messages if isinstance(message, LidarScan)]
    order = {(scan.sensor, scan.seq): another_order(scan) for scan in scans}
    if all(np.array_equal(moved, np.arange(len(moved))) for moved in order.values()):
        return Finding(verdict="cannot be said", why="no two points are fired at the same instant")
    messages = tuple(
        permuted(message, order[message.sensor, message.seq]) if isinstance(message, LidarScan) else message
        for message in story.messages
    )
    retold = Story(calibration=story.calibration, messages=messages)
    return compare(ask(factory, story), ask(factory, retold), origin=order)


def another_order(scan: LidarScan) -> Int64[np.ndarray, " n"]:
    """Indices of the points by firing time, those of equal time in random order."""
    place = stream(0, "check", "permute", scan.sensor, str(scan.seq)).random(len(scan.offset_ns))
    return np.lexsort((place, scan.offset_ns)).astype(np.int64)


def permuted(scan: LidarScan, order: Int64[np.ndarray, " n"]) -> LidarScan:
    """The scan whose point i is point `order[i]` of this one."""
    return replace(
        scan,
        xyz_m=scan.xyz_m[order],
        intensity=scan.intensity[order],
        offset_ns=scan.offset_ns[order],
        ring=scan.ring[order],
    )
