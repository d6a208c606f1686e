"""Scripted motion against MuJoCo's kinematics, and the laws that every sensor relies on."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.geometry import Transform, rotation_rpy
from simbench.motion import Motion, at, rotations_about, rotations_rpy
from simbench.sensors.render import place
from tests.simbench.scenes import Stage, SystemName, a_shake, scripted_motion, shaken_motion, staged

S = 1_000_000_000
SYSTEMS: tuple[SystemName, ...] = ("car", "wearable")


@pytest.fixture(scope="module", params=SYSTEMS)
def scene(request: pytest.FixtureRequest) -> Stage:
    return staged("overtake-approach", request.param, 3)


def some_times(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(-200_000_000, 6 * S, n)


def test_every_body_is_where_mujocos_kinematics_puts_it_shake_included(scene: Stage) -> None:
    motion, model = shaken_motion(scene), scene.world.model
    data = mujoco.MjData(model)
    t_ns = some_times(15)
    rotation, position = motion.poses(t_ns)
    for i, t in enumerate(t_ns):
        place(data, motion, int(t))
        mujoco.mj_kinematics(model, data)
        for row, body in enumerate(scene.world.bodies):
            np.testing.assert_allclose(position[i, row + 1], data.xpos[body.model_id], atol=1e-9)
            np.testing.assert_allclose(rotation[i, row + 1].ravel(), data.xmat[body.model_id], atol=1e-9)


def test_every_geom_of_the_ray_table_is_where_mujoco_has_it(scene: Stage) -> None:
    motion, model, world = shaken_motion(scene), scene.world.model, scene.world
    data = mujoco.MjData(model)
    for t in some_times(5, seed=1):
        place(data, motion, int(t))
        mujoco.mj_kinematics(model, data)
        (R,), (p,) = motion.poses(np.array([t]))
        body = world.geoms.body
        centre = np.einsum("gij,gj->gi", R[body], world.geoms.position_m) + p[body]
        np.testing.assert_allclose(centre, data.geom_xpos[world.geom_model_id], atol=1e-9)
        turned = R[body] @ world.geoms.rotation
        np.testing.assert_allclose(turned.reshape(-1, 9), data.geom_xmat[world.geom_model_id], atol=1e-9)


def test_at_rest_sensors_and_body_stand_where_the_rig_declares_them(scene: Stage) -> None:
    motion = scripted_motion(scene)
    t_ns = some_times(7, seed=2)
    ego = motion.ego(t_ns)
    root = motion.object_root(scene.world.find(scene.system.ego).object_id, t_ns)
    for i in range(len(t_ns)):
        T_world_ego = at(ego, i)
        for name, T_ego_sensor in scene.rig.T_ego_sensor.items():
            found = T_world_ego.inverse() @ at(motion.sensor(name, t_ns), i)
            np.testing.assert_allclose(found.rotation, T_ego_sensor.rotation, atol=1e-12)
            np.testing.assert_allclose(found.translation_m, T_ego_sensor.translation_m, atol=1e-9)
        found = T_world_ego.inverse() @ at(root, i)
        np.testing.assert_allclose(found.rotation, scene.rig.T_ego_root.rotation, atol=1e-12)
        np.testing.assert_allclose(found.translation_m, scene.rig.T_ego_root.translation_m, atol=1e-9)


def test_the_lidar_rests_above_the_ego_origin_which_is_on_the_ground(scene: Stage) -> None:
    motion = scripted_motion(scene)
    t_ns = some_times(5, seed=3)
    _, ego = motion.ego(t_ns)
    _, lidar = motion.sensor(scene.rig.lidar_name, t_ns)
    np.testing.assert_allclose(ego[:, 2], 0.0, atol=1e-12)
    np.testing.assert_allclose(lidar[:, :2], ego[:, :2], atol=1e-9)
    assert (lidar[:, 2] > 1.0).all()


def test_shake_moves_body_and_sensors_but_not_the_ego_frame(scene: Stage) -> None:
    still, shaken = scripted_motion(scene), shaken_motion(scene)
    t_ns = some_times(20, seed=4)
    for part in range(2):
        assert np.array_equal(still.ego(t_ns)[part], shaken.ego(t_ns)[part])
    for name in scene.rig.T_ego_sensor:
        turn = np.einsum("nji,njk->nik", still.sensor(name, t_ns)[0], shaken.sensor(name, t_ns)[0])
        angle = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
        assert angle.mean() > 0.01
    ego_id = scene.world.find(scene.system.ego).object_id
    for info in scene.world.objects:
        same = np.array_equal(
            still.object_root(info.object_id, t_ns)[0], shaken.object_root(info.object_id, t_ns)[0]
        )
        assert same == (info.object_id != ego_id)


def test_sensors_ride_rigidly_on_the_shaking_body(scene: Stage) -> None:
    motion = replace(shaken_motion(scene), flex={})
    t_ns = some_times(10, seed=5)
    body = motion.object_root(scene.world.find(scene.system.ego).object_id, t_ns)
    for name in scene.rig.T_ego_sensor:
        sensor = motion.sensor(name, t_ns)
        rest = scene.rig.T_ego_root.inverse() @ scene.rig.T_ego_sensor[name]
        for i in range(len(t_ns)):
            found = at(body, i).inverse() @ at(sensor, i)
            np.testing.assert_allclose(found.rotation, rest.rotation, atol=1e-12)
            np.testing.assert_allclose(found.translation_m, rest.translation_m, atol=1e-9)


def test_body_shake_turns_about_its_pivot_and_heaves_along_the_vertical(scene: Stage) -> None:
    motion = shaken_motion(scene)
    assert motion.body_shake is not None
    t_ns = some_times(10, seed=6)
    value = motion.body_shake.at(t_ns)
    pivot = np.asarray(motion.pivot_m)
    for i in range(len(t_ns)):
        moved = at(motion.ego(t_ns), i).inverse() @ at(motion.shaken_ego(t_ns), i)
        np.testing.assert_allclose(moved.rotation, rotation_rpy(*value[i, :3]), atol=1e-12)
        np.testing.assert_allclose(moved.apply(pivot), pivot + np.array([0.0, 0.0, value[i, 3]]), atol=1e-9)


def test_flex_turns_only_its_own_sensor_about_the_sensor_itself(scene: Stage) -> None:
    still = scripted_motion(scene)
    name, *others = scene.rig.cameras
    bent = replace(still, flex={name: a_shake(3, 0.01)})
    t_ns = some_times(10, seed=7)
    for other in (*others, scene.rig.lidar_name):
        assert np.array_equal(still.sensor(other, t_ns)[0], bent.sensor(other, t_ns)[0])
        assert np.array_equal(still.sensor(other, t_ns)[1], bent.sensor(other, t_ns)[1])
    np.testing.assert_allclose(still.sensor(name, t_ns)[1], bent.sensor(name, t_ns)[1], atol=1e-12)
    R_ego, _ = still.ego(t_ns)
    turn = bent.sensor(name, t_ns)[0] @ still.sensor(name, t_ns)[0].transpose(0, 2, 1)
    in_ego = R_ego.transpose(0, 2, 1) @ turn @ R_ego
    np.testing.assert_allclose(in_ego, rotations_rpy(bent.flex[name].at(t_ns)), atol=1e-12)


def test_an_objects_centre_is_the_middle_of_its_box(scene: Stage) -> None:
    """Against the axis-aligned extent of all its geoms at rest, in its own root frame, by sampling."""
    motion, world = scripted_motion(scene), scene.world
    t_ns = np.zeros(1, dtype=np.int64)
    model, data = world.model, mujoco.MjData(world.model)
    place(data, motion, 0)
    for body in world.bodies:  # limbs as in the part's file: the rest pose
        if body.qpos >= 0:
            data.qpos[body.qpos] = 0.0
    mujoco.mj_kinematics(model, data)
    for info in world.objects:
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        root = at(motion.object_root(info.object_id, t_ns))
        for geom in world.geom_model_id[world.masks[info.object_id]]:
            points = surface(int(model.geom_type[geom]), model.geom_size[geom])
            points = points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            local = root.inverse().apply(points)
            low, high = np.minimum(low, local.min(axis=0)), np.maximum(high, local.max(axis=0))
        centre = root.inverse().apply(at(motion.object_centre(info.object_id, t_ns)).translation_m[None])[0]
        np.testing.assert_allclose(centre, 0.5 * (low + high), atol=0.01)
        np.testing.assert_allclose(info.size_m, high - low, atol=0.02)


def surface(kind: int, size: np.ndarray, n: int = 24) -> np.ndarray:
    """Points on a primitive's surface, close together: an oracle that knows no bounding boxes."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * n), np.linspace(-np.pi / 2, np.pi / 2, n))
    ball = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1).reshape(-1, 3)
    ring = np.stack([np.cos(u[0]), np.sin(u[0]), np.zeros(2 * n)], axis=-1)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.asarray(ball * size[0])
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return np.asarray(ball * size)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.array(np.meshgrid(*[(-s, s) for s in size])).reshape(3, -1).T
    ends = [np.array([0.0, 0.0, z]) for z in (-size[1], size[1])]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return np.concatenate([ball * size[0] + end for end in ends])
    return np.concatenate([ring * size[0] + end for end in ends])


