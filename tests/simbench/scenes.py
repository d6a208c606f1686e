"""Worlds for the tests of sensors and motion: a few analytic shapes, or the catalogue's own scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fusion.geometry import Transform
from scenarios.equipment import rig_sensors
from scenarios.load import load_scenario
from scenarios.scenario import CameraSensor, LidarSensor, Path, ReturnNoise, Scenario, System
from simbench.looks import plain_looks
from simbench.motion import Motion
from simbench.path import Track, make_track
from simbench.sensors import rays
from simbench.sensors.rig import SensorRig, assemble
from simbench.shake import Shake
from simbench.truth import ObjectInfo
from simbench.world import GROUND, Body, MovingActor, World, build_world, tabulate_chain

SystemName = Literal["car", "wearable"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """A catalogue scenario of one seed with its world built; nothing has moved yet."""

    scenario: Scenario
    system: System
    rig: SensorRig
    world: World


def staged(scenario: str, system: SystemName, seed: int) -> Stage:
    """A scenario of the catalogue, by name and seed."""
    family = load_scenario(scenario)
    concrete = family.resolve(seed)
    played = concrete.system(system)
    declared = family.rig(played.rig)
    return Stage(
        scenario=concrete,
        system=played,
        rig=assemble(declared, rig_sensors(declared, family.beside)),
        world=build_world(concrete, played, seed),
    )


def a_shake(axes: int, rms: float, seed: int = 0) -> Shake:
    """A few incommensurate sinusoids with this RMS (over a long time) on every axis."""
    rng = np.random.default_rng(seed)
    frequency = np.array([0.7, 1.9, 5.3, 11.7])
    return Shake(
        frequency_hz=frequency,
        amplitude=np.full((axes, 4), rms * np.sqrt(2.0 / 4.0)),
        phase_rad=rng.uniform(0.0, 2.0 * np.pi, (axes, 4)),
    )


def scripted_motion(of: Stage) -> Motion:
    """The stage's motion without any shake."""
    return Motion(
        world=of.world,
        ego_actor=next(i for i, actor in enumerate(of.world.actors) if actor.name == of.system.ego),
        T_ego_root=of.rig.T_ego_root,
        T_ego_sensor=of.rig.T_ego_sensor,
    )


def shaken_motion(of: Stage, rms_rad: float = 0.02) -> Motion:
    """The same with its body shaking and one camera's bracket flexing."""
    return replace(
        scripted_motion(of),
        body_shake=a_shake(4, rms_rad),
        flex={next(iter(of.rig.cameras)): a_shake(3, rms_rad, seed=1)},
    )


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A primitive. `mover`: which of the tracks carries it (0 is the ego); None: it stands."""

    kind: int
    size_m: tuple[float, float, float]
    xyz_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: np.ndarray | None = None
    mover: int | None = None
    reflectivity: float = 0.8
    roughness_gain: float = 0.0


def straight(xy_m: tuple[float, float], heading_deg: float, speed_mps: float) -> Track:
    """A straight drive at constant speed."""
    return make_track(Path(waypoints_m=(xy_m,), heading_deg=heading_deg, speed_mps=speed_mps))


def bound_m(kind: int, size_m: Sequence[float]) -> float:
    """Radius of a primitive's bounding sphere about its own centre."""
    a, b, c = size_m
    return {
        rays.PLANE: np.inf,
        rays.SPHERE: a,
        rays.CAPSULE: a + b,
        rays.CYLINDER: float(np.hypot(a, b)),
        rays.ELLIPSOID: max(a, b, c),
        rays.BOX: float(np.sqrt(a * a + b * b + c * c)),
    }[kind]


