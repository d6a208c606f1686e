"""The ray kernel against MuJoCo's own rays, and against closed forms."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.geometry import rotation_exp
from simbench.sensors import rays
from tests.simbench.scenes import bound_m

KINDS = (rays.SPHERE, rays.CAPSULE, rays.ELLIPSOID, rays.CYLINDER, rays.BOX)
NAMES = {
    rays.PLANE: "plane", rays.SPHERE: "sphere", rays.CAPSULE: "capsule", rays.ELLIPSOID: "ellipsoid",
    rays.CYLINDER: "cylinder", rays.BOX: "box",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Scene:
    """The same primitives for MuJoCo and for the kernel; every second one rides on a mocap body."""

    model: mujoco.MjModel
    data: mujoco.MjData
    geoms: rays.Geoms
    body_rotation: np.ndarray
    body_position: np.ndarray


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    q = np.empty(9)
    quaternion = rng.standard_normal(4)
    mujoco.mju_quat2Mat(q, quaternion / np.linalg.norm(quaternion))
    return q.reshape(3, 3)


def make_scene(kinds: list[int], rng: np.random.Generator, spread_m: float = 6.0) -> Scene:
    spec = mujoco.MjSpec()
    rows: list[tuple[int, np.ndarray, int, np.ndarray, np.ndarray]] = []
    bodies_R, bodies_p = [np.eye(3)], [np.zeros(3)]
    for number, kind in enumerate(kinds):
        size = np.exp(rng.uniform(np.log(0.02), np.log(2.0), 3))
        if kind == rays.PLANE:
            size = np.array([0.0, 0.0, 1.0]) if rng.random() < 0.5 else np.array([4.0, 3.0, 1.0])
        quaternion = rng.standard_normal(4)
        quaternion /= np.linalg.norm(quaternion)
        if rng.random() < 0.2:
            quaternion = np.array([1.0, 0.0, 0.0, 0.0])  # rays along the axes then happen
        position = rng.uniform(-spread_m, spread_m, 3)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, quaternion)
        parent, owner = spec.worldbody, 0
        if number % 2 and kind != rays.PLANE:
            parent, owner = spec.worldbody.add_body(name=f"b{number}", mocap=True), len(bodies_R)
            bodies_R.append(random_rotation(rng))
            bodies_p.append(rng.uniform(-spread_m, spread_m, 3))
        parent.add_geom(type=mujoco.mjtGeom(kind), size=size, pos=position, quat=quaternion)
        rows.append((kind, size, owner, rotation.reshape(3, 3), position))
    rows.sort(key=lambda row: row[2])  # MuJoCo's order: by body
    model = spec.compile()
    data = mujoco.MjData(model)
    for i in range(1, len(bodies_R)):
        data.mocap_pos[i - 1] = bodies_p[i]
        mujoco.mju_mat2Quat(data.mocap_quat[i - 1], bodies_R[i].reshape(9))
    mujoco.mj_kinematics(model, data)
    return Scene(
        model=model,
        data=data,
        geoms=rays.Geoms(
            kind=np.array([r[0] for r in rows]),
            size_m=np.array([r[1] for r in rows]),
            body=np.array([r[2] for r in rows]),
            rotation=np.array([r[3] for r in rows]),
            position_m=np.array([r[4] for r in rows]),
            bound_m=np.array([bound_m(r[0], r[1]) for r in rows]),
        ),
        body_rotation=np.array(bodies_R)[None],
        body_position=np.array(bodies_p)[None],
    )


def make_rays(scene: Scene, rng: np.random.Generator, groups: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins [g 3] (a third of them inside a geom) and directions [g k 3]: anywhere, at a geom,
    grazing one."""
    n = len(scene.geoms.kind)
    origin = rng.uniform(-10.0, 10.0, (groups, 3))
    centre = scene.data.geom_xpos
    finite = np.where(np.isfinite(scene.geoms.bound_m), scene.geoms.bound_m, 1.0)
    for g in range(0, groups, 3):
        origin[g] = centre[rng.integers(n)] + 1e-3 * rng.standard_normal(3)
    aim = rng.integers(n, size=(groups, k))
    to = centre[aim] - origin[:, None]
    off = rng.standard_normal((groups, k, 3))
    axis = to / np.maximum(np.linalg.norm(to, axis=-1, keepdims=True), 1e-9)
    off -= (off * axis).sum(axis=-1, keepdims=True) * axis
    off /= np.linalg.norm(off, axis=-1, keepdims=True)
    graze = finite[aim][..., None] * rng.choice([0.0, 0.3, 0.999999, 1.0], (groups, k, 1))
    direction = to + graze * off
    anywhere = rng.random((groups, k)) < 0.4
    direction[anywhere] = rng.standard_normal((int(anywhere.sum()), 3))
    along_axis = rng.random((groups, k)) < 0.1
    direction[along_axis] = np.eye(3)[rng.integers(3, size=int(along_axis.sum()))]
    return origin, direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def kernel(scene: Scene, origin: np.ndarray, direction: np.ndarray) -> rays.Hits:
    return rays.cast(
        scene.geoms,
        scene.body_rotation,
        scene.body_position,
        np.zeros(len(origin), np.int64),
        origin,
        direction,
    )


