"""The built world: same seed, same world; no overlaps; materials in range; intensity that tells nothing."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import rankdata

from scenarios.errors import BadInput
from scenarios.palette import palette
from scenarios.scenario import Scatter
from scenarios.seeding import stream
from simbench.sensors import lidar, rays
from simbench.world import GROUND, build_world, half_extent, part_info
from tests.simbench.scenes import Stage, SystemName, scripted_motion, staged

S = 1_000_000_000
SYSTEMS: tuple[SystemName, ...] = ("car", "wearable")


@lru_cache(maxsize=64)
def of_seed(system: SystemName, seed: int) -> Stage:
    """The two overtakes in turn."""
    return staged(("overtake-approach", "overtake-recede")[seed % 2], system, seed)


def fingerprint(of: Stage) -> list[np.ndarray]:
    world, model = of.world, of.world.model
    tables = [
        getattr(world.geoms, name) for name in ("kind", "size_m", "body", "rotation", "position_m", "bound_m")
    ]
    return [
        *tables,
        world.reflectivity,
        world.geom_object,
        world.box_centre_m,
        model.mat_rgba,
        model.geom_size,
    ]


# -- seeds ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_same_seed_builds_the_same_world_and_another_seed_another(system: SystemName) -> None:
    first, again = staged("overtake-approach", system, 4), staged("overtake-approach", system, 4)
    other = staged("overtake-approach", system, 6)
    assert first.world.objects == again.world.objects
    for a, b in zip(fingerprint(first), fingerprint(again), strict=True):
        assert np.array_equal(a, b)
    assert not np.array_equal(first.world.static_position_m, other.world.static_position_m)
    assert not np.array_equal(first.world.reflectivity, other.world.reflectivity)


# -- overlaps ---------------------------------------------------------------------------------------------


def corners(of: Stage, t_ns: np.ndarray) -> np.ndarray:
    """Footprint rectangles [objects n 4 2] of all rest-pose boxes."""
    motion = scripted_motion(of)
    result = []
    for info in of.world.objects:
        R, p = motion.object_centre(info.object_id, t_ns)
        half = 0.5 * np.array(info.size_m[:2])
        local = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * half
        result.append(np.einsum("nij,kj->nki", R[:, :2, :2], local) + p[:, None, :2])
    return np.array(result)


def overlapping(boxes: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of objects whose rectangles [objects n 4 2] at some time no line along a side parts."""
    i, j = np.triu_indices(len(boxes), 1)
    separated = np.zeros((len(i), boxes.shape[1]), dtype=bool)
    for sides in (boxes[i], boxes[j]):
        for k in range(2):
            axis = sides[:, :, k + 1] - sides[:, :, k]
            pa, pb = (np.einsum("pnki,pni->pnk", boxes[which], axis) for which in (i, j))
            separated |= (pa.max(axis=2) < pb.min(axis=2)) | (pb.max(axis=2) < pa.min(axis=2))
    bad = ~separated.all(axis=1)
    return list(zip(i[bad].tolist(), j[bad].tolist(), strict=True))


