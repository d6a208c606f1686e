"""The spinning LiDAR on closed forms, in motion, and its noise by its own formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.geometry import Transform, rotation_rpy
from fusion.messages import LidarScan
from scenarios.load import load_sensor
from scenarios.scenario import LidarSensor, ReturnNoise
from scenarios.seeding import stream
from simbench.motion import Motion
from simbench.path import Track
from simbench.sensors import lidar, rays, returns
from simbench.truth import ScanTruth
from simbench.world import GROUND, World
from tests.simbench.scenes import (
    Shape,
    Stage,
    ideal_lidar,
    scripted_motion,
    shaken_motion,
    staged,
    straight,
    toy_motion,
    toy_world,
)

MS = 1_000_000
HEIGHT_M = 1.85
ABOVE = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, HEIGHT_M]))
GROUND_PLANE = Shape(kind=rays.PLANE, size_m=(0.0, 0.0, 1.0), reflectivity=0.2)
STILL = straight((0.0, 0.0), 0.0, 0.0)


def ball(
    xyz_m: tuple[float, float, float], radius_m: float, mover: int | None = None, **rest: float
) -> Shape:
    return Shape(kind=rays.SPHERE, size_m=(radius_m, 0.0, 0.0), xyz_m=xyz_m, mover=mover, **rest)  # type: ignore[arg-type]


def scan_of(
    motion: Motion, sensor: LidarSensor, start_ns: int = 0, seed: int | None = None
) -> tuple[LidarScan, ScanTruth]:
    rng = None if seed is None else np.random.default_rng(seed)
    return lidar.sweep("lidar", sensor, motion, start_ns, 0, rng)


def endless() -> LidarSensor:
    """An ideal LiDAR that sees whatever its beams meet."""
    return lidar.without(ideal_lidar(), "range_law")


def os1() -> LidarSensor:
    sensor = load_sensor("os1-64")
    assert isinstance(sensor, LidarSensor)
    return sensor


@pytest.fixture(scope="module")
def scene() -> Stage:
    return staged("overtake-approach", "wearable", 1)


# -- closed forms -----------------------------------------------------------------------------------------


def test_on_a_plane_every_range_is_the_closed_form_to_a_micrometre() -> None:
    scan, truth = scan_of(toy_motion(toy_world([GROUND_PLANE], [STILL]), ABOVE), endless())
    down = np.asarray(ideal_lidar().elevation_deg)[scan.ring]
    assert len(scan.xyz_m) == 8 * 256
    np.testing.assert_allclose(truth.true_range_m, HEIGHT_M / np.sin(np.deg2rad(-down)), rtol=0, atol=1e-6)
    np.testing.assert_allclose(scan.xyz_m[:, 2], -HEIGHT_M, rtol=0, atol=1e-5)
    np.testing.assert_allclose(truth.incidence_rad, np.deg2rad(90.0 + down), atol=1e-4)
    assert (truth.object_id == GROUND).all()


def test_on_a_sphere_every_range_is_the_closed_form_to_a_micrometre() -> None:
    centre, radius = np.array([12.0, 3.0, 1.5]), 2.0
    motion = toy_motion(toy_world([ball((12.0, 3.0, 1.5), radius)], [STILL]), ABOVE)
    _, truth = scan_of(motion, endless())
    table = lidar.beam_table(ideal_lidar())
    c = centre - [0.0, 0.0, HEIGHT_M]
    along = table.direction @ c
    left = radius**2 - (c @ c - along**2)
    expected = (along - np.sqrt(np.maximum(left, 0.0)))[(left > 0.0) & (along > 0.0)]
    assert len(expected) > 50
    np.testing.assert_allclose(truth.true_range_m, expected, rtol=0, atol=1e-6)


def test_without_noise_a_point_is_its_true_range_along_its_beam(scene: Stage) -> None:
    sensor = os1()
    scan, truth = lidar.sweep("lidar", sensor, shaken_motion(scene), 300 * MS, 3, None)
    table = lidar.beam_table(sensor)
    column = np.searchsorted(table.column_offset_ns, scan.offset_ns)
    xyz = truth.true_range_m[:, None] * table.direction[column, scan.ring]
    np.testing.assert_allclose(scan.xyz_m, xyz, rtol=2e-7, atol=1e-7)
    assert len(scan.xyz_m) > 10_000


def test_points_lie_on_the_objects_that_the_truth_names(scene: Stage) -> None:
    """Back in the world at their firing times, points are inside their object's box, which is at rest."""
    motion = shaken_motion(scene)
    scan, truth = lidar.sweep("lidar", os1(), motion, 700 * MS, 7, None)
    R, p = motion.sensor("lidar", truth.fire_ns)
    world = np.einsum("nij,nj->ni", R, scan.xyz_m.astype(np.float64)) + p
    seen = 0
    for info in scene.world.objects:
        own = truth.object_id == info.object_id
        if not own.any() or info.category in ("pedestrian",):  # limbs swing out of the box at rest
            continue
        R_box, p_box = motion.object_centre(info.object_id, truth.fire_ns[own])
        inside = (
            np.abs(np.einsum("nji,nj->ni", R_box, world[own] - p_box)) <= 0.5 * np.array(info.size_m) + 0.03
        )
        assert inside.all(), info.name
        seen += 1
    assert seen > 8
    ground = (truth.object_id == GROUND) & (truth.true_range_m < 200.0)
    np.testing.assert_allclose(world[ground, 2], 0.0, atol=1e-4)


