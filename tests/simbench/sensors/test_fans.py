"""The fast kernel for sensors that look along planes: against MuJoCo's rays and against the plain kernel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.geometry import rotation_exp
from simbench.sensors import rays
from tests.simbench.sensors.test_rays import KINDS, NAMES, Scene, make_scene, random_rotation


@dataclass(frozen=True, kw_only=True)
class Look:
    """Fans over a scene whose bodies and sensor stand elsewhere at every pose."""

    scene: Scene
    fans: rays.Fans
    body_rotation: np.ndarray
    body_position: np.ndarray
    rotation: np.ndarray
    origin: np.ndarray
    direction: np.ndarray  # [f k 3], sensor frame
    pose: np.ndarray

    def cast(self, weight: float = 0.0) -> rays.Hits:
        hits = rays.empty_hits(self.direction.shape[:2])
        n = len(self.origin)
        rays.cast_fans(
            rays.place(self.scene.geoms, self.body_rotation, self.body_position), np.arange(n),
            np.full(n, weight), self.rotation, self.origin, self.fans, hits,
        )  # fmt: skip
        return hits

    def world_direction(self) -> np.ndarray:
        return np.einsum("fij,fkj->fki", self.rotation[self.pose], self.direction)


def make_look(
    scene: Scene, rng: np.random.Generator, fans: int, steps: int, wide: float = 0.8, skewed: float = 0.03,
    still: bool = False, inside: bool = True,
) -> Look:  # fmt: skip
    """A sweep: the fans turn about a random axis; every pose and key is its own, far from the others."""
    poses = max(fans // 3, 1)
    bodies = scene.body_rotation.shape[1]
    turn = rng.standard_normal((poses, bodies, 3)) * (0.0 if still else 0.2)
    turn[:, 0] = 0.0
    R = np.array([[rotation_exp(t) for t in row] for row in turn]) @ scene.body_rotation
    p = scene.body_position + (0.0 if still else 0.3) * rng.standard_normal((poses, bodies, 3))
    p[:, 0] = 0.0
    angle = np.linspace(0.0, rng.uniform(0.0, 6.0), fans)
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    first = random_rotation(rng)
    frame = np.array([rotation_exp(a * axis) @ first for a in angle])
    slope = np.sort(wide * rng.uniform(-1.0, 1.0, (fans, steps)), axis=1)
    skew = skewed * rng.uniform(-1.0, 1.0, (fans, steps))
    pose = np.arange(fans) % poses
    stride = int(rng.choice([1, -1]))
    out_at = np.arange(fans) * steps + (0 if stride == 1 else steps - 1)
    ray = np.stack([np.ones_like(slope), slope, skew], axis=-1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    direction = np.einsum("fij,fkj->fki", frame, ray)
    centre = scene.data.geom_xpos[rng.integers(len(scene.geoms.kind))]
    near = centre if inside and rng.random() < 0.4 else rng.uniform(-8.0, 8.0, 3)
    return Look(
        scene=scene,
        fans=rays.make_fans(frame, slope, skew, pose, out_at, stride),
        body_rotation=R,
        body_position=p,
        rotation=np.array([rotation_exp(0.1 * rng.standard_normal(3)) for _ in range(poses)]),
        origin=near + 0.1 * rng.standard_normal((poses, 3)),
        direction=direction if stride == 1 else direction[:, ::-1],
        pose=pose,
    )


def assert_same(ours: rays.Hits, other: rays.Hits) -> int:
    """Ranges to 1e-9 m wherever a ray does not graze, ids wherever no two surfaces coincide. The hits."""
    hit, theirs = ours.geom >= 0, other.geom >= 0
    grazing = (hit & (ours.cosine < 1e-3)) | (theirs & (other.cosine < 1e-3))
    assert np.array_equal(hit | grazing, theirs | grazing)
    assert np.array_equal(hit, np.isfinite(ours.range_m))
    sure = hit & theirs & ~grazing
    limit = 1e-9 * np.maximum(1.0, other.range_m[sure]) / np.minimum(1.0, 30.0 * other.cosine[sure])
    error = np.abs(ours.range_m[sure] - other.range_m[sure])
    assert (error <= limit).all(), float((error / limit).max())
    different = ours.geom[sure] != other.geom[sure]
    assert different.mean() < 0.01 if different.size > 500 else different.sum() <= 2
    same = ~different
    np.testing.assert_allclose(ours.cosine[sure][same], other.cosine[sure][same], atol=2e-6)
    return int(sure.sum())


def plain(look: Look) -> rays.Hits:
    """The same rays by `rays.cast`, one group a fan."""
    return rays.cast(
        look.scene.geoms, look.body_rotation, look.body_position, look.pose, look.origin[look.pose],
        look.world_direction(),
    )  # fmt: skip


def by_mujoco(look: Look) -> rays.Hits:
    """The same rays by mj_ray, after mj_kinematics at each fan's own instant."""
    scene, hits = look.scene, rays.empty_hits(look.direction.shape[:2])
    found, normal = np.empty(1, np.int32), np.empty(3)
    cosine = np.zeros(hits.geom.shape, np.float32)
    direction = look.world_direction()
    for f, p in enumerate(look.pose):
        for i in range(1, look.body_rotation.shape[1]):
            scene.data.mocap_pos[i - 1] = look.body_position[p, i]
            mujoco.mju_mat2Quat(scene.data.mocap_quat[i - 1], look.body_rotation[p, i].reshape(9))
        mujoco.mj_kinematics(scene.model, scene.data)
        for j in range(direction.shape[1]):
            r = mujoco.mj_ray(
                scene.model, scene.data, look.origin[p], direction[f, j], None, True, -1, found, normal
            )
            hits.range_m[f, j], hits.geom[f, j] = (np.inf, -1) if r < 0 else (r, found[0])
            cosine[f, j] = abs(normal @ direction[f, j]) if r >= 0 else 0.0
    return rays.Hits(range_m=hits.range_m, geom=hits.geom, cosine=cosine)


