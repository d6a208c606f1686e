"""What several runs of one drive have in common, made once: its world, and the sweeps of its LiDAR.

A stress test runs one drive many times, with other errors. The world depends on the scenario and the seed
only, a sweep also on the LiDAR and on what shakes the body. Both are frozen, so that they can be handed out
again; only the newest ones are kept (sweeps of five seconds take 100 MB), so that tasks in the right order
gain most (`stress/run.py`). Reuse changes no byte: what is kept is found by all that it is made of.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from fusion.check import digest
from scenarios.scenario import Scenario, System
from simbench.motion import Motion
from simbench.sensors.rig import SensorRig
from simbench.world import World, build_world

Made = TypeVar("Made")


class Kept(Generic[Made]):
    """The newest things of a kind, by what they are made of. hits: how often one was found."""

    def __init__(self, most: int) -> None:
        self._most, self._kept, self.hits = most, OrderedDict[Hashable, Made](), 0

    def of(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """The one of this key, made if it is not there."""
        if key in self._kept:
            self.hits += 1
            self._kept.move_to_end(key)
            return self._kept[key]
        made = self._kept[key] = make()
        while len(self._kept) > self._most:
            self._kept.popitem(last=False)
        return made

    def clear(self) -> None:
        """Forget all."""
        self._kept.clear()
        self.hits = 0


WORLDS: Kept[World] = Kept(2)


def world_of(scenario: Scenario, system: System, seed: int) -> World:
    """`build_world`, once for all runs of a drive. Raises what it raises."""
    key = (scenario.model_dump_json(), system.model_dump_json(), seed)
    return WORLDS.of(key, lambda: build_world(scenario, system, seed))


def sweeps_key(rig: SensorRig, motion: Motion, duration_s: float, seed: int, ideal: bool) -> Hashable:
    """All that the sweeps of a drive depend on."""
    lidar = rig.lidar_name
    parts = (motion.T_ego_root, motion.T_ego_sensor[lidar], motion.body_shake, motion.flex.get(lidar))
    return (
        motion.world, motion.ego_actor, motion.pivot_m, lidar, rig.lidar.model_dump_json(), digest(parts),
        rig.sweeps(duration_s), seed, ideal,
    )  # fmt: skip