def toy_world(shapes: Sequence[Shape], tracks: Sequence[Track]) -> World:
    """Shapes on roots that follow tracks; object i is the one on track i, what stands is the ground's."""
    bodies = [
        Body(
            name=f"mover{i}/root", model_id=-1, actor=i, parent=0, rotation=np.eye(3), position_m=np.zeros(3),
            joint="", axis=np.zeros(3), anchor_m=np.zeros(3), qpos=-1, wheel_radius_m=0.0, swing_sign=1.0,
        )
        for i in range(len(tracks))
    ]  # fmt: skip
    n = len(tracks)
    return World(
        model=None,
        geoms=rays.Geoms(
            kind=np.array([s.kind for s in shapes], dtype=np.int32),
            size_m=np.array([s.size_m for s in shapes]).reshape(-1, 3),
            body=np.array([0 if s.mover is None else s.mover + 1 for s in shapes], dtype=np.int32),
            rotation=np.array([np.eye(3) if s.rotation is None else s.rotation for s in shapes]).reshape(
                -1, 3, 3
            ),
            position_m=np.array([s.xyz_m for s in shapes]).reshape(-1, 3),
            bound_m=np.array([bound_m(s.kind, s.size_m) for s in shapes]),
        ),
        geom_model_id=np.arange(len(shapes), dtype=np.int32),
        geom_object=np.array([GROUND if s.mover is None else s.mover for s in shapes], dtype=np.int32),
        reflectivity=np.array([s.reflectivity for s in shapes]),
        roughness_gain=np.array([s.roughness_gain for s in shapes]),
        looks=plain_looks(len(shapes)),
        objects=tuple(
            ObjectInfo(object_id=i, name=f"mover{i}", category="car", size_m=(1.0, 1.0, 1.0))
            for i in range(n)
        ),
        scale=(1.0,) * n,
        box_centre_m=np.zeros((n, 3)),
        static_rotation=np.broadcast_to(np.eye(3), (n, 3, 3)).copy(),
        static_position_m=np.zeros((n, 3)),
        bodies=tuple(bodies),
        chain=tabulate_chain(bodies),
        actors=tuple(
            MovingActor(name=f"mover{i}", object_id=i, body=i + 1, mocap=-1, track=track)
            for i, track in enumerate(tracks)
        ),
        actor_of_object={i: i for i in range(n)},
    )


def toy_motion(world: World, T_ego_lidar: Transform) -> Motion:
    """Track 0 carries the LiDAR."""
    return Motion(
        world=world, ego_actor=0, T_ego_root=Transform.identity(), T_ego_sensor={"lidar": T_ego_lidar}
    )


def a_camera(**changes: object) -> CameraSensor:
    """A plain camera: global shutter, no noise."""
    fields: dict[str, object] = {
        "kind": "camera",
        "rate_hz": 10.0,
        "width_px": 96,
        "height_px": 60,
        "fov_deg": 60.0,
        "trigger": "free_run",
        "exposure_ms": 2.0,
        "stamp": "mid_exposure",
        "latency_ms": 0.0,
        "source": "a test",
    }
    return CameraSensor.model_validate({**fields, **changes})


def ideal_lidar(**changes: object) -> LidarSensor:
    """A small spinning LiDAR without noise."""
    fields: dict[str, object] = {
        "kind": "lidar",
        "rate_hz": 10.0,
        "columns": 256,
        "clockwise": True,
        "start_azimuth_deg": 90.0,
        "elevation_deg": tuple(np.linspace(16.0, -16.0, 16).tolist()),
        "azimuth_offset_deg": tuple(np.tile([3.0, 1.0, -1.0, -3.0], 4).tolist()),
        "min_range_m": 0.8,
        "range_at_10_percent_m": 40.0,
        "range_at_80_percent_m": 120.0,
        "resolution_m": 0.0,
        "noise": ReturnNoise(high_m=0.0, medium_m=0.0, low_m=0.0),
        "angle_noise_deg": 0.0,
        "false_positive_rate": 0.0,
        "latency_ms": 10.0,
        "source": "a test",
    }
    return LidarSensor.model_validate({**fields, **changes})