# -- time -------------------------------------------------------------------------------------------------


def test_the_front_passes_a_quarter_turn_after_the_start_which_is_25_ms() -> None:
    sensor = os1()
    assert lidar.passing_offset_ns(sensor, 0.0) == 25 * MS
    assert lidar.passing_offset_ns(sensor, 90.0) == 0
    assert lidar.passing_offset_ns(sensor, 180.0) == 75 * MS
    assert lidar.passing_offset_ns(sensor.model_copy(update={"clockwise": False}), 0.0) == 75 * MS
    table = lidar.beam_table(sensor)
    column = int(np.searchsorted(table.column_offset_ns, 25 * MS))
    azimuth = np.rad2deg(np.arctan2(table.direction[column, :, 1], table.direction[column, :, 0]))
    np.testing.assert_allclose(azimuth, sensor.azimuth_offset_deg, atol=1e-9)


def test_columns_fire_evenly_within_one_period() -> None:
    offsets = lidar.beam_table(os1()).column_offset_ns
    assert offsets[0] == 0
    assert offsets[-1] < 100 * MS
    assert set(np.diff(offsets)) <= {97_656, 97_657}


def test_stamps_offsets_and_firing_times_agree(scene: Stage) -> None:
    scan, truth = lidar.sweep("lidar", os1(), scripted_motion(scene), 500 * MS, 5, np.random.default_rng(0))
    assert (scan.stamp_ns, scan.seq, truth.seq) == (500 * MS, 5, 5)
    assert scan.arrival_ns == 500 * MS + 99_902_343 + 10 * MS
    assert (np.diff(scan.offset_ns) >= 0).all()
    assert scan.offset_ns.min() >= 0
    assert np.array_equal(truth.fire_ns, scan.stamp_ns + scan.offset_ns.astype(np.int64))


def ring_around(tracks: list[Track]) -> World:
    return toy_world(
        [GROUND_PLANE, ball((12.0, 0.0, 1.8), 1.0, mover=1), ball((-9.0, 4.0, 1.8), 1.0, mover=1)], tracks
    )


def test_a_target_at_rest_relative_to_a_moving_ego_shows_no_distortion() -> None:
    still = toy_motion(ring_around([STILL, straight((0.0, 0.0), 0.0, 0.0)]), ABOVE)
    both = toy_motion(ring_around([straight((0.0, 0.0), 0.0, 12.5), straight((0.0, 0.0), 0.0, 12.5)]), ABOVE)
    (a, ta), (b, tb) = scan_of(still, ideal_lidar()), scan_of(both, ideal_lidar(), start_ns=400 * MS)
    assert np.array_equal(ta.object_id, tb.object_id)
    np.testing.assert_allclose(a.xyz_m, b.xyz_m, rtol=0, atol=1e-5)