def test_for_thirty_seeds_nothing_overlaps_or_stands_on_a_lane_at_any_time() -> None:
    """By rectangles of the true footprints: an oracle that knows nothing of the circles that placed them. The
    cameras and the reference go on for half a second after the last sweep."""
    for seed in range(30):
        of = of_seed(SYSTEMS[seed // 2 % 2], seed)
        boxes = corners(of, np.arange(0, int((of.system.duration_s + 0.5) * S), 200_000_000))
        assert overlapping(boxes) == [], seed
        for info in of.world.objects:
            if info.name in of.system.actors:
                continue
            y = boxes[info.object_id, ..., 1]
            for low, high in of.scenario.road.lanes_m:
                assert np.all((y.min(axis=1) > high) | (y.max(axis=1) < low)), (seed, info.name)


def test_a_larger_actor_is_kept_clear_by_its_own_size() -> None:
    """An actor of eight times its part's size must not be surrounded as if it had the part's."""
    of = staged("overtake-approach", "car", 0)
    actors = dict(of.system.actors)
    actors["rider"] = actors["rider"].model_copy(update={"scale": 8.0})
    system = of.system.model_copy(update={"actors": actors})
    posts = Scatter(part="pedestrian", category="pedestrian", count=30, area_m=(20.0, -12.0, 80.0, -4.5))
    scenario = of.scenario.model_copy(update={"background": (posts,)})
    world = build_world(scenario, system, 0)
    big = Stage(scenario=scenario, system=system, rig=of.rig, world=world)
    boxes = corners(big, np.arange(0, 5 * S, 100_000_000))
    rider, car = (world.find(name).object_id for name in ("rider", "car"))
    assert [pair for pair in overlapping(boxes) if rider in pair and car not in pair] == []


def test_an_area_without_room_is_one_sentence() -> None:
    of = staged("overtake-approach", "car", 0)
    full = Scatter(part="building", category="building", count=9, area_m=(0.0, 20.0, 20.0, 25.0))
    with pytest.raises(BadInput) as caught:
        build_world(of.scenario.model_copy(update={"background": (full,)}), of.system, 0)
    assert "no room for building" in str(caught.value)
    assert "\n" not in str(caught.value)


# -- tables -----------------------------------------------------------------------------------------------


def surface(kind: int, size: np.ndarray, rng: np.random.Generator, n: int = 4000) -> np.ndarray:
    """Random points on a primitive's surface, and its extreme ones' neighbourhood by number alone."""
    ball = rng.standard_normal((n, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    side = np.where(rng.random((n, 1)) < 0.5, -1.0, 1.0) * [[0.0, 0.0, size[1]]]
    if kind == rays.SPHERE:
        return np.asarray(ball * size[0])
    if kind == rays.ELLIPSOID:
        return np.asarray(ball * size)
    if kind == rays.CAPSULE:
        return np.asarray(ball * size[0] + side)
    if kind == rays.CYLINDER:
        ring = ball * [1.0, 1.0, 0.0]
        return np.asarray(ring / np.linalg.norm(ring, axis=1, keepdims=True) * size[0] + side)
    return np.asarray(np.sign(ball) * size)


@settings(max_examples=40)
@given(
    kind=st.sampled_from([rays.SPHERE, rays.CAPSULE, rays.ELLIPSOID, rays.CYLINDER, rays.BOX]),
    seed=st.integers(0, 2**31),
)
def test_half_extents_are_those_of_the_surface(kind: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    size, quaternion, matrix = rng.uniform(0.1, 2.0, 3), rng.standard_normal(4), np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion / np.linalg.norm(quaternion))
    rotation = matrix.reshape(3, 3)
    found = half_extent(np.array([kind], dtype=np.int32), size[None], rotation[None])[0]
    reach = np.abs(surface(kind, size, rng) @ rotation.T).max(axis=0)
    assert np.all(reach <= found + 1e-9)
    np.testing.assert_allclose(reach, found, rtol=0.02)


@pytest.mark.parametrize("system", SYSTEMS)
def test_sizes_follow_the_part_and_the_scale(system: SystemName) -> None:
    of = of_seed(system, 2)
    for name, actor in of.system.actors.items():
        np.testing.assert_allclose(of.world.find(name).size_m, part_info(actor.part).size_m * actor.scale)
    scales = {actor.scale for name, actor in of.system.actors.items() if name != of.system.ego}
    assert scales != {1.0}


def test_bounding_spheres_hold_their_geoms() -> None:
    world = of_seed("car", 0).world
    finite = world.geoms.kind != rays.PLANE
    assert np.isinf(world.geoms.bound_m[~finite]).all()
    rng = np.random.default_rng(0)
    for g in np.flatnonzero(finite):
        reach = np.linalg.norm(
            surface(int(world.geoms.kind[g]), world.geoms.size_m[g], rng, 200), axis=1
        ).max()
        assert reach <= world.geoms.bound_m[g] * (1.0 + 1e-9)


def test_every_geom_but_the_ground_belongs_to_an_object_and_every_object_has_some() -> None:
    world = of_seed("wearable", 1).world
    assert set(np.unique(world.geom_object)) == {GROUND, *range(len(world.objects))}
    assert (world.geoms.kind[world.geom_object == GROUND] == rays.PLANE).all()
    assert [o.object_id for o in world.objects] == list(range(len(world.objects)))


def test_paint_on_the_road_is_for_cameras_only() -> None:
    model = of_seed("car", 0).world.model
    painted = np.flatnonzero(model.geom_group == 2)
    assert len(painted) > 4
    assert not set(painted) & set(of_seed("car", 0).world.geom_model_id)
    assert (model.geom_pos[painted, 2] + model.geom_size[painted, 2]).max() < 0.005


# -- materials --------------------------------------------------------------------------------------------


def test_colours_and_reflectivities_are_drawn_in_their_ranges_once_per_scene_or_instance() -> None:
    known = palette()
    per_instance: dict[str, set[float]] = {}
    for seed in range(4):
        world = of_seed("car", seed).world
        shared: dict[str, set[float]] = {}
        for row, geom in enumerate(world.geom_model_id):
            name = world.model.material(int(world.model.geom_matid[geom])).name
            entry, value = known[name.split("/")[-1]], float(world.reflectivity[row])
            assert entry["reflectivity"][0] <= value <= entry["reflectivity"][1]
            where = shared if entry["per"] == "scene" else per_instance
            where.setdefault(name.split("/")[-1], set()).add(value)
            if "/" in name:
                rgb = world.model.mat_rgba[world.model.geom_matid[geom]][:3]
                assert np.abs(np.array(entry["colours"]) - rgb).max(axis=1).min() < 1e-6
        assert all(len(values) == 1 for values in shared.values()), shared
    assert len(per_instance["paint"]) >= 12
    assert len(per_instance["top"]) >= 12


def auc(a: np.ndarray, b: np.ndarray) -> float:
    """Chance that a draw of `a` lies above one of `b`, ties half."""
    rank = rankdata(np.concatenate([a, b]))
    return float((rank[: len(a)].sum() - len(a) * (len(a) + 1) / 2) / (len(a) * len(b)))


@pytest.mark.parametrize("system", SYSTEMS)
def test_intensity_alone_does_not_tell_the_target_from_the_background(
    system: SystemName, record_property: Any
) -> None:
    """Real returns within 40 m, as many of each seed. With the ground's among them it tells a little more:
    asphalt is darker than most things."""
    target, background, with_ground = [], [], []
    for seed in range(20):
        of = of_seed(system, seed)
        motion = scripted_motion(of)
        target_id, ego_id = (
            of.world.find(name).object_id for name in (of.system.target or "", of.system.ego)
        )
        seq = 10 + 30 * (seed // 2 % 2)
        scan, truth = lidar.sweep(
            of.rig.lidar_name,
            of.rig.lidar,
            motion,
            seq * S // 10,
            seq,
            stream(seed, "lidar", "lidar", str(seq)),
        )
        near = (np.linalg.norm(scan.xyz_m, axis=1) < 40.0) & (truth.object_id != ego_id)
        pick = np.random.default_rng(seed)
        own = truth.object_id == target_id
        for rows, mask, n in (
            (target, own, 80),
            (background, ~own & (truth.object_id != GROUND), 400),
            (with_ground, ~own, 400),
        ):
            rows.append(scan.intensity[pick.permutation(np.flatnonzero(mask & near))[:n]])
    found = auc(np.concatenate(target), np.concatenate(background))
    among_ground = auc(np.concatenate(target), np.concatenate(with_ground))
    record_property("auc", found)
    record_property("auc_with_ground", among_ground)
    assert sum(map(len, target)) > 800
    assert max(found, 1.0 - found) < 0.7, found
    assert max(among_ground, 1.0 - among_ground) < 0.75, among_ground
