"""The scene as one MuJoCo model, and the same geoms as tables for the ray kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from scenarios.errors import BadInput
from scenarios.palette import palette
from scenarios.scenario import Path, Scenario, Surface, System
from scenarios.seeding import stream
from simbench import scatter
from simbench.bend import BentRoad
from simbench.looks import Looks, Paint, road_paint
from simbench.path import Track, make_track
from simbench.sensors import rays
from simbench.sensors.reflectance import roughness_gain
from simbench.truth import ObjectInfo

PARTS = FilePath(__file__).parent.parent / "scenarios" / "parts"
GROUND = -1  # object id of the ground
SHAPES = {
    rays.PLANE: "plane", rays.SPHERE: "sphere", rays.CAPSULE: "capsule", rays.ELLIPSOID: "ellipsoid",
    rays.CYLINDER: "cylinder", rays.BOX: "box",
}  # fmt: skip
AFTER_S = 0.5  # cameras and receivers go on for so long after the last sweep
EXTENT_M = 40.0  # what the shadow map covers around the sun's point
SUN_DIRECTION = (0.45, -0.5, -0.75)
SWAY_HZ, SWAY_RAD = 0.5, np.deg2rad(1.0)  # judgement: a standing rider at ease
STRIDE_HZ, STRIDE_RAD = 0.9, np.deg2rad(24.0)  # judgement: a walking adult


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """A body that moves. Row i of `World.bodies` has index i + 1 in poses; index 0 is the static world.

    parent: index of its parent (0 for an actor's root). joint: "" (fixed), "wheel", "swing" or "sway".
    """

    name: str
    model_id: int
    actor: int
    parent: int
    rotation: Float64[np.ndarray, "3 3"]  # R_parent_body with the joint at zero
    position_m: Float64[np.ndarray, " 3"]
    joint: str
    axis: Float64[np.ndarray, " 3"]
    anchor_m: Float64[np.ndarray, " 3"]
    qpos: int  # address in MuJoCo's qpos, -1 without joint
    wheel_radius_m: float
    swing_sign: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """The bodies' numbers as tables, for the kinematics kernel."""

    parent: Int64[np.ndarray, " b"]
    rotation: Float64[np.ndarray, "b 3 3"]
    position_m: Float64[np.ndarray, "b 3"]
    axis: Float64[np.ndarray, "b 3"]
    anchor_m: Float64[np.ndarray, "b 3"]


def tabulate_chain(bodies: Sequence[Body]) -> Chain:
    """The same bodies as arrays."""
    return Chain(
        parent=np.array([b.parent for b in bodies], dtype=np.int64),
        rotation=np.array([b.rotation for b in bodies]).reshape(-1, 3, 3),
        position_m=np.array([b.position_m for b in bodies]).reshape(-1, 3),
        axis=np.array([b.axis for b in bodies]).reshape(-1, 3),
        anchor_m=np.array([b.anchor_m for b in bodies]).reshape(-1, 3),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MovingActor:
    """A root that follows a track. `body`: its index in poses; `mocap`: its number among MuJoCo's."""

    name: str
    object_id: int
    body: int
    mocap: int
    track: Track


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """Everything that stands or moves. `geoms` and the tables beside it are indexed alike."""

    model: Any  # mujoco.MjModel
    geoms: rays.Geoms
    geom_model_id: Int32[np.ndarray, " g"]
    geom_object: Int32[np.ndarray, " g"]
    reflectivity: Float64[np.ndarray, " g"]
    roughness_gain: Float64[np.ndarray, " g"]  # see sensors/reflectance.py
    looks: Looks
    objects: tuple[ObjectInfo, ...]
    scale: tuple[float, ...]  # of each object against its part
    box_centre_m: Float64[np.ndarray, "o 3"]  # in the object's root frame
    static_rotation: Float64[np.ndarray, "o 3 3"]  # T_world_root of objects that stand
    static_position_m: Float64[np.ndarray, "o 3"]
    bodies: tuple[Body, ...]
    chain: Chain
    actors: tuple[MovingActor, ...]
    actor_of_object: dict[int, int]

    @cached_property
    def masks(self) -> tuple[Bool[np.ndarray, " g"], ...]:
        """By object id, which geoms belong to it."""
        return tuple(self.geom_object == info.object_id for info in self.objects)

    @cached_property
    def first_geom(self) -> tuple[int, ...]:
        """By object id, the first of its geoms."""
        return tuple(int(np.flatnonzero(mask)[0]) for mask in self.masks)

    def find(self, name: str) -> ObjectInfo:
        """The object of that name."""
        return next(o for o in self.objects if o.name == name)


def half_extent(
    kind: Int32[np.ndarray, " g"], size: Float64[np.ndarray, "g 3"], rotation: Float64[np.ndarray, "g 3 3"]
) -> Float64[np.ndarray, "g 3"]:
    """Half side lengths of each primitive's axis-aligned bounding box after `rotation`, exact."""
    box = np.einsum("gij,gj->gi", np.abs(rotation), size)
    ellipsoid = np.sqrt(np.einsum("gij,gj->gi", rotation**2, size**2))
    z = rotation[:, :, 2]
    capsule = np.abs(z) * size[:, 1:2] + size[:, 0:1]
    cylinder = np.abs(z) * size[:, 1:2] + size[:, 0:1] * np.sqrt(np.clip(1.0 - z**2, 0.0, None))
    sphere = np.repeat(size[:, 0:1], 3, axis=1)
    return np.select(
        [kind[:, None] == k for k in (rays.BOX, rays.ELLIPSOID, rays.CAPSULE, rays.CYLINDER, rays.SPHERE)],
        [box, ellipsoid, capsule, cylinder, sphere],
        default=np.inf,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class PartInfo:
    """A part at scale 1: its box in the root frame, and the radius of its footprint about the root."""

    size_m: Float64[np.ndarray, " 3"]
    centre_m: Float64[np.ndarray, " 3"]
    radius_m: float


@lru_cache(maxsize=64)
def part_info(part: str) -> PartInfo:
    """Measure a part of scenarios/parts by compiling it alone. BadInput: a geom that rays cannot meet."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(PARTS / f"{part}.xml"))
    for geom in spec.geoms:
        if int(geom.type) not in SHAPES:
            kind = mujoco.mjtGeom(geom.type).name.removeprefix("mjGEOM_").lower()
            raise BadInput(
                f"part '{part}': geom '{geom.name}' is a {kind}; rays can meet a {', '.join(SHAPES.values())}"
            )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    half = half_extent(model.geom_type, model.geom_size, data.geom_xmat.reshape(-1, 3, 3))
    low, high = (data.geom_xpos - half).min(axis=0), (data.geom_xpos + half).max(axis=0)
    reach = np.maximum(np.abs(low[:2]), np.abs(high[:2]))
    return PartInfo(size_m=high - low, centre_m=0.5 * (high + low), radius_m=float(np.hypot(*reach)))


def _attach(
    spec: Any, part: str, prefix: str, scale: float, pose: tuple[float, float, float], mocap: bool,
    seed: int, scene: dict[str, tuple[list[float], float]], reflectivity: dict[str, float],
    given: Mapping[str, Surface],
) -> None:  # fmt: skip
    """Attach a scaled, freshly coloured copy of a part under `prefix/`, standing at pose (x, y, heading).

    given: by material, what is not drawn. Every material draws from a stream of its own, given or not.
    """
    import mujoco

    child = mujoco.MjSpec.from_file(str(PARTS / f"{part}.xml"))
    for body in child.bodies:
        body.pos = body.pos * scale
    for geom in child.geoms:
        geom.pos, geom.size, geom.fromto = geom.pos * scale, geom.size * scale, geom.fromto * scale
    for joint in child.joints:
        joint.pos = joint.pos * scale
    for material in child.materials:
        entry = palette()[material.name]
        if entry["per"] == "scene":
            colour, value = scene[material.name]
        else:
            colour, value = _draw_material(stream(seed, "material", prefix, material.name), entry)
        if (surface := given.get(material.name)) is not None:
            colour = colour if surface.colour is None else list(surface.colour)
            value = value if surface.reflectivity is None else surface.reflectivity
        material.rgba = [*colour, 1.0]
        material.specular, material.shininess = entry["specular"], entry["shininess"]
        reflectivity[f"{prefix}/{material.name}"] = value
    x, y, heading = pose
    root = child.body("root")
    frame = spec.worldbody.add_frame(
        pos=[x, y, 0.0], quat=[np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)]
    )
    frame.attach_body(root, f"{prefix}/", "")
    if mocap:
        spec.body(f"{prefix}/root").mocap = True


def _draw_material(rng: np.random.Generator, entry: dict[str, Any]) -> tuple[list[float], float]:
    colours = entry["colours"]
    low, high = entry["reflectivity"]
    return colours[int(rng.integers(len(colours)))], float(rng.uniform(low, high))


def build_world(scenario: Scenario, system: System, seed: int) -> World:
    """One MuJoCo model of the scenario's system, its background drawn from `seed`. Raises BadInput when the
    background has no room."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = scenario.name
    scene = {
        name: _draw_material(stream(seed, "material", "scene", name), entry)
        for name, entry in sorted(palette().items())
    }
    paint = road_paint(scenario.road, *(_colour(scene, name) for name in ("asphalt", "marking", "grass")))
    _dress(spec, scene, paint)
    reflectivity: dict[str, float] = {"asphalt": scene["asphalt"][1]}

    road = None if scenario.road.bend is None else BentRoad(scenario.road.bend)
    tracks = {name: make_track(actor.path, road) for name, actor in system.actors.items()}
    end_s = system.duration_s + AFTER_S
    times = np.arange(-int(0.5e9), int(end_s * 1e9), int(0.1e9))
    radius_m = {name: part_info(actor.part).radius_m * actor.scale for name, actor in system.actors.items()}
    sweep = [
        np.column_stack([tracks[name].at(times)[0], np.full(len(times), radius_m[name])])
        for name in system.actors
    ]
    background = scatter.place(
        scenario.background,
        {group.part: part_info(group.part).radius_m for group in scenario.background},
        scenario.road.lanes_m,
        np.concatenate(sweep),
        end_s,
        stream(seed, "background"),
        road,
    )

    entries: list[tuple[str, str, str, float, Track]] = [
        (name, actor.part, actor.category, actor.scale, tracks[name]) for name, actor in system.actors.items()
    ]
    given = {name: actor.materials for name, actor in system.actors.items() if actor.materials is not None}
    for number, item in enumerate(background):
        end = (item.xy_m[0] + np.cos(item.heading_rad), item.xy_m[1] + np.sin(item.heading_rad))
        path = Path(waypoints_m=(item.xy_m, end), speed_mps=item.speed_mps)
        track = make_track(path, road)
        entries.append((f"{item.part}-{number}", item.part, item.category, item.scale, track))

    names = [entry[0] for entry in entries]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise BadInput(f"actor '{twice[0]}' has the name of a background object; give it another name")
    objects, centres, rotations, positions = [], [], [], []
    moving: list[tuple[str, int, Track]] = []
    for object_id, (name, part, category, scale, track) in enumerate(entries):
        info = part_info(part)
        moves = object_id < len(system.actors) or bool(np.any(track.speed_mps > 0.0))
        (xy,), (heading,) = track.at(np.zeros(1, dtype=np.int64))
        pose = (xy[0], xy[1], heading)
        _attach(spec, part, name, scale, pose, moves, seed, scene, reflectivity, given.get(name, {}))
        length, width, height = (float(v) for v in info.size_m * scale)
        objects.append(
            ObjectInfo(object_id=object_id, name=name, category=category, size_m=(length, width, height))
        )
        centres.append(info.centre_m * scale)
        c, s = np.cos(heading), np.sin(heading)
        rotations.append(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
        positions.append(np.array([xy[0], xy[1], 0.0]))
        if moves:
            moving.append((name, object_id, track))

    model = spec.compile()
    return _tabulate(
        model,
        tuple(objects),
        tuple(entry[3] for entry in entries),
        np.array(centres),
        np.array(rotations),
        np.array(positions),
        moving,
        reflectivity,
        paint,
    )


def _colour(scene: dict[str, tuple[list[float], float]], material: str) -> tuple[float, float, float]:
    red, green, blue = scene[material][0]
    return red, green, blue


def _dress(spec: Any, scene: dict[str, tuple[list[float], float]], paint: Paint) -> None:
    """Sky, sun, ground and rendering quality."""
    import mujoco

    spec.visual.global_.offwidth, spec.visual.global_.offheight = 2048, 2048
    spec.visual.quality.offsamples = 0
    spec.visual.quality.numquads = 1
    spec.stat.extent = EXTENT_M
    spec.stat.center = [0.0, 0.0, 0.0]
    spec.visual.map.znear, spec.visual.map.zfar = 0.05 / EXTENT_M, 400.0 / EXTENT_M
    spec.visual.map.shadowclip, spec.visual.map.shadowscale = 1.0, 0.6
    spec.visual.headlight.ambient = [0.44, 0.46, 0.50]
    spec.visual.headlight.diffuse = [0.08, 0.08, 0.08]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.24, 0.46, 0.80], rgb2=[1.0, 1.0, 0.98], width=512, height=3072,
    )  # fmt: skip
    asphalt = scene["asphalt"][0]
    spec.add_texture(
        name="asphalt", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        mark=mujoco.mjtMark.mjMARK_RANDOM, random=0.10, rgb1=asphalt, rgb2=asphalt,
        markrgb=[c * 1.18 for c in asphalt], width=512, height=512,
    )  # fmt: skip
    ground = spec.add_material(name="asphalt", texrepeat=[0.2, 0.2], texuniform=True, specular=0.05)
    ground.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "asphalt"
    spec.worldbody.add_geom(
        name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], material="asphalt",
        contype=0, conaffinity=0, group=1,
    )  # fmt: skip
    _lay(spec, scene, paint)
    spec.worldbody.add_light(
        name="sun", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=[0, 0, 60], dir=SUN_DIRECTION,
        diffuse=[0.76, 0.73, 0.66], specular=[0.35, 0.35, 0.33], castshadow=True,
    )  # fmt: skip
    spec.worldbody.add_camera(name="eye")


def _lay(spec: Any, scene: dict[str, tuple[list[float], float]], paint: Paint) -> None:
    """The paint as boxes a millimetre thick, which OpenGL draws and the ray kernel leaves out (geom group
    2)."""
    import mujoco

    for material in ("marking", "grass"):
        spec.add_material(name=material, rgba=[*scene[material][0], 1.0], specular=0.02)
    for number, (x0, y0, x1, y1) in paint.rectangles():
        spec.worldbody.add_geom(
            name=f"paint-{number}-{x0:.0f}", material="grass" if paint.grass[number] else "marking",
            type=mujoco.mjtGeom.mjGEOM_BOX, contype=0, conaffinity=0, group=2,
            size=[(x1 - x0) / 2, (y1 - y0) / 2, 0.0005], pos=[(x0 + x1) / 2, (y0 + y1) / 2, 0.0005],
        )  # fmt: skip


def _tabulate(
    model: Any, objects: tuple[ObjectInfo, ...], scale: tuple[float, ...], centres: np.ndarray,
    rotations: np.ndarray, positions: np.ndarray, moving: list[tuple[str, int, Track]],
    reflectivity: dict[str, float], paint: Paint,
) -> World:  # fmt: skip
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    by_name = {info.name: info.object_id for info in objects}
    bodies: list[Body] = []
    actors: list[MovingActor] = []
    index_of: dict[int, int] = {}
    actor_of_root = {name: number for number, (name, _, _) in enumerate(moving)}
    for body_id in range(1, model.nbody):
        name = model.body(body_id).name
        prefix = name.split("/")[0]
        if prefix not in actor_of_root:
            continue
        number = actor_of_root[prefix]
        index = len(bodies) + 1
        index_of[body_id] = index
        root = name == f"{prefix}/root"
        joint_id = int(model.body_jntadr[body_id])
        joint = model.joint(joint_id).name.split("/")[-1] if joint_id >= 0 else ""
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.body_quat[body_id])
        first_geom = int(model.body_geomadr[body_id])
        bodies.append(
            Body(
                name=name,
                model_id=body_id,
                actor=number,
                parent=0 if root else index_of[int(model.body_parentid[body_id])],
                rotation=np.eye(3) if root else rotation.reshape(3, 3),
                position_m=np.zeros(3) if root else model.body_pos[body_id].copy(),
                joint=joint.split("_")[0],
                axis=model.jnt_axis[joint_id].copy() if joint_id >= 0 else np.zeros(3),
                anchor_m=model.jnt_pos[joint_id].copy() if joint_id >= 0 else np.zeros(3),
                qpos=int(model.jnt_qposadr[joint_id]) if joint_id >= 0 else -1,
                wheel_radius_m=float(model.geom_size[first_geom, 0]) if joint.startswith("wheel") else 0.0,
                swing_sign=-1.0 if joint in ("swing_leg_r", "swing_arm_l") else 1.0,
            )
        )
        if root:
            _, object_id, track = moving[number]
            actors.append(
                MovingActor(
                    name=prefix,
                    object_id=object_id,
                    body=index,
                    mocap=int(model.body_mocapid[body_id]),
                    track=track,
                )
            )

    keep = np.flatnonzero(model.geom_group != 2)
    geom_object = np.full(len(keep), GROUND, dtype=np.int32)
    body_index = np.zeros(len(keep), dtype=np.int32)
    value, slope_deg = np.empty(len(keep)), np.empty(len(keep))
    rotation_table = np.empty((len(keep), 3, 3))
    position_table = np.empty((len(keep), 3))
    for row, geom_id in enumerate(keep):
        body_id = int(model.geom_bodyid[geom_id])
        prefix = model.body(body_id).name.split("/")[0]
        geom_object[row] = by_name.get(prefix, GROUND)
        name = model.material(int(model.geom_matid[geom_id])).name
        value[row] = reflectivity[name]
        slope_deg[row] = palette()[name.split("/")[-1]].get("roughness_deg", 0.0)
        body_index[row] = index_of.get(body_id, 0)
        if body_index[row]:
            matrix = np.empty(9)
            mujoco.mju_quat2Mat(matrix, model.geom_quat[geom_id])
            rotation_table[row], position_table[row] = matrix.reshape(3, 3), model.geom_pos[geom_id]
        else:
            rotation_table[row], position_table[row] = (
                data.geom_xmat[geom_id].reshape(3, 3),
                data.geom_xpos[geom_id],
            )
    kind, material = model.geom_type[keep], model.geom_matid[keep]
    colour = model.mat_rgba[material, :3].astype(np.float64)
    colour[kind == rays.PLANE] = paint.ground_colour
    return World(
        model=model,
        geoms=rays.Geoms(
            kind=kind,
            size_m=model.geom_size[keep],
            body=body_index,
            rotation=rotation_table,
            position_m=position_table,
            bound_m=np.where(kind == rays.PLANE, np.inf, model.geom_rbound[keep]),
        ),
        geom_model_id=keep.astype(np.int32),
        geom_object=geom_object,
        reflectivity=value,
        roughness_gain=roughness_gain(np.deg2rad(slope_deg)),
        looks=Looks(
            colour=colour,
            specular=model.mat_specular[material].astype(np.float64),
            shininess=model.mat_shininess[material].astype(np.float64),
            paint=paint,
        ),
        objects=objects,
        scale=scale,
        box_centre_m=centres,
        static_rotation=rotations,
        static_position_m=positions,
        bodies=tuple(bodies),
        chain=tabulate_chain(bodies),
        actors=tuple(actors),
        actor_of_object={actor.object_id: number for number, actor in enumerate(actors)},
    )