@settings(max_examples=15)
@given(speed=st.floats(-15.0, 15.0), heading=st.floats(-180.0, 180.0))
def test_a_target_that_moves_shows_its_speed_times_the_time_between_columns(
    speed: float, heading: float
) -> None:
    """The surface of a moving ball, carried back to where it was at the sweep's start, is the ball."""
    radius, centre = 2.0, np.array([12.0, 0.0, 1.8])
    track = straight((0.0, 0.0), heading, abs(speed))
    world = toy_world(
        [Shape(kind=rays.SPHERE, size_m=(radius, 0.0, 0.0), xyz_m=(12.0, 0.0, 1.8), mover=1)], [STILL, track]
    )
    motion = toy_motion(world, ABOVE)
    scan, truth = scan_of(motion, ideal_lidar())
    heading_rad = np.deg2rad(heading)
    velocity = abs(speed) * np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0])
    turn = rotation_rpy(0.0, 0.0, heading_rad)
    points = scan.xyz_m + ABOVE.translation_m - truth.fire_ns[:, None] * 1e-9 * velocity
    distance = np.linalg.norm(points - turn @ centre, axis=1)
    assert len(distance) > 20
    np.testing.assert_allclose(distance, radius, rtol=0, atol=1e-3)


def test_the_same_wall_seen_at_both_ends_of_a_sweep_has_moved_by_the_way_driven() -> None:
    """A wall across the start direction is seen by the first and the last columns, 100 ms apart."""
    wall = Shape(kind=rays.BOX, size_m=(0.5, 30.0, 5.0), xyz_m=(20.0, 0.0, 5.0))
    motion = toy_motion(toy_world([wall], [straight((0.0, 0.0), 0.0, 12.5)]), ABOVE)
    sensor = ideal_lidar(start_azimuth_deg=0.0, azimuth_offset_deg=tuple([0.0] * 16))
    scan, truth = scan_of(motion, sensor)
    expected = 19.5 - 12.5 * truth.fire_ns * 1e-9
    np.testing.assert_allclose(scan.xyz_m[:, 0], expected, rtol=0, atol=1e-3)
    assert scan.xyz_m[:, 0].max() - scan.xyz_m[:, 0].min() > 1.2


def test_the_columns_of_a_sweep_see_the_shake_of_their_own_instant(scene: Stage) -> None:
    """A sweep equals the columns of sweeps in which the sensor's attitude is taken at each firing time."""
    motion = shaken_motion(scene, rms_rad=0.03)
    scan, truth = lidar.sweep("lidar", os1(), motion, 0, 0, None)
    R, p = motion.sensor("lidar", truth.fire_ns)
    ground = (truth.object_id == GROUND) & (truth.true_range_m < 200.0)
    world = np.einsum("nij,nj->ni", R, scan.xyz_m.astype(np.float64)) + p
    np.testing.assert_allclose(world[ground, 2], 0.0, atol=1e-4)
    frozen = motion.sensor("lidar", np.zeros(1, np.int64))
    wrong = scan.xyz_m[ground] @ frozen[0][0].T + frozen[1][0]
    assert np.abs(wrong[:, 2]).max() > 0.1


# -- mirror -----------------------------------------------------------------------------------------------

MIRROR = np.diag([1.0, -1.0, 1.0])


def mirrored_world(world: World) -> World:
    """The world with y flipped: positions M p, rotations M R M; a hinge's axis, a pseudovector, -M a."""

    def flip(R: np.ndarray) -> np.ndarray:
        return np.asarray(MIRROR @ R @ MIRROR)

    geoms, table = world.geoms, world.chain
    names = ("kind", "size_m", "body", "bound_m")
    actors = tuple(
        replace(
            actor,
            track=replace(
                actor.track,
                knot_xy_m=actor.track.knot_xy_m * [1.0, -1.0],
                knot_heading_rad=-actor.track.knot_heading_rad,
            ),
        )
        for actor in world.actors
    )
    return replace(
        world,
        geoms=rays.Geoms(
            **{name: getattr(geoms, name) for name in names},
            rotation=flip(geoms.rotation),
            position_m=geoms.position_m @ MIRROR,
        ),
        chain=replace(
            table,
            rotation=flip(table.rotation),
            position_m=table.position_m @ MIRROR,
            axis=-table.axis @ MIRROR,
            anchor_m=table.anchor_m @ MIRROR,
        ),
        static_rotation=flip(world.static_rotation),
        static_position_m=world.static_position_m @ MIRROR,
        actors=actors,
    )


def mirrored(T: Transform) -> Transform:
    return Transform(rotation=MIRROR @ T.rotation @ MIRROR, translation_m=MIRROR @ T.translation_m)