shapes = st.lists(st.sampled_from([*KINDS, rays.PLANE]), min_size=1, max_size=14)


@settings(max_examples=30)
@given(kinds=shapes, seed=st.integers(0, 2**32 - 1), fans=st.integers(1, 22))
def test_every_fan_equals_mujocos_rays_at_its_own_instant(kinds: list[int], seed: int, fans: int) -> None:
    rng = np.random.default_rng(seed)
    look = make_look(make_scene(kinds, rng), rng, fans, steps=12)
    assert_same(look.cast(), by_mujoco(look))


@pytest.mark.parametrize("kind", [*KINDS, rays.PLANE], ids=NAMES.get)
def test_each_shape_alone_equals_mujocos_at_rest_in_motion_and_from_inside(kind: int) -> None:
    rng = np.random.default_rng(kind)
    hits = 0
    for number in range(10):
        scene = make_scene([kind, kind], rng, spread_m=2.0)
        look = make_look(scene, rng, fans=16, steps=24, still=number % 2 == 0)
        hits += assert_same(look.cast(), by_mujoco(look))
    assert hits > 50


@settings(max_examples=40)
@given(
    kinds=shapes,
    seed=st.integers(0, 2**32 - 1),
    wide=st.sampled_from([0.01, 0.3, 1.5]),
    skewed=st.sampled_from([0.0, 0.001, 0.2]),
    steps=st.sampled_from([1, 2, 33]),
)
def test_no_culling_loses_a_hit(kinds: list[int], seed: int, wide: float, skewed: float, steps: int) -> None:
    rng = np.random.default_rng(seed)
    look = make_look(make_scene(kinds, rng), rng, fans=90, steps=steps, wide=wide, skewed=skewed)
    assert_same(look.cast(), plain(look))


@pytest.mark.parametrize("kind", KINDS, ids=NAMES.get)
def test_of_a_small_far_shape_no_ray_at_its_rim_is_lost(kind: int) -> None:
    """Half a metre at 50 m under 4,001 rays: the interval of slopes is as narrow as the shape."""
    size = np.array([0.5, 0.01 if kind == rays.CAPSULE else 0.5, 0.5])
    geoms = rays.Geoms(
        kind=np.array([kind]), size_m=size[None], body=np.zeros(1, np.int32), rotation=np.eye(3)[None],
        position_m=np.array([[50.0, 0.0, 0.0]]), bound_m=np.array([0.9]),
    )  # fmt: skip
    slope = np.linspace(-0.02, 0.02, 4001)
    for across, up in (((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0))):
        frame = np.array([[1.0, 0.0, 0.0], across, up]).T[None]
        zero = np.zeros(1, np.int64)
        fans = rays.make_fans(frame, slope[None], np.zeros((1, 4001)), zero, zero, 1)
        hits = rays.empty_hits((1, 4001))
        at_rest = np.eye(3)[None], np.zeros((1, 3))
        placed = rays.place(geoms, at_rest[0][None], at_rest[1][None])
        rays.cast_fans(placed, zero, np.zeros(1), *at_rest, fans, hits)
        direction = frame[0, :, 0] + slope[:, None] * frame[0, :, 1]
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        slow = rays.cast(geoms, at_rest[0][None], at_rest[1][None], zero, at_rest[1], direction[None])
        assert assert_same(hits, slow) > 1500


