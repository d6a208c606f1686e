"""When and where every beam fires, and that its rays are those of MuJoCo at that instant."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fusion.geometry import Transform
from scenarios.load import load_sensor
from scenarios.scenario import LidarSensor
from simbench.motion import Motion
from simbench.sensors import lidar, rays
from simbench.sensors import shot as shots
from simbench.sensors.render import place
from simbench.sensors.shot import Shot, aim
from tests.simbench.scenes import (
    Shape,
    Stage,
    a_shake,
    shaken_motion,
    staged,
    straight,
    toy_motion,
    toy_world,
)

MS = 1_000_000
US = 1_000
NAMES = ("os1-64", "vlp-16")


def sensor_of(name: str) -> LidarSensor:
    sensor = load_sensor(name)
    assert isinstance(sensor, LidarSensor)
    return sensor


@pytest.fixture(scope="module")
def scene() -> Stage:
    return staged("overtake-approach", "car", 2)


def bent_motion(of: Stage) -> Motion:
    """The car shakes and the LiDAR's own bracket bends."""
    return replace(shaken_motion(of), flex={"lidar": a_shake(3, 0.01, seed=5)})


def aimed(motion: Motion, sensor: LidarSensor, start_ns: int, seed: int | None = None) -> Shot:
    table = lidar.beam_table(sensor)
    shape = table.fire_offset_ns.shape
    if seed is None:
        zero = np.zeros(shape, dtype=np.float32)
        return aim("lidar", motion, table, start_ns, zero, zero, 0.0)
    errors = np.random.default_rng(seed).standard_normal((2, *shape), dtype=np.float32)
    return aim("lidar", motion, table, start_ns, errors[0], errors[1], np.deg2rad(0.2))


# -- tables -----------------------------------------------------------------------------------------------


def test_the_16_lasers_fire_every_2304_ns_hopping_up_and_down() -> None:
    sensor = sensor_of("vlp-16")
    table = lidar.beam_table(sensor)
    elevation = np.asarray(sensor.elevation_deg)
    first = elevation[table.order]
    assert first.tolist() == [-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15]
    assert table.fire_offset_ns[0, table.order].tolist() == [2304 * k for k in range(16)]
    assert table.fire_offset_ns[7, table.order[3]] == 7 * 55_296 + 3 * 2304
    assert table.fire_offset_ns.max() == 1807 * 55_296 + 15 * 2304 < 100 * MS


@pytest.mark.parametrize("name", NAMES)
def test_a_beam_looks_where_the_encoder_stands_when_it_fires(name: str) -> None:
    sensor = sensor_of(name)
    table = lidar.beam_table(sensor)
    exact_s = table.fire_offset_ns * 1e-9
    if name == "os1-64":  # its stamps are rounded down to nanoseconds
        exact_s = np.repeat(np.arange(1024)[:, None] / 10240.0, 64, axis=1)
    encoder_deg = 90.0 - 3600.0 * exact_s
    azimuth = np.rad2deg(np.arctan2(table.direction[..., 1], table.direction[..., 0]))
    off = (azimuth - encoder_deg - np.asarray(sensor.azimuth_offset_deg) + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(off, 0.0, atol=1e-9)
    elevation = np.rad2deg(np.arcsin(table.direction[..., 2]))
    np.testing.assert_allclose(elevation, np.broadcast_to(sensor.elevation_deg, elevation.shape), atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_groups_hold_every_beam_once_at_its_own_instant(name: str) -> None:
    table = lidar.beam_table(sensor_of(name))
    columns, beams = table.fire_offset_ns.shape
    seen = table.slots[table.instant, table.place]
    assert np.array_equal(seen, np.arange(beams))
    group = np.arange(columns)[:, None] * len(table.slots) + table.instant
    assert np.array_equal(table.group_offset_ns[group], table.fire_offset_ns)
    assert (np.diff(table.group_offset_ns) > 0).all()


def test_beams_that_fire_in_pairs_share_two_groups_of_different_size() -> None:
    """Three beams at once, then a fourth and a fifth: the short row repeats its last beam."""
    sensor = sensor_of("vlp-16").model_copy(
        update={
            "elevation_deg": (4.0, 2.0, 0.0, -2.0, -4.0),
            "azimuth_offset_deg": (0.0, 1.0, 0.0, -1.0, 0.0),
            "fire_delay_us": (0.0, 5.0, 0.0, 5.0, 0.0),
        }
    )
    table = lidar.beam_table(sensor)
    assert table.slots.tolist() == [[4, 2, 0], [3, 1, 1]]
    assert table.order.tolist() == [0, 2, 4, 1, 3]
    world = toy_world(
        [Shape(kind=rays.SPHERE, size_m=(9.0, 0, 0), xyz_m=(0.0, 0.0, 1.85))],
        [straight((0.0, 0.0), 0.0, 0.0)],
    )
    scan, _ = lidar.sweep("lidar", sensor, toy_motion(world, ABOVE), 0, 0, None)
    assert len(scan.xyz_m) == 5 * sensor.columns
    assert scan.ring[:5].tolist() == [0, 2, 4, 1, 3]
    assert scan.offset_ns[:5].tolist() == [0, 0, 0, 5000, 5000]


# -- time -------------------------------------------------------------------------------------------------

ABOVE = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.85]))