def test_a_mirrored_scene_gives_a_mirrored_scan(scene: Stage) -> None:
    motion, sensor = scripted_motion(scene), os1()
    other = replace(
        motion,
        world=mirrored_world(motion.world),
        T_ego_root=mirrored(motion.T_ego_root),
        T_ego_sensor={name: mirrored(T) for name, T in motion.T_ego_sensor.items()},
    )
    turned = sensor.model_copy(
        update={
            "clockwise": not sensor.clockwise,
            "start_azimuth_deg": -sensor.start_azimuth_deg,
            "azimuth_offset_deg": tuple(-a for a in sensor.azimuth_offset_deg),
        }
    )
    a, ta = lidar.sweep("lidar", sensor, motion, 900 * MS, 9, None)
    b, tb = lidar.sweep("lidar", turned, other, 900 * MS, 9, None)
    assert np.array_equal(a.ring, b.ring)
    assert np.array_equal(a.offset_ns, b.offset_ns)
    assert np.array_equal(ta.object_id, tb.object_id)
    np.testing.assert_allclose(a.xyz_m * [1.0, -1.0, 1.0], b.xyz_m, rtol=1e-5, atol=1e-5)


# -- own body, range law, noise -----------------------------------------------------------------------------


def test_own_returns_below_the_minimum_range_are_dropped_and_above_are_the_egos() -> None:
    """Two balls on the ego: one 0.5 m away, one 1.5 m; behind the near one a wall."""
    shapes = [
        ball((0.6, 0.0, HEIGHT_M), 0.1, mover=0),
        ball((-1.6, 0.0, HEIGHT_M), 0.1, mover=0),
        Shape(kind=rays.BOX, size_m=(0.5, 3.0, 3.0), xyz_m=(10.0, 0.0, 2.0)),
    ]
    sensor = ideal_lidar(elevation_deg=(0.0,), azimuth_offset_deg=(0.0,))
    scan, truth = scan_of(toy_motion(toy_world(shapes, [STILL]), ABOVE), sensor)
    azimuth = np.rad2deg(np.arctan2(scan.xyz_m[:, 1], scan.xyz_m[:, 0]))
    shadow = np.rad2deg(np.arcsin(0.1 / 0.6))
    assert not (np.abs(azimuth) < shadow - 0.01).any()  # the near one returns nothing, but hides the wall
    own = truth.object_id == 0
    assert own.any()
    assert (np.abs(azimuth[own]) > 170.0).all()
    assert (truth.true_range_m >= sensor.min_range_m).all()


def test_the_wearer_hides_part_of_the_scene_and_is_in_the_truth(scene: Stage) -> None:
    _, truth = lidar.sweep("lidar", os1(), scripted_motion(scene), 0, 0, None)
    without = np.flatnonzero(scene.world.geom_object != scene.world.find(scene.system.ego).object_id)
    geoms = scene.world.geoms
    names = ("kind", "size_m", "body", "rotation", "position_m", "bound_m")
    bare = replace(
        scene.world,
        geoms=rays.Geoms(**{name: getattr(geoms, name)[without] for name in names}),
        geom_model_id=scene.world.geom_model_id[without],
        geom_object=scene.world.geom_object[without],
        reflectivity=scene.world.reflectivity[without],
        roughness_gain=scene.world.roughness_gain[without],
    )
    motion = scripted_motion(scene)
    _, naked = lidar.sweep("lidar", os1(), replace(motion, world=bare), 0, 0, None)
    assert len(truth.fire_ns) < 0.95 * len(naked.fire_ns)


def wall_at(range_m: float, reflectivity: float) -> Motion:
    """A sphere around the sensor: every beam meets it upright at the same range."""
    return toy_motion(
        toy_world([ball((0.0, 0.0, HEIGHT_M), range_m, reflectivity=reflectivity)], [STILL]), ABOVE
    )


def test_the_range_law_passes_the_data_sheets_two_points() -> None:
    sensor = os1()
    np.testing.assert_allclose(returns.max_range_m(sensor, np.array([0.1, 0.8])), [40.0, 120.0])
    assert (np.diff(returns.max_range_m(sensor, np.linspace(0.0, 1.0, 50))) >= 0).all()


