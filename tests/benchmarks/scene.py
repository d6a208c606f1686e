"""The scene of the ray rows, the same for all: one instant of a catalogue scenario as loose primitives.

The scenario's own 364 primitives are cut to the nearest, or its background is made denser until there are
enough. All stand still, as the rivals ask for; the ground is a finite plate, because not every rival knows an
endless one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int32

from scenarios.load import load_scenario
from scenarios.scenario import Scatter
from simbench.capture import set_in_motion
from simbench.motion import Motion
from simbench.sensors import rays
from simbench.sensors.beams import BeamTable, beam_table
from simbench.stage import Stage, set_stage

SCENARIO, SYSTEM, SEED = "overtake-approach", "car", 0
INSTANT_NS = 2_600_000_000  # half of the drive: the rider is 15 m ahead
GROUND_HALF_M = 400.0
DENSER = (
    Scatter(part="pedestrian", category="pedestrian", count=10, area_m=(-30, 3.2, 110, 5)),
    Scatter(part="pedestrian", category="pedestrian", count=10, area_m=(-30, -8, 110, -5.5)),
    Scatter(part="tree", category="tree", count=10, area_m=(-40, 13, 120, 22)),
    Scatter(part="post", category="post", count=10, area_m=(-40, -8, 120, -5.5)),
    Scatter(part="car", category="car", count=4, area_m=(-40, 6, 120, 9), align_deg=0.0),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Primitives:
    """Primitives at rest in the world frame, and one sweep of rays from one point.

    direction [c k 3]: of the beams of `table`, column by column, each from the lowest slope up.
    """

    kind: Int32[np.ndarray, " g"]
    size_m: Float64[np.ndarray, "g 3"]
    bound_m: Float64[np.ndarray, " g"]
    rotation: Float64[np.ndarray, "g 3 3"]
    position_m: Float64[np.ndarray, "g 3"]
    table: BeamTable
    R_world_lidar: Float64[np.ndarray, "3 3"]
    origin_m: Float64[np.ndarray, " 3"]
    direction: Float64[np.ndarray, "c k 3"]

    @property
    def flat_direction(self) -> Float64[np.ndarray, "n 3"]:
        """All rays in one list."""
        return self.direction.reshape(-1, 3)


def catalogue_stage(denser: bool = False, size_px: tuple[int, int] | None = None) -> Stage:
    """The catalogue's world, on wish with more things standing in it."""
    family = load_scenario(SCENARIO)
    scenario = family.resolve(SEED)
    if denser:
        scenario = scenario.model_copy(update={"background": (*scenario.background, *DENSER)})
    return set_stage(family, scenario, SYSTEM, family.fault_set(scenario), SEED, size_px)


def still_motion(stage: Stage) -> Motion:
    """The scripted drive without shake."""
    return set_in_motion(stage.world, stage.rig, stage.system.ego, None)


def primitives(count: int, columns: int | None = None) -> Primitives:
    """The `count` primitives nearest to the LiDAR, and its rays (all columns, or so many).

    ValueError where the scene has fewer primitives than asked for.
    """
    stage = catalogue_stage()
    if len(stage.world.geoms.kind) < count:
        stage = catalogue_stage(denser=True)
    if len(stage.world.geoms.kind) < count:
        raise ValueError(f"the scene has {len(stage.world.geoms.kind)} primitives, not {count}")
    motion = still_motion(stage)
    t_ns = np.array([INSTANT_NS])
    (R_world_lidar,), (origin_m,) = motion.sensor(stage.rig.lidar_name, t_ns)
    (body_rotation,), (body_position,) = motion.poses(t_ns)
    sensor = stage.rig.lidar if columns is None else stage.rig.lidar.model_copy(update={"columns": columns})
    table = beam_table(sensor)
    geoms = stage.world.geoms
    rotation = body_rotation[geoms.body] @ geoms.rotation
    position = body_position[geoms.body] + np.einsum(
        "gij,gj->gi", body_rotation[geoms.body], geoms.position_m
    )
    plane = geoms.kind == rays.PLANE
    distance_m = np.where(plane, -1.0, np.linalg.norm(position - origin_m, axis=1) - geoms.bound_m)
    keep = np.sort(np.argsort(distance_m, kind="stable")[:count])
    size = geoms.size_m.copy()
    size[plane] = (GROUND_HALF_M, GROUND_HALF_M, 1.0)
    return Primitives(
        kind=geoms.kind[keep],
        size_m=size[keep],
        bound_m=geoms.bound_m[keep],
        rotation=rotation[keep],
        position_m=position[keep],
        table=table,
        R_world_lidar=R_world_lidar,
        origin_m=origin_m,
        direction=table.direction[:, table.slots[0]] @ R_world_lidar.T,
    )


def mujoco_model(scene: Primitives) -> tuple[Any, Any]:
    """The same primitives as MuJoCo's (model, data), with a site `lidar` at the rays' origin."""
    import mujoco

    spec = mujoco.MjSpec()
    for kind, size, rotation, position in zip(
        scene.kind, scene.size_m, scene.rotation, scene.position_m, strict=True
    ):
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, rotation.reshape(9))
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom(int(kind)), size=size, pos=position, quat=quat, contype=0, conaffinity=0
        )
    spec.worldbody.add_site(name="lidar", pos=scene.origin_m)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def our_geoms(scene: Primitives) -> rays.Geoms:
    """The same primitives as the ray kernel takes them, all fixed to body 0."""
    return rays.Geoms(
        kind=scene.kind,
        size_m=scene.size_m,
        body=np.zeros(len(scene.kind), dtype=np.int32),
        rotation=scene.rotation,
        position_m=scene.position_m,
        bound_m=scene.bound_m,
    )


def angles(scene: Primitives) -> tuple[Float32[np.ndarray, " n"], Float32[np.ndarray, " n"]]:
    """Azimuth and elevation of the rays in the world frame, radians."""
    x, y, z = scene.flat_direction.T
    return np.arctan2(y, x).astype(np.float32), np.arcsin(z).astype(np.float32)
