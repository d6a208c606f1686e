"""Beams with width: which of them reach over an edge, and what they then return."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.geometry import Transform, rotation_rpy
from scenarios.load import load_sensor
from scenarios.scenario import LidarSensor
from simbench.motion import Motion
from simbench.sensors import cones, footprint, lidar, rays, returns
from simbench.sensors.cones import Cones
from simbench.sensors.shot import Shot, aim
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
)  # fmt: skip

MS = 1_000_000
HEIGHT_M = 1.85
ABOVE = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, HEIGHT_M]))
STILL = straight((0.0, 0.0), 0.0, 0.0)
SD_DEG = 0.13 / 2.3548


def os1(**changes: object) -> LidarSensor:
    sensor = load_sensor("os1-64")
    assert isinstance(sensor, LidarSensor)
    return sensor.model_copy(update=changes)


def wide(**changes: object) -> LidarSensor:
    """A LiDAR that does nothing but mix: four beams level with the ground, 1 degree apart."""
    fields: dict[str, object] = {
        "columns": 360, "elevation_deg": (0.0,), "azimuth_offset_deg": (0.0,), "start_azimuth_deg": 0.0,
        "divergence_deg": (0.13, 0.13), "merge_m": 0.6,
    }  # fmt: skip
    return lidar.without(ideal_lidar(**{**fields, **changes}), "range_law")


def shot_of(motion: Motion, sensor: LidarSensor, start_ns: int = 0) -> Shot:
    table = lidar.beam_table(sensor)
    zero = np.zeros(table.fire_offset_ns.shape, dtype=np.float32)
    return aim("lidar", motion, table, start_ns, zero, zero, 0.0)


def echoes_of(motion: Motion, sensor: LidarSensor) -> tuple[returns.Echoes, np.ndarray]:
    """What the sensor's beams return, and which of them [g k] were looked at closely."""
    shot = shot_of(motion, sensor)
    hits = shot.cast()
    echoes = returns.pure(hits, shot.world.reflectivity, shot.world.roughness_gain)
    sd_rad = footprint.beam_sd_rad(sensor)
    edges = footprint.edge_beams(shot, hits, sd_rad)
    within = shot.cast_beside(edges, footprint.SAMPLES * sd_rad)
    edge = np.zeros(hits.geom.shape, dtype=np.bool_)
    edge[edges.fan, edges.step] = True
    return footprint.mixed(sensor, shot.world, edges, within, echoes), edge


def brute_echoes_of(motion: Motion, sensor: LidarSensor) -> returns.Echoes:
    """The same with all rays of all beams cast at all geoms."""
    shot = shot_of(motion, sensor)
    hits = shot.cast()
    echoes = returns.pure(hits, shot.world.reflectivity, shot.world.roughness_gain)
    every = all_cones(shot)
    within = cast_as_fans(shot, every, footprint.SAMPLES * footprint.beam_sd_rad(sensor))
    return footprint.mixed(sensor, shot.world, every, within, echoes)


def all_cones(shot: Shot) -> Cones:
    """The cones of all beams; which geoms they may meet is left open."""
    fan, step = np.divmod(np.arange(len(shot.instant_ns) * shot.width), shot.width)
    return Cones(fan=fan, step=step, first=np.zeros(len(fan) + 1, np.int64), member=np.empty(0, np.int32))