@pytest.mark.parametrize("name", NAMES)
def test_a_wall_driven_at_stands_where_each_points_own_time_puts_it(name: str) -> None:
    """At 40 m/s a laser that fires 2.3 us later is 0.09 mm nearer: offsets must be each beam's own."""
    wall = Shape(kind=rays.BOX, size_m=(0.5, 40.0, 15.0), xyz_m=(15.5, 0.0, 0.0), reflectivity=0.8)
    motion = toy_motion(toy_world([wall], [straight((0.0, 0.0), 0.0, 40.0)]), ABOVE)
    scan, truth = lidar.sweep("lidar", sensor_of(name), motion, 0, 0, None)
    table = lidar.beam_table(sensor_of(name))
    column = np.searchsorted(table.column_offset_ns, scan.offset_ns, side="right") - 1
    x = truth.true_range_m * table.direction[column, scan.ring, 0]
    np.testing.assert_allclose(x, 15.0 - 40.0 * scan.offset_ns * 1e-9, rtol=0, atol=1e-9)
    assert len(x) > 1000


@pytest.mark.parametrize("name", NAMES)
def test_points_come_in_firing_order(name: str, scene: Stage) -> None:
    scan, truth = lidar.sweep("lidar", sensor_of(name), bent_motion(scene), 0, 0, np.random.default_rng(1))
    assert (np.diff(scan.offset_ns) >= 0).all()
    assert scan.offset_ns[0] >= 0 and scan.offset_ns[-1] < 100 * MS
    assert np.array_equal(truth.fire_ns, scan.offset_ns.astype(np.int64))


# -- MuJoCo -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "columns_per_key", "limit_m"),
    [("os1-64", 1, 1e-9), ("os1-64", shots.COLUMNS_PER_KEY, 1e-4), ("vlp-16", shots.COLUMNS_PER_KEY, 1e-4)],
)
def test_every_firing_meets_what_mujocos_rays_meet_at_that_instant(
    name: str, columns_per_key: int, limit_m: float, scene: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`mj_ray` after `mj_kinematics` at the beam's own time, body shaking and bracket bending; grazing rays,
    where rounding moves the hit itself, count across the surface. With a key pose for every column the two
    are equal; otherwise only the own, shaking body may differ."""
    monkeypatch.setattr(shots, "COLUMNS_PER_KEY", columns_per_key)
    motion, world, sensor = bent_motion(scene), scene.world, sensor_of(name)
    table, start_ns = lidar.beam_table(sensor), 1_300 * MS
    shot = aimed(motion, sensor, start_ns)
    hits = shot.cast()
    model, data = world.model, mujoco.MjData(world.model)
    shown = np.array([1, 1, 0, 1, 1, 1], dtype=np.uint8)
    of_model = {int(g): row for row, g in enumerate(world.geom_model_id)}
    found, normal, compared = np.empty(1, np.int32), np.empty(3), 0
    picked = np.random.default_rng(0).choice(sensor.columns, 12, replace=False)
    for column in picked:
        for beam in range(0, len(sensor.elevation_deg), 1 if name == "vlp-16" else 3):
            t_ns = start_ns + int(table.fire_offset_ns[column, beam])
            place(data, motion, t_ns)
            mujoco.mj_kinematics(model, data)
            (R,), (p,) = motion.sensor("lidar", np.array([t_ns]))
            along = R @ table.direction[column, beam]
            distance = mujoco.mj_ray(model, data, p, along, shown, True, -1, found, normal)
            group, k = column * len(table.slots) + table.instant[beam], table.place[beam]
            ours, geom = hits.range_m[group, k], hits.geom[group, k]
            if distance < 0.0:
                assert geom == -1
                continue
            facing = abs(float(normal @ along))
            own = world.geom_object[geom] == world.find(scene.system.ego).object_id
            limit = limit_m if own else min(limit_m, 1e-6)
            assert abs(ours - distance) * min(1.0, 30.0 * facing) <= limit * max(1.0, distance)
            assert geom == of_model[int(found[0])]
            compared += 1
    assert compared > 80


@pytest.mark.parametrize("name", NAMES)
def test_disturbed_beams_are_ordinary_rays_in_the_disturbed_direction(name: str, scene: Stage) -> None:
    """The fans of the kernel against single rays along directions made here, angle by angle."""
    motion, sensor = bent_motion(scene), sensor_of(name)
    table = lidar.beam_table(sensor)
    shot = aimed(motion, sensor, 0, seed=4)
    errors = np.deg2rad(0.2) * np.random.default_rng(4).standard_normal(
        (2, *table.fire_offset_ns.shape), dtype=np.float32
    ).astype(np.float64)
    hits = shot.cast()
    column = np.arange(0, sensor.columns, 97)
    for beam in range(0, len(sensor.elevation_deg), 5):
        azimuth = np.arctan2(table.direction[column, beam, 1], table.direction[column, beam, 0])
        elevation = np.arcsin(table.direction[column, beam, 2])
        ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
        away, up = errors[:, column, beam]
        moved = (
            table.direction[column, beam]
            + away[:, None] * np.stack([-ce * sa, ce * ca, 0.0 * ca], axis=1)
            + up[:, None] * np.stack([-se * ca, -se * sa, ce], axis=1)
        )
        moved /= np.linalg.norm(moved, axis=1, keepdims=True)
        t_ns = table.fire_offset_ns[column, beam]
        R, p = motion.sensor("lidar", t_ns)
        single = rays.cast(
            scene.world.geoms, *motion.poses(t_ns), np.arange(len(column)), p,
            np.einsum("nij,nj->ni", R, moved)[:, None],
        )  # fmt: skip
        group = column * len(table.slots) + table.instant[beam]
        k = table.place[beam]
        assert np.array_equal(hits.geom[group, k], single.geom[:, 0])
        hit = single.geom[:, 0] >= 0
        np.testing.assert_allclose(hits.range_m[group, k][hit], single.range_m[hit, 0], rtol=0, atol=1e-4)
