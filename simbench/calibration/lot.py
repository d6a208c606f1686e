"""Where a rig is calibrated: its carrier stands still on a lot; parked cars, trees and houses around it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from fusion.geometry import Transform
from scenarios.equipment import load_rig, rig_sensors
from scenarios.scenario import Actor, Path, Road, Scatter, Scenario, System
from simbench.capture import set_in_motion
from simbench.motion import Motion, at
from simbench.sensors.rig import SensorRig, assemble, resized
from simbench.world import build_world

CLEAR_M = 10.0  # free of things around the carrier, so that a board can be held there
EDGE_M = 26.0  # where houses stand


@dataclass(frozen=True, kw_only=True, eq=False)
class Lot:
    """A rig at rest in its surroundings; nothing moves. seed: of these and of all that is drawn."""

    rig: SensorRig
    motion: Motion
    seed: int

    def T_world_sensor(self, name: str) -> Transform:
        """Where a sensor stands."""
        return at(self.motion.sensor(name, np.zeros(1, dtype=np.int64)))


def make_lot(
    rig_name: str, seed: int, size_px: tuple[int, int] | None = None, beside: FilePath | None = None
) -> Lot:
    """The lot for a rig of the package, or of the folder `beside` a scenario file. BadInput: unknown rig."""
    declared = load_rig(rig_name, beside)
    rig = assemble(declared, rig_sensors(declared, beside))
    if size_px is not None:
        rig = resized(rig, *size_px)
    path = Path(waypoints_m=((0.0, 0.0),))
    carrier = Actor(part="car", category="car", path=path)
    if declared.body == "rider":
        carrier = Actor(part="escooter_rider", category="rider", path=path)
    system = System(
        duration_s=1.0, ego="ego", target=None, rig=rig_name,
        actors={"ego": carrier}
    )  # fmt: skip
    scenario = Scenario(
        name="calibration-lot",
        description="The rig stands on a lot",
        road=Road(kind="lot", width_m=80.0),
        systems={"car": system},
        background=_surroundings(),
    )
    world = build_world(scenario, system, seed)
    return Lot(rig=rig, motion=set_in_motion(world, rig, "ego", None), seed=seed)


def _surroundings() -> tuple[Scatter, ...]:
    near, far = CLEAR_M + 2.5, EDGE_M - 4.0
    sides = {
        90.0: (-far, -EDGE_M - 4.0, far, -EDGE_M), -90.0: (-far, EDGE_M, far, EDGE_M + 4.0),
        0.0: (-EDGE_M - 8.0, -8.0, -EDGE_M - 4.0, 8.0), 180.0: (EDGE_M + 4.0, -8.0, EDGE_M + 8.0, 8.0),
    }  # fmt: skip
    houses = tuple(
        Scatter(part="building", category="building", count=1, area_m=area, align_deg=align)
        for align, area in sides.items()
    )
    strips = (
        (-far, near, far, far),
        (-far, -far, far, -near),
        (near, -near, far, near),
        (-far, -near, -near, near),
    )
    things = tuple(
        scatter
        for area in strips
        for scatter in (
            Scatter(part="car", category="car", count=2, area_m=area),
            Scatter(part="tree", category="tree", count=2, area_m=area),
            Scatter(part="post", category="post", count=1, area_m=area),
        )
    )
    return houses + things