@settings(max_examples=30)
@given(kinds=shapes, seed=st.integers(0, 2**32 - 1))
def test_directions_may_leave_the_table_by_its_slack(kinds: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    look = make_look(make_scene(kinds, rng), rng, fans=40, steps=16)
    fans = look.fans
    slope = fans.slope + rng.uniform(-0.02, 0.02, fans.slope.shape)
    skew = fans.skew + rng.uniform(-0.02, 0.02, fans.skew.shape)
    hits = rays.empty_hits((40, 16))
    n = len(look.origin)
    loose = replace(fans, slack=0.02)
    placed = rays.place(look.scene.geoms, look.body_rotation, look.body_position)
    rays.cast_fans(
        placed, np.arange(n), np.zeros(n), look.rotation, look.origin, loose, hits, slope=slope, skew=skew
    )
    ray = np.stack([np.ones_like(slope), slope, skew], axis=-1).transpose(0, 2, 1, 3).reshape(40, 16, 3)
    ray = np.einsum("fij,fkj->fki", fans.frame, ray / np.linalg.norm(ray, axis=-1, keepdims=True))
    ray = ray if fans.out_stride == 1 else ray[:, ::-1]
    assert_same(hits, plain(replace(look, direction=ray)))


def test_between_two_keys_geoms_go_evenly() -> None:
    rng = np.random.default_rng(3)
    scene = make_scene([rays.PLANE, *KINDS, *KINDS], rng)
    look = make_look(scene, rng, fans=24, steps=40, still=True, inside=False)
    step = np.array([0.4, -0.3, 0.2])
    moved = look.body_position + step * np.arange(len(look.origin))[:, None, None]
    moved[:, 0] = 0.0
    look = replace(look, body_position=moved)
    halfway = moved.copy()
    halfway[:-1, 1:] += 0.5 * step
    exact = plain(replace(look, body_position=halfway))
    assert assert_same(look.cast(weight=0.5), exact) > 20
    assert not np.array_equal(look.cast().range_m, exact.range_m)


def test_parts_of_a_sweep_are_the_sweep_bit_by_bit() -> None:
    rng = np.random.default_rng(8)
    look = make_look(make_scene(list(KINDS) * 4, rng), rng, fans=128, steps=20)
    whole = look.cast()
    for start in (0, 64):
        part = rays.empty_hits((64, 20))
        some = slice(start, start + 64)
        frame, packs = look.fans.frame[some], slice(start // 4, start // 4 + 16)
        fans = replace(
            look.fans, frame=frame, slope=look.fans.slope[packs], skew=look.fans.skew[packs],
            scale=look.fans.scale[some], pose=look.fans.pose[some],
            out_at=look.fans.out_at[some] - 20 * start,
            first_step=look.fans.first_step[packs], last_step=look.fans.last_step[packs],
        )  # fmt: skip
        n = len(look.origin)
        placed = rays.place(look.scene.geoms, look.body_rotation, look.body_position)
        rays.cast_fans(placed, np.arange(n), np.zeros(n), look.rotation, look.origin, fans, part)
        for name in ("range_m", "geom", "cosine"):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[some])


@pytest.mark.parametrize(
    ("slope", "problem"),
    [([[0.2, 0.1]], "must ascend"), ([[0.1, np.inf]], "must be finite")],
)
def test_fans_that_are_none_are_refused(slope: list[list[float]], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        rays.make_fans(
            np.eye(3)[None],
            np.array(slope),
            np.zeros((1, 2)),
            np.zeros(1, np.int64),
            np.zeros(1, np.int64),
            1,
        )


# -- the sun ----------------------------------------------------------------------------------------------


@settings(max_examples=40)
@given(kinds=shapes, seed=st.integers(0, 2**32 - 1))
def test_a_point_is_lit_where_no_other_geom_is_hit_on_the_way_to_the_sun(kinds: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    look = make_look(make_scene([*kinds, rays.BOX], rng), rng, fans=24, steps=40, inside=False)
    hits, n = look.cast(), len(look.origin)
    sun = rng.standard_normal(3)
    sun /= np.linalg.norm(sun)
    placed = rays.place(look.scene.geoms, look.body_rotation, look.body_position)
    lit = rays.sunlit(placed, np.arange(n), np.zeros(n), look.rotation, look.origin, look.fans, hits, sun)
    assert lit.shape == hits.geom.shape
    assert lit[hits.geom < 0].all()
    world = look.world_direction()
    names = ("kind", "size_m", "body", "rotation", "position_m", "bound_m")
    for f, j in np.argwhere(hits.geom >= 0)[:: max(1, len(hits.geom) // 8)]:
        own, p = hits.geom[f, j], look.pose[f]
        point = look.origin[p] + hits.range_m[f, j] * world[f, j]
        solid = look.scene.geoms.kind != rays.PLANE
        solid[own] = False
        if not solid.any():
            assert lit[f, j]
            continue
        others = rays.Geoms(**{name: getattr(look.scene.geoms, name)[solid] for name in names})
        blocked = rays.cast(
            others, look.body_rotation, look.body_position, np.array([p]), point[None], sun[None, None]
        )
        if blocked.geom[0, 0] >= 0 and blocked.cosine[0, 0] < 1e-4:
            continue  # grazes
        assert lit[f, j] == (blocked.geom[0, 0] < 0)


def test_the_shadow_of_a_ball_is_where_geometry_says() -> None:
    """A ball of 1 m at 3 m over the ground, the sun straight above: a dark disc of 1 m."""
    geoms = rays.Geoms(
        kind=np.array([rays.PLANE, rays.SPHERE]), size_m=np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
        body=np.zeros(2, np.int32), rotation=np.broadcast_to(np.eye(3), (2, 3, 3)),
        position_m=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]]), bound_m=np.array([np.inf, 1.0]),
    )  # fmt: skip
    slope = np.linspace(-1.5, 1.5, 301)[None]
    down = np.array([[[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]])  # e = -z, u = x, n = -y
    fans = rays.make_fans(down, slope, np.zeros((1, 301)), np.zeros(1, np.int64), np.zeros(1, np.int64), 1)
    hits = rays.empty_hits((1, 301))
    placed = rays.place(geoms, np.eye(3)[None, None], np.zeros((1, 1, 3)))
    at = (np.zeros(1, np.int64), np.zeros(1), down * 0.0 + np.eye(3), np.array([[0.0, 0.0, 1.9]]))
    frame = np.array([[[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]])
    assert np.allclose(np.linalg.det(frame), 1.0)
    rays.cast_fans(placed, *at, fans, hits)
    assert (hits.geom == 0).all()
    lit = rays.sunlit(placed, *at, fans, hits, np.array([0.0, 0.0, 1.0]))
    x = slope[0] * 1.9
    assert np.array_equal(lit[0], np.abs(x) > 1.0)


def test_the_shadow_of_a_board_is_as_long_as_the_board_is_high_when_the_sun_stands_at_45_degrees() -> None:
    """A board 0.2 m high ends at x = 0; seen from above, the ground beside it is dark up to x = 0.2."""
    geoms = rays.Geoms(
        kind=np.array([rays.PLANE, rays.BOX]), size_m=np.array([[0.0, 0.0, 1.0], [0.01, 3.0, 0.1]]),
        body=np.zeros(2, np.int32), rotation=np.broadcast_to(np.eye(3), (2, 3, 3)),
        position_m=np.array([[0.0, 0.0, 0.0], [-0.01, 0.0, 0.1]]), bound_m=np.array([np.inf, 3.05]),
    )  # fmt: skip
    frame = np.array([[[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]])  # e = -z, u = x, n = -y
    slope = np.linspace(0.0005, 0.4, 400)[None]
    fans = rays.make_fans(frame, slope, np.zeros((1, 400)), np.zeros(1, np.int64), np.zeros(1, np.int64), 1)
    at = (np.zeros(1, np.int64), np.zeros(1), np.eye(3)[None], np.array([[0.0, 0.0, 2.0]]))
    placed, hits = rays.place(geoms, np.eye(3)[None, None], np.zeros((1, 1, 3))), rays.empty_hits((1, 400))
    rays.cast_fans(placed, *at, fans, hits)
    assert (hits.geom == 0).all()
    lit = rays.sunlit(placed, *at, fans, hits, np.array([-1.0, 0.0, 1.0]) / np.sqrt(2.0))
    assert np.array_equal(lit[0], 2.0 * slope[0] > 0.2)