def test_what_stands_stands(scene: Stage) -> None:
    motion = shaken_motion(scene)
    standing = [o.object_id for o in scene.world.objects if o.object_id not in scene.world.actor_of_object]
    assert standing
    for number in standing:
        rotation, position = motion.object_centre(number, some_times(4, seed=8))
        assert np.ptp(rotation, axis=0).max() == 0.0
        assert np.ptp(position, axis=0).max() == 0.0


# -- limbs and wheels -------------------------------------------------------------------------------------


def test_wheels_touch_the_ground_and_roll_without_slipping(scene: Stage) -> None:
    """The material point at the bottom of a wheel stands still while it touches the ground."""
    motion = scripted_motion(scene)
    step = 50_000
    t_ns = np.array([S - step, S, S + step])
    rotation, position = motion.poses(t_ns)
    wheels = [(row, body) for row, body in enumerate(scene.world.bodies) if body.joint == "wheel"]
    assert len(wheels) >= 6
    for row, body in wheels:
        hub = position[:, row + 1]
        assert hub[1, 2] == pytest.approx(body.wheel_radius_m, rel=0.01)
        contact = rotation[1, row + 1].T @ np.array([0.0, 0.0, -body.wheel_radius_m])
        moved = hub + rotation[:, row + 1] @ contact
        speed = np.linalg.norm(moved[2] - moved[0]) / (2e-9 * step)
        driven = np.linalg.norm(hub[2] - hub[0]) / (2e-9 * step)
        assert driven > 3.0
        assert speed < 1e-3 * driven


