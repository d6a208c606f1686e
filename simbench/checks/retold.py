"""The same drive in another LiDAR frame, and an hour later: nothing changes but the words.

The frame: points turned a quarter about the LiDAR's own z axis, and `T_ego_lidar` turned back, so that no
point moves in the ego frame. A quarter turn swaps coordinates and flips a sign: exact in floating point.

The hour: stamps and arrivals of all messages an hour on. Only differences of times mean anything, and these
are whole nanoseconds. What the answers say in time is an hour on too; their places are the same.

Tolerance: rounding (`compare.py`), since a pipeline may keep times as floating-point seconds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion.messages import LidarScan
from simbench.checks.compare import compare
from simbench.checks.finding import Finding, Story, ask
from simbench.plugins import Factory

HOUR_NS = 3_600_000_000_000
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # R_turned_lidar


def find_turned(factory: Factory, story: Story) -> Finding:
    """The answers to a story and to the one in a LiDAR frame that is turned."""
    return compare(ask(factory, story), ask(factory, turned(story)))


def find_later(factory: Factory, story: Story) -> Finding:
    """The answers to a story and to the one an hour later."""
    return compare(ask(factory, story), ask(factory, later(story)))


def turned(story: Story) -> Story:
    """The story with all LiDAR frames turned by a quarter about their z axes."""
    lidars = {message.sensor for message in story.messages if isinstance(message, LidarScan)}
    poses = {
        name: replace(pose, rotation=pose.rotation @ QUARTER.T) if name in lidars else pose
        for name, pose in story.calibration.T_ego_sensor.items()
    }
    messages = tuple(
        replace(message, xyz_m=message.xyz_m @ QUARTER.T.astype(np.float32))
        if isinstance(message, LidarScan)
        else message
        for message in story.messages
    )
    return Story(calibration=replace(story.calibration, T_ego_sensor=poses), messages=messages)


def later(story: Story) -> Story:
    """The story an hour later."""
    messages = tuple(
        replace(message, stamp_ns=message.stamp_ns + HOUR_NS, arrival_ns=message.arrival_ns + HOUR_NS)
        for message in story.messages
    )
    return Story(calibration=story.calibration, messages=messages)