def cast_as_fans(shot: Shot, at: Cones, offset_rad: np.ndarray) -> rays.Hits:
    """The rays of some cones as short fans of `rays.cast_fans`, which looks for what they meet by itself."""
    lanes = shot.fans.slope.shape[2]
    packed = (at.fan // lanes, at.step, at.fan % lanes)
    ray = np.stack([np.ones(len(at.fan)), shot.fans.slope[packed], shot.fans.skew[packed]], axis=1)
    along = np.einsum("nij,nj->ni", shot.fans.frame[at.fan], ray)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    left = np.cross([0.0, 0.0, 1.0], along)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    frame = np.stack([along, np.cross(along, left), left], axis=2)
    hits = rays.empty_hits((len(at.fan), len(offset_rad)))
    fans = rays.make_fans(
        frame, *(np.tile(np.tan(angle), (len(frame), 1)) for angle in offset_rad[:, ::-1].T), at.fan,
        np.arange(len(frame)) * len(offset_rad), 1,
    )  # fmt: skip
    rays.cast_fans(shot.placed, shot.key, shot.weight, shot.rotation, shot.origin_m, fans, hits)
    return hits


@pytest.fixture(scope="module")
def scene() -> Stage:
    return staged("overtake-approach", "car", 0)


# -- the footprint ----------------------------------------------------------------------------------------


def test_the_samples_are_the_bell_on_a_hexagonal_grid() -> None:
    radius = np.hypot(*footprint.SAMPLES.T)
    assert sorted(np.round(radius**2).astype(int).tolist()) == [0] + 6 * [1] + 6 * [3] + 6 * [4]
    assert footprint.WEIGHTS.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(footprint.WEIGHTS / footprint.WEIGHTS.max(), np.exp(-0.5 * radius**2))
    np.testing.assert_allclose(footprint.WEIGHTS @ footprint.SAMPLES, 0.0, atol=1e-15)
    spacing = np.linalg.norm(footprint.SAMPLES[:, None] - footprint.SAMPLES, axis=-1)
    assert spacing[spacing > 0.0].min() == pytest.approx(1.0)


def test_no_sample_is_farther_out_than_the_footprints_radius() -> None:
    assert np.hypot(*footprint.SAMPLES.T).max() == pytest.approx(footprint.RADIUS_SD)


def test_half_the_weight_lies_within_the_full_width_at_half_maximum() -> None:
    """Of a round Gaussian; the grid's rings at 0 and 1 SD (FWHM ends at 1.18 SD) hold 0.68 of the sampled
    part, which ends at 2 to 2.5 SD and holds 0.86 to 0.95 of all."""
    inside = footprint.WEIGHTS[np.hypot(*footprint.SAMPLES.T) < 1.1774].sum()
    assert inside == pytest.approx(0.5 / 0.75, abs=0.03)


# -- which beams ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_every_footprint_over_an_edge_is_found_and_not_too_many_others_are_looked_at(system: str) -> None:
    """Brute force as the oracle: all 19 rays of all beams."""
    motion = shaken_motion(staged("overtake-approach", system, 3))  # type: ignore[arg-type]
    sensor = os1()
    found, edge = echoes_of(motion, sensor)
    brute = brute_echoes_of(motion, sensor)
    plain = shot_of(motion, sensor).cast()
    straddles = (brute.geom != plain.geom) | (brute.range_m != plain.range_m)
    straddles &= (
        np.minimum(np.where(brute.geom >= 0, brute.range_m, np.inf), plain.range_m) < 200.0
    )  # no horizon
    assert 500 < straddles.sum() < 0.04 * straddles.size
    assert edge.sum() < 3.0 * straddles.sum()
    assert edge[straddles].all()
    same = plain.range_m < 200.0
    assert np.array_equal(found.geom[same], brute.geom[same])
    for name in ("range_m", "true_range_m", "cosine", "reflectivity"):
        np.testing.assert_allclose(getattr(found, name)[same], getattr(brute, name)[same], rtol=1e-6)


@settings(max_examples=25)
@given(
    kinds=st.lists(
        st.sampled_from([rays.SPHERE, rays.CAPSULE, rays.ELLIPSOID, rays.CYLINDER, rays.BOX]),
        min_size=1, max_size=8,
    ),
    seed=st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_edges_of_all_shapes_are_found_however_thin_they_are(kinds: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    azimuth, climb = rng.uniform(-3.1, 3.1, len(kinds)), rng.uniform(-0.2, 0.2, len(kinds))
    shapes = [
        Shape(
            kind=kind,
            size_m=tuple(np.exp(rng.uniform(np.log(0.002), np.log(3.0), 3)).tolist()),  # type: ignore[arg-type]
            xyz_m=tuple(
                (rng.uniform(4.0, 25.0) * np.array([np.cos(a), np.sin(a), e]) + [0, 0, HEIGHT_M]).tolist()
            ),  # type: ignore[arg-type]
            rotation=rotation_rpy(*rng.uniform(-3.0, 3.0, 3)),
        )
        for kind, a, e in zip(kinds, azimuth, climb, strict=True)
    ]
    motion = toy_motion(toy_world(shapes, [STILL]), ABOVE)
    sensor = ideal_lidar(divergence_deg=(0.3, 0.3), merge_m=0.6)
    _, edge = echoes_of(motion, sensor)
    brute = brute_echoes_of(motion, sensor)
    plain = shot_of(motion, sensor).cast()
    straddles = (brute.geom != plain.geom) | (brute.range_m != plain.range_m)
    assert edge[straddles].all()


def test_a_wire_between_the_beams_is_seen_by_the_beams_beside_it() -> None:
    """A wire of 2 mm at 5 m, 0.06 degrees beside a beam, which ends at 0.11: no middle ray meets it."""
    angle = np.deg2rad(-10.06)
    wire = Shape(
        kind=rays.CYLINDER, size_m=(0.001, 0.5, 0.0), xyz_m=(5 * np.cos(angle), 5 * np.sin(angle), HEIGHT_M)
    )
    motion = toy_motion(toy_world([wire], [STILL]), ABOVE)
    assert (shot_of(motion, wide()).cast().geom == -1).all()
    echoes, edge = echoes_of(motion, wide())
    assert np.flatnonzero(edge[:, 0]).tolist() == [10]
    assert np.flatnonzero(echoes.geom[:, 0] == 0).tolist() == [10]
    share = echoes.reflectivity[10, 0] / (0.8 * echoes.cosine[10, 0])
    assert 0.01 < share < 0.5


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), inside=st.booleans())
def test_the_rays_of_an_edge_beam_meet_what_they_meet_among_all_geoms(seed: int, inside: bool) -> None:
    """Crowds of moving shapes, so that many stand behind one another and a set needs several words; on
    wish the sensor is inside one of them."""
    rng = np.random.default_rng(seed)
    kinds = rng.choice([rays.SPHERE, rays.CAPSULE, rays.ELLIPSOID, rays.CYLINDER, rays.BOX], 150)
    angle = rng.uniform(-0.5, 0.5, len(kinds))
    shapes = [
        Shape(
            kind=int(kind),
            size_m=tuple(np.exp(rng.uniform(np.log(0.01), np.log(0.6), 3)).tolist()),  # type: ignore[arg-type]
            xyz_m=(far * np.cos(a), far * np.sin(a), float(rng.uniform(0.5, 3.0))),
            rotation=rotation_rpy(*rng.uniform(-3.0, 3.0, 3)),
            mover=int(rng.integers(0, 2)),
        )
        for kind, a, far in zip(kinds, angle, rng.uniform(3.0, 30.0, len(kinds)), strict=True)
    ]
    shapes.append(Shape(kind=rays.PLANE, size_m=(0.0, 0.0, 1.0)))
    if inside:
        shapes.append(Shape(kind=rays.BOX, size_m=(6.0, 9.0, 4.0), xyz_m=(1.0, 0.0, 0.0)))
    tracks = [straight((0.0, 0.0), 0.0, 3.0), straight((0.0, 1.0), 60.0, 4.0)]
    motion = toy_motion(toy_world(shapes, tracks), ABOVE)
    sensor = ideal_lidar(divergence_deg=(0.3, 0.2), merge_m=0.6)
    shot, sd_rad = shot_of(motion, sensor), footprint.beam_sd_rad(sensor)
    edges = footprint.edge_beams(shot, shot.cast(), sd_rad)
    assert len(edges.fan) > 10
    assert len(edges.member) < 0.2 * len(shapes) * len(edges.fan)
    few = shot.cast_beside(edges, footprint.SAMPLES * sd_rad)
    all_ = cast_as_fans(shot, edges, footprint.SAMPLES * sd_rad)
    assert np.array_equal(few.geom, all_.geom)
    np.testing.assert_allclose(few.range_m, all_.range_m, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(few.cosine, all_.cosine, rtol=1e-5, atol=1e-6)


def test_room_for_what_cones_may_meet_grows_as_needed(monkeypatch: pytest.MonkeyPatch, scene: Stage) -> None:
    shot = shot_of(scripted_motion(scene), os1(columns=64))
    hits, sd_rad = shot.cast(), footprint.beam_sd_rad(os1())
    plenty = footprint.edge_beams(shot, hits, sd_rad)
    monkeypatch.setattr(cones, "ROOM_PER_RAY", 1)
    little = footprint.edge_beams(shot, hits, sd_rad)
    for name in ("fan", "step", "first", "member"):
        assert np.array_equal(getattr(plenty, name), getattr(little, name))


# -- what they return -------------------------------------------------------------------------------------


def strongest(
    distance: np.ndarray, geom: np.ndarray, power: np.ndarray, merge_m: float
) -> tuple[float, int, float] | None:
    """Mean range, geom and true range of the strongest return of one footprint: the rule in plain Python."""
    order = [int(i) for i in np.argsort(distance, kind="stable") if geom[i] >= 0]
    if not order:
        return None
    clusters: list[list[int]] = [[order[0]]]
    for before, i in pairwise(order):
        if distance[i] - distance[before] >= merge_m:
            clusters.append([])
        clusters[-1].append(i)
    best = max(clusters, key=lambda rows: sum(power[i] for i in rows))
    total = sum(power[i] for i in best)
    of_geom = {g: sum(power[i] for i in best if geom[i] == g) for g in {int(geom[i]) for i in best}}
    main = max(of_geom, key=lambda g: of_geom[g])
    sample = max((i for i in best if geom[i] == main), key=lambda i: power[i])
    return sum(power[i] * distance[i] for i in best) / total, main, float(distance[sample])


@settings(max_examples=200)
@given(seed=st.integers(0, 2**32 - 1), geoms=st.integers(1, 4), merge_m=st.sampled_from([0.1, 0.6, 3.0]))
def test_the_reported_return_is_the_strongest_of_those_a_pulse_apart(
    seed: int, geoms: int, merge_m: float
) -> None:
    rng = np.random.default_rng(seed)
    geom = rng.integers(-1, geoms, 19)
    distance = np.where(geom >= 0, rng.uniform(5.0, 6.0, 4)[geom] + rng.uniform(0.0, 0.3, 19), np.inf)
    distance += np.where(geom == 2, 2.0, 0.0)
    cosine = rng.uniform(0.1, 1.0, 19).astype(np.float32)
    reflectivity, gain = rng.uniform(0.1, 0.9, 4), rng.uniform(0.0, 0.5, 4)
    out = [np.array([[-5.0]]), np.array([[-5.0]]), np.array([[7]], np.int32), np.zeros((1, 1), np.float32)]
    back = np.array([[-5.0]])
    footprint._mix(
        distance[None], geom[None].astype(np.int32), cosine[None], footprint.WEIGHTS, reflectivity, gain,
        merge_m, np.zeros(1, np.int64), np.zeros(1, np.int64), *out, back,
    )  # fmt: skip
    x = cosine.astype(np.float64)
    sent = footprint.WEIGHTS * reflectivity[geom] * (x + gain[geom] * (1.0 - x * x))
    expected = strongest(distance, geom, sent / distance**2, merge_m)
    if len(set(geom.tolist())) == 1:
        assert out[2][0, 0] == 7  # untouched: the middle ray says it all
        return
    assert expected is not None
    assert out[0][0, 0] == pytest.approx(expected[0], rel=1e-9)
    assert (int(out[2][0, 0]), float(out[1][0, 0])) == (expected[1], expected[2])


def two_walls(gap_m: float, near_share: float = 0.8, far: float = 0.8) -> Motion:
    """A wall at 10 m that ends where the forward beam looks, `gap_m` before an endless one."""
    shapes = [
        Shape(kind=rays.BOX, size_m=(0.05, 5.0, 5.0), xyz_m=(10.05, 5.0, 0.0), reflectivity=near_share),
        Shape(kind=rays.BOX, size_m=(0.05, 50.0, 9.0), xyz_m=(10.05 + gap_m, 0.0, 0.0), reflectivity=far),
    ]
    return toy_motion(toy_world(shapes, [STILL]), ABOVE)


def forward(motion: Motion, sensor: LidarSensor) -> tuple[float, float, int, float]:
    """Range, true range, part and intensity of the only point in the forward direction."""
    scan, truth = lidar.sweep("lidar", sensor, motion, 0, 0, np.random.default_rng(0))
    (row,) = np.flatnonzero(np.abs(np.arctan2(scan.xyz_m[:, 1], scan.xyz_m[:, 0])) < 1e-4)
    return (
        float(np.linalg.norm(scan.xyz_m[row])), float(truth.true_range_m[row]), int(truth.part_id[row]),
        float(scan.intensity[row]),
    )  # fmt: skip


def test_walls_nearer_than_a_pulse_mix_to_a_point_in_between() -> None:
    """By hand: weights are 1, 6 times 0.6065, 0.2231 and 0.1353, in all 6.79, of which 1 + 2 x 0.2231 = 1.446
    lie on the line up through the middle. With the edge just beside that line the near wall gets those and
    half of the rest: 0.6065. The far one gets 0.3935."""
    motion = two_walls(0.4)
    shift = replace(
        motion.world.geoms, position_m=motion.world.geoms.position_m - [[0.0, 1e-6, 0.0], [0, 0, 0]]
    )
    motion = replace(motion, world=replace(motion.world, geoms=shift))
    near, far = 0.6065, 0.3935
    expected = (near * 10.0 / 10.0**2 + far * 10.4 / 10.4**2) / (near / 10.0**2 + far / 10.4**2)
    range_m, true_m, part, _ = forward(motion, wide())
    assert range_m == pytest.approx(expected, abs=1e-4)
    assert (true_m, part) == (pytest.approx(10.0, abs=1e-4), 0)
    assert 10.1 < range_m < 10.3


@pytest.mark.parametrize(("near", "far", "range_m", "part"), [(0.8, 0.3, 10.0, 0), (0.1, 0.9, 12.0, 1)])
def test_of_walls_farther_apart_the_stronger_wins_and_nothing_lies_between(
    near: float, far: float, range_m: float, part: int
) -> None:
    measured, true_m, hit, intensity = forward(two_walls(2.0, near, far), wide())
    assert measured == pytest.approx(range_m, abs=1e-3)
    assert (true_m, hit) == (pytest.approx(range_m, abs=1e-3), part)
    assert intensity < 0.75 * max(near, far)  # only part of the footprint lies on it


def test_the_truth_of_a_mixed_point_lies_on_the_object_that_it_names(scene: Stage) -> None:
    motion, sensor = scripted_motion(scene), lidar.without(os1(), "range_noise", "resolution", "angle_noise")
    scan, truth = lidar.sweep("lidar", sensor, motion, 0, 0, np.random.default_rng(0))
    measured = np.linalg.norm(scan.xyz_m.astype(np.float64), axis=1)
    mixed = (np.abs(measured - truth.true_range_m) > 0.02) & (truth.part_id >= 0)
    assert 100 < mixed.sum() < 0.02 * len(measured)
    R, p = motion.sensor("lidar", truth.fire_ns)
    told = scan.xyz_m / measured[:, None] * truth.true_range_m[:, None]
    world = np.einsum("nij,nj->ni", R, told) + p
    beside = 0.01 + np.deg2rad(2.0 * SD_DEG) * truth.true_range_m  # the sample may look this far aside
    for info in scene.world.objects:
        own = mixed & (truth.object_id == info.object_id)
        if not own.any() or info.category == "pedestrian":
            continue
        R_box, p_box = motion.object_centre(info.object_id, truth.fire_ns[own])
        local = np.abs(np.einsum("nji,nj->ni", R_box, world[own] - p_box))
        assert (local <= 0.5 * np.array(info.size_m) + 0.03 + beside[own][:, None]).all(), info.name


def test_divergence_changes_edge_beams_only_and_no_other_draw(scene: Stage) -> None:
    motion, sensor = scripted_motion(scene), os1()
    a, _ = lidar.sweep("lidar", sensor, motion, 0, 0, np.random.default_rng(7))
    b, _ = lidar.sweep("lidar", lidar.without(sensor, "divergence"), motion, 0, 0, np.random.default_rng(7))
    c, _ = lidar.sweep("lidar", os1(divergence_deg=(0.0, 0.0)), motion, 0, 0, np.random.default_rng(7))
    for name in ("xyz_m", "intensity", "offset_ns", "ring"):
        assert np.array_equal(getattr(b, name), getattr(c, name))
    beam = [
        {(int(t), int(r)): i for i, (t, r) in enumerate(zip(s.offset_ns, s.ring, strict=True))}
        for s in (a, b)
    ]
    both = sorted(beam[0].keys() & beam[1].keys())
    rows_a, rows_b = [beam[0][key] for key in both], [beam[1][key] for key in both]
    changed = (a.xyz_m[rows_a] != b.xyz_m[rows_b]).any(axis=1)
    assert 0 < changed.sum() < 0.03 * len(both)
    assert abs(len(a.xyz_m) - len(b.xyz_m)) < 0.03 * len(both)


# -- laws -------------------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), yaw=st.floats(-3.0, 3.0), x=st.floats(-50.0, 50.0))
def test_world_and_sensor_turned_together_change_nothing(seed: int, yaw: float, x: float) -> None:
    """Moving target, moving ego, beams with width."""
    rng = np.random.default_rng(seed)
    turn, shift = rotation_rpy(0.0, 0.0, yaw), np.array([x, 7.0, 0.0])
    spots = [np.array([*rng.uniform(6.0, 20.0, 2) * rng.choice([-1, 1], 2), 1.5]) for _ in range(5)]
    kinds = (rays.SPHERE, rays.CAPSULE, rays.ELLIPSOID, rays.CYLINDER, rays.BOX)
    sizes = [tuple(rng.uniform(0.3, 2.0, 3).tolist()) for _ in kinds]
    attitudes = [rotation_rpy(*rng.uniform(-3.0, 3.0, 3)) for _ in kinds]
    scans = []
    for R, p, heading in ((np.eye(3), np.zeros(3), 0.0), (turn, shift, np.rad2deg(yaw))):
        shapes = [
            Shape(kind=kind, size_m=size, xyz_m=tuple((R @ spot + p).tolist()), rotation=R @ attitude)  # type: ignore[arg-type]
            for kind, size, spot, attitude in zip(kinds, sizes, spots, attitudes, strict=True)
        ]
        shapes.append(Shape(kind=rays.BOX, size_m=(2.0, 0.8, 0.7), xyz_m=(0.0, 0.0, 0.7), mover=1))
        shapes.append(Shape(kind=rays.PLANE, size_m=(0.0, 0.0, 1.0)))
        start = R @ np.array([9.0, -4.0, 0.0]) + p
        tracks = [
            straight((p[0], p[1]), heading, 12.5),
            straight((float(start[0]), float(start[1])), heading + 30.0, 7.0),
        ]
        motion = toy_motion(toy_world(shapes, tracks), ABOVE)
        sensor = wide(
            columns=512, elevation_deg=(8.0, 2.0, -3.0, -9.0), azimuth_offset_deg=(3.0, 1.0, -1.0, -3.0)
        )
        scans.append(lidar.sweep("lidar", sensor, motion, 0, 0, np.random.default_rng(0)))
    (a, ta), (b, tb) = scans
    assert np.array_equal(a.offset_ns, b.offset_ns) and np.array_equal(a.ring, b.ring)
    assert np.array_equal(ta.part_id, tb.part_id)
    np.testing.assert_allclose(a.xyz_m, b.xyz_m, rtol=1e-5, atol=1e-5)
    assert len(a.xyz_m) > 200