def walkers(of: Stage) -> list[int]:
    return [
        i for i, a in enumerate(of.world.actors) if of.world.objects[a.object_id].category == "pedestrian"
    ]


def test_walking_feet_swing_against_each_other_and_each_step_is_as_long_as_the_way(scene: Stage) -> None:
    motion = scripted_motion(scene)
    t_ns = np.arange(0, 5 * S, 10_000_000)
    rotation, position = motion.poses(t_ns)
    assert walkers(scene)
    for actor in walkers(scene):
        legs = {
            b.name.split("/")[1]: row + 1
            for row, b in enumerate(scene.world.bodies)
            if b.actor == actor and "leg" in b.name
        }
        forward = rotation[0, scene.world.actors[actor].body][:, 0]
        foot = np.array([0.0, 0.0, -0.87])
        left, right = (
            (position[:, legs[name]] + rotation[:, legs[name]] @ foot) @ forward
            for name in ("leg_l", "leg_r")
        )
        root = position[:, scene.world.actors[actor].body] @ forward
        ahead_l, ahead_r = left - root, right - root
        assert np.corrcoef(ahead_l, ahead_r)[0, 1] < -0.99
        speed = (root[-1] - root[0]) / 5.0
        two_steps = 2.0 * (ahead_l.max() - ahead_l.min())
        assert two_steps / (1.0 / 0.9) == pytest.approx(speed, rel=0.1)  # 0.9 strides a second


