"""Which targets of the command line are recorded data, and of what kind."""

from __future__ import annotations

KITTI = "kitti:"
MCAP = "mcap:"  # a ROS 2 bag: nobody knows the truth
STORED = "rec:"  # a folder that `simbench generate` wrote


def is_recorded(target: str) -> bool:
    """Whether a target names recorded data rather than a scenario."""
    return target.startswith((KITTI, STORED))


def is_stored(target: str) -> bool:
    """Whether a target names a recording of the bench's own."""
    return target.startswith(STORED)