@pytest.mark.parametrize(
    ("range_m", "reflectivity"), [(35.0, 0.1), (40.0, 0.1), (42.0, 0.1), (110.0, 0.8), (122.0, 0.8)]
)
def test_the_share_of_returns_follows_the_range_law(range_m: float, reflectivity: float) -> None:
    sensor = ideal_lidar(columns=1024)
    scan, _ = scan_of(wall_at(range_m, reflectivity), sensor, seed=1)
    n = 1024 * 16
    share = 1.0 / (
        1.0 + np.exp((range_m / returns.max_range_m(sensor, np.array([reflectivity]))[0] - 1.0) / 0.04)
    )
    assert len(scan.xyz_m) / n == pytest.approx(share, abs=4.5 * np.sqrt(share * (1.0 - share) / n) + 1e-4)


@pytest.mark.parametrize(
    ("range_m", "reflectivity"), [(5.0, 0.8), (20.0, 0.1), (60.0, 0.8), (30.0, 0.1), (75.0, 0.8)]
)
def test_range_noise_has_the_spread_of_its_return_strength_and_no_bias(
    range_m: float, reflectivity: float
) -> None:
    noise = ReturnNoise(high_m=0.015, medium_m=0.03, low_m=0.10)
    sensor = ideal_lidar(noise=noise, columns=1024)
    scan, truth = scan_of(wall_at(range_m, reflectivity), sensor, seed=2)
    error = np.linalg.norm(scan.xyz_m.astype(np.float64), axis=1) - truth.true_range_m
    strength = (returns.max_range_m(sensor, np.array([reflectivity])) / range_m) ** 2
    sd = returns.range_noise_m(sensor, strength)[0]
    n = len(error)
    assert 0.015 <= sd <= 0.10
    assert np.std(error) == pytest.approx(sd, rel=5.0 / np.sqrt(2.0 * n))
    assert abs(np.mean(error)) < 5.0 * sd / np.sqrt(n)


def test_noise_by_strength_is_the_data_sheets_at_high_medium_and_low() -> None:
    noise = returns.range_noise_m(os1(), np.array([1e-9, 1.0, 100 / 12, 250 / 12, 1e6]))
    np.testing.assert_allclose(noise, [0.10, 0.10, 0.03, 0.015, 0.015], rtol=1e-3)


def test_ranges_come_in_steps_of_the_resolution() -> None:
    scan, _ = scan_of(wall_at(9.0, 0.8), os1(), seed=3)
    steps = np.linalg.norm(scan.xyz_m.astype(np.float64), axis=1) / 0.012
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-3)
    assert len(np.unique(np.round(steps))) > 5


def test_angle_noise_moves_the_true_ray_but_not_the_told_direction() -> None:
    """On the ground the true range then scatters by r^2 / h times the elevation error."""
    motion = toy_motion(toy_world([replace(GROUND_PLANE, reflectivity=0.8)], [STILL]), ABOVE)
    sensor = ideal_lidar(
        angle_noise_deg=0.01, columns=2048, elevation_deg=(-10.0,), azimuth_offset_deg=(0.0,)
    )
    scan, truth = scan_of(motion, sensor, seed=4)
    elevation = np.arcsin(scan.xyz_m[:, 2].astype(np.float64) / np.linalg.norm(scan.xyz_m, axis=1))
    np.testing.assert_allclose(np.rad2deg(elevation), -10.0, atol=1e-4)
    true = np.rad2deg(np.arcsin(HEIGHT_M / truth.true_range_m))
    assert np.std(true) == pytest.approx(0.01, rel=0.08)
    assert np.mean(true) == pytest.approx(10.0, abs=0.001)


def test_false_returns_come_at_their_rate_where_nothing_returned() -> None:
    sensor = ideal_lidar(columns=4096, false_positive_rate=0.02)
    scan, truth = scan_of(
        toy_motion(toy_world([ball((500.0, 0.0, 0.0), 0.1)], [STILL]), ABOVE), sensor, seed=5
    )
    n = 4096 * 16
    expected = 0.02 * (1.0 - sensor.min_range_m / returns.MAX_FALSE_RANGE_M)
    assert len(scan.xyz_m) / n == pytest.approx(expected, abs=5.0 * np.sqrt(expected / n))
    assert (truth.object_id == GROUND).all()
    assert (truth.part_id == -1).all()
    full, _ = scan_of(wall_at(9.0, 0.8), sensor, seed=5)
    assert len(full.xyz_m) == n  # a ray that returns has no false return beside it