def test_nobodys_feet_go_into_the_ground(scene: Stage) -> None:
    motion, world = scripted_motion(scene), scene.world
    t_ns = np.arange(0, 2 * S, 50_000_000)
    rotation, position = motion.poses(t_ns)
    for actor in walkers(scene):
        for g in np.flatnonzero(world.geom_object == world.actors[actor].object_id):
            b = world.geoms.body[g]
            points = surface(int(world.geoms.kind[g]), world.geoms.size_m[g], n=12)
            points = points @ world.geoms.rotation[g].T + world.geoms.position_m[g]
            z = np.einsum("nj,pj->np", rotation[:, b, 2], points) + position[:, b, 2:3]
            assert z.min() > -0.005


def test_walkers_are_out_of_step(scene: Stage) -> None:
    motion = scripted_motion(scene)
    t_ns = np.arange(0, 2 * S, 10_000_000)
    angles = []
    for actor in walkers(scene):
        row = next(i for i, b in enumerate(scene.world.bodies) if b.actor == actor and b.joint == "swing")
        angle = motion.joint_angle_rad(row, t_ns)
        assert angle is not None
        angles.append(angle)
    assert len(angles) >= 2
    assert np.abs(np.corrcoef(angles)[np.triu_indices(len(angles), 1)]).max() < 0.99


# -- laws -------------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31))
def test_a_pose_depends_on_its_time_only(seed: int) -> None:
    motion = MOTION[0]
    t_ns = some_times(6, seed)
    together, alone = motion.poses(t_ns), [motion.poses(t_ns[i : i + 1]) for i in range(6)]
    for part in range(2):
        np.testing.assert_allclose(together[part], np.concatenate([a[part] for a in alone]), atol=1e-13)
    turned = together[0].reshape(-1, 3, 3)
    np.testing.assert_allclose(
        turned @ turned.transpose(0, 2, 1), np.broadcast_to(np.eye(3), turned.shape), atol=1e-12
    )


MOTION: list[Motion] = [shaken_motion(staged("overtake-recede", "wearable", 0))]


@settings(max_examples=30)
@given(angles=st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=1, max_size=5))
def test_rotations_by_rows_equal_the_one_at_a_time(angles: list[tuple[float, float, float]]) -> None:
    rows = rotations_rpy(np.array(angles))
    for row, (roll, pitch, yaw) in zip(rows, angles, strict=True):
        np.testing.assert_allclose(row, rotation_rpy(roll, pitch, yaw), atol=1e-12)


def test_a_turn_about_z_takes_x_to_y() -> None:
    (turn,) = rotations_about(np.array([0.0, 0.0, 1.0]), np.array([np.pi / 2]))
    np.testing.assert_allclose(turn @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)


def test_the_ego_frame_is_the_root_moved_by_its_mount() -> None:
    scene = staged("overtake-approach", "car", 3)
    motion = replace(
        scripted_motion(scene),
        T_ego_root=Transform(rotation=rotation_rpy(0.0, 0.0, 0.3), translation_m=np.array([0.4, -0.2, 0.0])),
    )
    t_ns = some_times(3)
    root = motion.object_root(scene.world.find("car").object_id, t_ns)
    xy, heading = scene.world.actors[motion.ego_actor].track.at(t_ns)
    np.testing.assert_allclose(root[1][:, :2], xy, atol=1e-9)
    np.testing.assert_allclose(np.arctan2(root[0][:, 1, 0], root[0][:, 0, 0]), heading, atol=1e-12)