def oracle(
    scene: Scene, origin: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Range [g k] (inf: none), geom [g k] and cosine [g k] by mj_ray."""
    groups, k = direction.shape[:2]
    distance, geom, cosine = np.empty((groups, k)), np.empty((groups, k), np.int32), np.zeros((groups, k))
    found, normal = np.empty(1, np.int32), np.empty(3)
    for g in range(groups):
        for j in range(k):
            hit = mujoco.mj_ray(
                scene.model, scene.data, origin[g], direction[g, j], None, True, -1, found, normal
            )
            distance[g, j], geom[g, j] = (np.inf, -1) if hit < 0 else (hit, found[0])
            cosine[g, j] = abs(normal @ direction[g, j]) if hit >= 0 else 0.0
    return distance, geom, cosine


def assert_equal_to_mujoco(scene: Scene, origin: np.ndarray, direction: np.ndarray) -> int:
    """The number of hits. Along a grazing ray rounding moves the hit by (rounding / cosine): the limit of
    1e-9 m holds across the surface, which is the same thing wherever a ray does not graze."""
    ours = kernel(scene, origin, direction)
    distance, geom, cosine = oracle(scene, origin, direction)
    hit = np.isfinite(distance)
    both = hit & np.isfinite(ours.range_m)
    grazing = np.minimum(np.where(hit, cosine, 1.0), np.where(ours.geom >= 0, ours.cosine, 1.0)) < 1e-3
    assert np.array_equal(hit | grazing, (ours.geom >= 0) | grazing)
    assert np.array_equal(np.isfinite(ours.range_m), ours.geom >= 0)
    sure = both & ~grazing
    error = np.abs(ours.range_m[sure] - distance[sure])
    limit = 1e-9 * np.maximum(1.0, distance[sure]) / np.minimum(1.0, 30.0 * cosine[sure])
    assert np.all(error <= limit), float((error / limit).max())
    same = ours.geom[sure] == geom[sure]
    np.testing.assert_allclose(ours.cosine[sure][same], cosine[sure][same], atol=2e-6)
    for g, j in np.argwhere(sure & (ours.geom != geom)):  # ids may differ where two surfaces coincide
        theirs = rays.cast(
            subset(scene.geoms, geom[g : g + 1, j]), scene.body_rotation, scene.body_position,
            np.zeros(1, np.int64), origin[g : g + 1], direction[g : g + 1, j : j + 1],
        )  # fmt: skip
        assert abs(theirs.range_m[0, 0] - ours.range_m[g, j]) < 1e-9
    return int(both.sum())


def subset(geoms: rays.Geoms, which: np.ndarray) -> rays.Geoms:
    names = ("kind", "size_m", "body", "rotation", "position_m", "bound_m")
    return rays.Geoms(**{name: getattr(geoms, name)[which] for name in names})


@settings(max_examples=60)
@given(
    kinds=st.lists(st.sampled_from([*KINDS, rays.PLANE]), min_size=1, max_size=12),
    seed=st.integers(0, 2**32 - 1),
)
def test_ranges_and_ids_equal_mujocos_on_random_scenes(kinds: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = make_scene(kinds, rng)
    assert_equal_to_mujoco(scene, *make_rays(scene, rng, groups=9, k=16))


@pytest.mark.parametrize("kind", [*KINDS, rays.PLANE], ids=NAMES.get)
def test_each_shape_alone_equals_mujocos_also_from_inside_and_grazing(kind: int) -> None:
    rng = np.random.default_rng(kind)
    hits = 0
    for _ in range(15):
        scene = make_scene([kind], rng)
        hits += assert_equal_to_mujoco(scene, *make_rays(scene, rng, groups=9, k=24))
    assert hits > 500


@pytest.mark.parametrize("kind", KINDS, ids=NAMES.get)
def test_a_far_shape_is_hit_to_a_billionth_of_its_range(kind: int) -> None:
    rng = np.random.default_rng(100 + kind)
    scene = make_scene([kind] * 4, rng, spread_m=1.0)
    outward = rng.standard_normal((8, 3))
    origin = 400.0 * outward / np.linalg.norm(outward, axis=1, keepdims=True)
    aim = scene.data.geom_xpos[rng.integers(4, size=(8, 24))] + 0.02 * rng.standard_normal((8, 24, 3))
    direction = aim - origin[:, None]
    assert assert_equal_to_mujoco(
        scene, origin, direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    )


@pytest.mark.parametrize("kind", KINDS, ids=NAMES.get)
def test_a_ray_from_inside_hits_the_far_wall(kind: int) -> None:
    geoms = rays.Geoms(
        kind=np.array([kind]), size_m=np.array([[2.0, 2.0, 2.0]]), body=np.zeros(1, np.int32),
        rotation=np.eye(3)[None], position_m=np.zeros((1, 3)),
        bound_m=np.array([bound_m(kind, (2.0, 2.0, 2.0))]),
    )  # fmt: skip
    hits = rays.cast(
        geoms, np.eye(3)[None, None], np.zeros((1, 1, 3)), np.zeros(1, np.int64), np.array([[0.5, 0.0, 0.0]]),
        np.array([[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]]),
    )  # fmt: skip
    np.testing.assert_allclose(hits.range_m, [[1.5, 2.5]], atol=1e-12)


def test_a_plane_is_hit_from_above_only() -> None:
    geoms = rays.Geoms(
        kind=np.array([rays.PLANE]), size_m=np.array([[0.0, 0.0, 1.0]]), body=np.zeros(1, np.int32),
        rotation=np.eye(3)[None], position_m=np.zeros((1, 3)), bound_m=np.array([np.inf]),
    )  # fmt: skip
    down_and_up = np.array([[[0.6, 0.0, -0.8], [0.6, 0.0, 0.8]]])
    for z, expected in ((2.0, [2.5, np.inf]), (-2.0, [np.inf, np.inf])):
        hits = rays.cast(
            geoms, np.eye(3)[None, None], np.zeros((1, 1, 3)), np.zeros(1, np.int64),
            np.array([[0.0, 0.0, z]]), down_and_up,
        )  # fmt: skip
        np.testing.assert_allclose(hits.range_m[0], expected, atol=1e-12)


# -- culling ----------------------------------------------------------------------------------------------


@settings(max_examples=40)
@given(
    kinds=st.lists(st.sampled_from([*KINDS, rays.PLANE]), min_size=1, max_size=20),
    seed=st.integers(0, 2**32 - 1),
    spread=st.sampled_from(["column", "narrow", "everywhere", "opposite"]),
)
def test_how_rays_are_grouped_never_changes_what_they_hit(kinds: list[int], seed: int, spread: str) -> None:
    rng = np.random.default_rng(seed)
    scene = make_scene(kinds, rng)
    origin = rng.uniform(-8.0, 8.0, 3)
    k = 60
    if spread == "column":
        elevation = np.linspace(-0.5, 0.4, k)
        direction = np.stack([np.cos(elevation), 0.05 * rng.standard_normal(k), np.sin(elevation)], axis=1)
        direction = direction @ random_rotation(rng).T
    elif spread == "narrow":
        direction = np.array([1.0, 0.0, 0.0]) + 0.02 * rng.standard_normal((k, 3))
        direction = direction @ random_rotation(rng).T
    else:
        direction = rng.standard_normal((k, 3))
    if spread == "opposite":
        direction[k // 2 :] = -direction[: k // 2]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    one_group = kernel(scene, origin[None], direction[None])
    one_each = kernel(scene, np.repeat(origin[None], k, axis=0), direction[:, None])
    pairs = kernel(scene, np.repeat(origin[None], k // 2, axis=0), direction.reshape(k // 2, 2, 3))
    for other in (one_each, pairs):
        assert np.array_equal(one_group.range_m.ravel(), other.range_m.ravel())
        assert np.array_equal(one_group.geom.ravel(), other.geom.ravel())
        assert np.array_equal(one_group.cosine.ravel(), other.cosine.ravel())


def test_of_two_equal_surfaces_the_first_geom_is_hit_whatever_the_group() -> None:
    geoms = rays.Geoms(
        kind=np.full(2, rays.BOX), size_m=np.array([[1.0, 1.0, 1.0], [1.0, 2.0, 2.0]]),
        body=np.zeros(2, np.int32), rotation=np.broadcast_to(np.eye(3), (2, 3, 3)),
        position_m=np.zeros((2, 3)), bound_m=np.array([np.sqrt(3.0), 3.0]),
    )  # fmt: skip
    hits = rays.cast(
        geoms, np.eye(3)[None, None], np.zeros((1, 1, 3)), np.zeros(1, np.int64),
        np.array([[-5.0, 0.1, 0.2]]), np.array([[[1.0, 0.0, 0.0]]]),
    )  # fmt: skip
    assert hits.geom[0, 0] == 0
    assert hits.range_m[0, 0] == pytest.approx(4.0, abs=1e-12)


# -- time and pixels --------------------------------------------------------------------------------------


def test_each_column_sees_the_world_frozen_at_its_own_time() -> None:
    rng = np.random.default_rng(5)
    scene = make_scene(list(KINDS) * 3, rng)
    groups, bodies = 12, scene.body_rotation.shape[1]
    turns = 0.1 * rng.standard_normal((groups, bodies, 3))
    R = scene.body_rotation @ np.array([[rotation_exp(turn) for turn in row] for row in turns])
    p = scene.body_position + 0.3 * rng.standard_normal((groups, bodies, 3))
    origin, direction = make_rays(scene, rng, groups, 32)
    order = rng.permutation(groups).astype(np.int64)
    moving = rays.cast(scene.geoms, R, p, order, origin, direction)
    assert np.isfinite(moving.range_m).sum() > 50
    for g in range(groups):
        i = order[g]
        frozen = rays.cast(
            scene.geoms, R[i : i + 1], p[i : i + 1], np.zeros(1, np.int64), origin[g : g + 1],
            direction[g : g + 1],
        )  # fmt: skip
        assert np.array_equal(frozen.range_m[0], moving.range_m[g])
        assert np.array_equal(frozen.geom[0], moving.geom[g])


# -- closed forms -----------------------------------------------------------------------------------------


def test_cosine_and_range_on_a_plane_and_a_sphere_follow_the_closed_form() -> None:
    rng = np.random.default_rng(9)
    geoms = rays.Geoms(
        kind=np.array([rays.PLANE, rays.SPHERE]), size_m=np.array([[0.0, 0.0, 1.0], [0.7, 0.0, 0.0]]),
        body=np.zeros(2, np.int32), rotation=np.broadcast_to(np.eye(3), (2, 3, 3)),
        position_m=np.array([[0.0, 0.0, 0.0], [6.0, 1.0, 1.5]]), bound_m=np.array([np.inf, 0.7]),
    )  # fmt: skip
    origin, centre = np.array([0.0, 0.0, 1.85]), np.array([6.0, 1.0, 1.5])
    aim = np.concatenate(
        [centre + rng.uniform(-0.4, 0.4, (200, 3)), rng.uniform(-9, -2, (200, 3)) * [1, 1, 0]]
    )
    direction = (aim - origin) / np.linalg.norm(aim - origin, axis=1, keepdims=True)
    hits = rays.cast(
        geoms,
        np.eye(3)[None, None],
        np.zeros((1, 1, 3)),
        np.zeros(1, np.int64),
        origin[None],
        direction[None],
    )
    on_sphere, on_plane = slice(0, 200), slice(200, 400)
    assert (hits.geom[0, on_sphere] == 1).all()
    assert (hits.geom[0, on_plane] == 0).all()
    d = direction[on_plane]
    np.testing.assert_allclose(hits.range_m[0, on_plane], -1.85 / d[:, 2], rtol=1e-12)
    np.testing.assert_allclose(hits.cosine[0, on_plane], -d[:, 2], atol=1e-7)
    d, c = direction[on_sphere], centre - origin
    miss2 = c @ c - (d @ c) ** 2
    np.testing.assert_allclose(hits.range_m[0, on_sphere], d @ c - np.sqrt(0.49 - miss2), rtol=1e-12)
    np.testing.assert_allclose(hits.cosine[0, on_sphere], np.sqrt(1.0 - miss2 / 0.49), atol=1e-6)


def test_a_shape_that_the_kernel_does_not_know_is_refused_with_the_list_of_those_it_does() -> None:
    with pytest.raises(ValueError, match=r"geom types \[7\] cannot be ray-cast; allowed: plane, sphere"):
        rays.Geoms(
            kind=np.array([7]), size_m=np.ones((1, 3)), body=np.zeros(1, np.int32), rotation=np.eye(3)[None],
            position_m=np.zeros((1, 3)), bound_m=np.ones(1),
        )  # fmt: skip