def test_the_noise_of_a_beam_does_not_depend_on_the_scene() -> None:
    """A ball appears: no other point changes by a bit (beams of no width, which mix nothing at its rim)."""
    sensor = lidar.without(os1(), "divergence")
    plain = toy_world([GROUND_PLANE, ball((0.0, 0.0, HEIGHT_M), 60.0)], [STILL])
    with_ball = toy_world(
        [GROUND_PLANE, ball((0.0, 0.0, HEIGHT_M), 60.0), ball((12.0, 3.0, 1.0), 1.0)], [STILL]
    )
    a, _ = scan_of(toy_motion(plain, ABOVE), sensor, seed=6)
    b, tb = scan_of(toy_motion(with_ball, ABOVE), sensor, seed=6)
    others = tb.part_id != 2
    assert (~others).sum() > 100
    place_a = {key: i for i, key in enumerate(zip(a.offset_ns.tolist(), a.ring.tolist(), strict=True))}
    rows = [place_a[key] for key in zip(b.offset_ns[others].tolist(), b.ring[others].tolist(), strict=True)]
    assert np.array_equal(a.xyz_m[rows], b.xyz_m[others])
    assert np.array_equal(a.intensity[rows], b.intensity[others])


def test_sweeps_taken_one_after_the_other_are_those_taken_alone(scene: Stage) -> None:
    """More of them than have their poses found together."""
    motion, sensor, count = shaken_motion(scene), os1(), lidar.AT_ONCE + 2
    together = list(lidar.sweeps("lidar", sensor, motion, count, lambda seq: stream(1, "lidar", str(seq))))
    assert [scan.seq for scan, _ in together] == list(range(count))
    for seq in (0, lidar.AT_ONCE - 1, lidar.AT_ONCE + 1):
        scan, truth = lidar.sweep("lidar", sensor, motion, seq * 100 * MS, seq, stream(1, "lidar", str(seq)))
        assert np.array_equal(together[seq][0].xyz_m, scan.xyz_m)
        assert np.array_equal(together[seq][1].true_range_m, truth.true_range_m)
        assert together[seq][0].stamp_ns == scan.stamp_ns


def test_the_same_stream_gives_the_same_scan_to_the_bit(scene: Stage) -> None:
    motion = shaken_motion(scene)
    first, again = (lidar.sweep("lidar", os1(), motion, 0, 0, stream(1, "lidar", "0"))[0] for _ in range(2))
    other, _ = lidar.sweep("lidar", os1(), motion, 0, 0, stream(2, "lidar", "0"))
    assert np.array_equal(first.xyz_m, again.xyz_m)
    assert np.array_equal(first.intensity, again.intensity)
    assert first.xyz_m.shape != other.xyz_m.shape or not np.array_equal(first.xyz_m, other.xyz_m)


def test_intensity_is_reflectivity_times_the_cosine_of_incidence() -> None:
    scan, truth = scan_of(toy_motion(toy_world([GROUND_PLANE], [STILL]), ABOVE), endless())
    np.testing.assert_allclose(scan.intensity, 0.2 * np.cos(truth.incidence_rad), atol=1e-6)


def test_rough_ground_sends_back_more_at_grazing_incidence() -> None:
    rough = replace(GROUND_PLANE, roughness_gain=0.4)
    scan, truth = scan_of(toy_motion(toy_world([rough], [STILL]), ABOVE), endless())
    angle = truth.incidence_rad
    expected = 0.2 * (np.cos(angle) + 0.4 * np.sin(angle) ** 2)
    np.testing.assert_allclose(scan.intensity, expected, atol=1e-6)


def test_an_ideal_sensor_sees_to_where_the_real_one_misses_every_second_return() -> None:
    """Its reach is a limit, not an error: sharp at R(rho)."""
    reach = float(returns.max_range_m(os1(), np.array([0.3]))[0])
    for range_m, points in ((0.999 * reach, 64 * 1024), (1.001 * reach, 0)):
        assert len(scan_of(wall_at(range_m, 0.3), os1())[0].xyz_m) == points


def test_every_point_belongs_to_the_object_of_its_part(scene: Stage) -> None:
    scan, truth = lidar.sweep("lidar", os1(), shaken_motion(scene), 200 * MS, 2, np.random.default_rng(3))
    real = truth.part_id >= 0
    assert np.array_equal(truth.object_id[real], scene.world.geom_object[truth.part_id[real]])
    assert (truth.object_id[~real] == GROUND).all()
    objects = np.unique(truth.object_id)
    assert sum(int((truth.object_id == i).sum()) for i in objects) == len(scan.xyz_m)
    assert len(objects) > 8
