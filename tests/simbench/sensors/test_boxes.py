"""Analytic outlines against sampled silhouettes, and boxes against rays through every pixel."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from fusion.geometry import Transform, rotation_rpy
from simbench.axes import R_BODY_OPTICAL
from simbench.motion import at
from simbench.sensors import rays
from simbench.sensors.boxes import View, true_box
from simbench.sensors.outline import outline_px
from tests.simbench.scenes import Stage, bound_m, scripted_motion, staged

CAMERA = PinholeCamera(fx_px=500.0, fy_px=480.0, cx_px=320.0, cy_px=240.0, width_px=640, height_px=480)
ROUND = (rays.SPHERE, rays.CAPSULE, rays.ELLIPSOID, rays.CYLINDER, rays.BOX)


def surface(kind: int, size: np.ndarray, n: int = 160) -> np.ndarray:
    """A dense grid on a primitive's surface."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * n), np.linspace(-np.pi / 2, np.pi / 2, n))
    ball = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1).reshape(-1, 3)
    ring = np.stack([np.cos(u[0]), np.sin(u[0]), np.zeros(2 * n)], axis=-1)
    if kind == rays.SPHERE:
        return np.asarray(ball * size[0])
    if kind == rays.ELLIPSOID:
        return np.asarray(ball * size)
    if kind == rays.BOX:
        return np.array(np.meshgrid(*[(-s, s) for s in size])).reshape(3, -1).T
    part = ball if kind == rays.CAPSULE else ring
    return np.concatenate([part * size[0] + [0.0, 0.0, z] for z in (-size[1], size[1])])


@settings(max_examples=60)
@given(kinds=st.lists(st.sampled_from(ROUND), min_size=1, max_size=3), seed=st.integers(0, 2**31))
def test_an_outline_is_the_extent_of_the_projected_surface(kinds: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.05, 1.0, (len(kinds), 3))
    quaternion = rng.standard_normal((len(kinds), 4))
    rotation = np.empty((len(kinds), 3, 3))
    for i, q in enumerate(quaternion):
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, q / np.linalg.norm(q))
        rotation[i] = matrix.reshape(3, 3)
    centre = np.column_stack([rng.uniform(-3, 3, (len(kinds), 2)), rng.uniform(3.0, 20.0, len(kinds))])
    found = outline_px(np.array(kinds), size, rotation, centre, CAMERA)
    assert found is not None
    points = np.concatenate([surface(k, size[i]) @ rotation[i].T + centre[i] for i, k in enumerate(kinds)])
    uv = CAMERA.project(points)
    expected = np.concatenate([uv.min(axis=0), uv.max(axis=0)])
    scale = 500.0 / centre[:, 2].min()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3 * scale + 1e-6)
    assert np.all(np.array(found)[:2] <= expected[:2] + 1e-9)
    assert np.all(np.array(found)[2:] >= expected[2:] - 1e-9)


def test_a_ball_straight_ahead_has_the_textbooks_outline() -> None:
    found = outline_px(
        np.array([rays.SPHERE]),
        np.array([[1.0, 0.0, 0.0]]),
        np.eye(3)[None],
        np.array([[0.0, 0.0, 5.0]]),
        CAMERA,
    )
    slope = np.tan(np.arcsin(1.0 / 5.0))
    expected = (320 - 500 * slope, 240 - 480 * slope, 320 + 500 * slope, 240 + 480 * slope)
    np.testing.assert_allclose(np.array(found), expected, atol=1e-9)


@pytest.mark.parametrize("kind", ROUND)
def test_what_reaches_behind_the_camera_has_no_outline(kind: int) -> None:
    assert (
        outline_px(np.array([kind]), np.ones((1, 3)), np.eye(3)[None], np.array([[0.0, 0.0, 0.5]]), CAMERA)
        is None
    )


# -- views ------------------------------------------------------------------------------------------------


Shape = tuple[int, tuple[float, float, float], tuple[float, float, float]]


def view_of(shapes: list[Shape]) -> View:
    """Shapes in front of a camera at the origin that looks along x: (kind, size, centre)."""
    geoms = rays.Geoms(
        kind=np.array([s[0] for s in shapes]),
        size_m=np.array([s[1] for s in shapes]),
        body=np.zeros(len(shapes), np.int32),
        rotation=np.broadcast_to(np.eye(3), (len(shapes), 3, 3)),
        position_m=np.array([s[2] for s in shapes]),
        bound_m=np.array([bound_m(s[0], s[1]) for s in shapes]),
    )
    pose = Transform(rotation=R_BODY_OPTICAL, translation_m=np.zeros(3))
    return View(geoms, np.eye(3)[None], np.zeros((1, 3)), pose, CAMERA)


BEHIND = (rays.BOX, (0.1, 1.0, 1.0), (10.0, 0.0, 0.0))
ONLY_FIRST = np.array([0])


def test_half_hidden_by_a_wall_the_visible_box_ends_at_the_wall() -> None:
    """A 2 m plate at 9.9 m, its left half behind a wall that ends at y = 0."""
    view = view_of([BEHIND, (rays.BOX, (0.1, 5.0, 5.0), (5.0, 5.0, 0.0))])
    box = true_box(view, 0, ONLY_FIRST, 4.0)
    assert box is not None
    half_u, half_v = 500.0 / 9.9, 480.0 / 9.9
    np.testing.assert_allclose(
        box.amodal_px, (320 - half_u, 240 - half_v, 320 + half_u, 240 + half_v), atol=1e-9
    )
    assert box.visible_px is not None
    assert box.visible_px[0] == 320.0
    assert abs(box.visible_px[2] - (320 + half_u)) <= 1.0
    assert box.visible_fraction == pytest.approx(0.5, abs=0.03)


def test_nothing_in_front_and_all_is_visible() -> None:
    box = true_box(view_of([BEHIND, (rays.BOX, (0.1, 1.0, 1.0), (15.0, 0.0, 0.0))]), 0, ONLY_FIRST, 4.0)
    assert box is not None
    assert box.visible_px is not None
    assert box.visible_fraction == 1.0
    np.testing.assert_allclose(box.visible_px, box.amodal_px, atol=1.0)


def test_all_hidden_has_an_amodal_box_and_no_visible_one() -> None:
    box = true_box(view_of([BEHIND, (rays.BOX, (0.1, 5.0, 5.0), (5.0, 0.0, 0.0))]), 0, ONLY_FIRST, 4.0)
    assert box is not None
    assert box.visible_px is None
    assert box.visible_fraction == 0.0


def test_at_the_border_both_boxes_end_there() -> None:
    box = true_box(view_of([(rays.BOX, (0.1, 1.0, 1.0), (5.0, 3.0, 0.0)), BEHIND]), 0, ONLY_FIRST, 4.0)
    assert box is not None
    assert box.visible_px is not None
    assert box.amodal_px[0] == box.visible_px[0] == 0.0


def test_out_of_view_behind_the_camera_or_too_low_there_is_no_box() -> None:
    for shape in (
        (rays.BOX, (0.1, 1.0, 1.0), (5.0, 9.0, 0.0)),
        (rays.BOX, (0.1, 1.0, 1.0), (-5.0, 0.0, 0.0)),
        (rays.BOX, (0.1, 1.0, 0.01), (20.0, 0.0, 0.0)),
    ):
        assert true_box(view_of([shape, BEHIND]), 0, ONLY_FIRST, 4.0) is None


def test_what_reaches_past_the_camera_is_bounded_by_rays() -> None:
    """A long wall on the left that starts behind the camera."""
    box = true_box(view_of([(rays.BOX, (10.0, 0.1, 1.0), (5.0, 1.0, 0.0)), BEHIND]), 0, ONLY_FIRST, 4.0)
    assert box is not None
    assert box.amodal_px[0] == 0.0
    right = 320 - 500.0 * 0.9 / 15.0  # its far end on the near side
    assert abs(box.amodal_px[2] - right) <= 1.0


def test_a_distorted_camera_is_refused() -> None:
    view = view_of([BEHIND, BEHIND])
    bent = replace(CAMERA, distortion=(0.1, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="undistorted"):
        View(view.geoms, np.eye(3)[None], np.zeros((1, 3)), view.T_world_camera, bent)


# -- the catalogue ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scene() -> Stage:
    return staged("overtake-recede", "car", 5)


@pytest.mark.parametrize(
    ("name", "t_s"), [("cam-front", 0.4), ("cam-back-right", 2.0), ("cam-front-left", 3.5)]
)
def test_boxes_are_the_extent_of_rays_through_every_pixel(scene: Stage, name: str, t_s: float) -> None:
    world, motion = scene.world, scripted_motion(scene)
    t_ns = np.array([round(t_s * 1e9)])
    R, p = motion.poses(t_ns)
    view = View(world.geoms, R[0], p[0], at(motion.sensor(name, t_ns)), scene.rig.pinholes[name])
    whole = (0, 0, 960, 600)
    everything = view.cast(whole, np.arange(len(world.geoms.kind))).geom
    owner = np.where(everything >= 0, world.geom_object[everything], -1)
    compared = 0
    for info in world.objects:
        mask = world.masks[info.object_id]
        box = true_box(view, info.object_id, np.flatnonzero(mask), 4.0)
        rows, columns = np.nonzero(owner == info.object_id)
        if box is None or box.visible_px is None:
            assert len(rows) < 40
            continue
        extent = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        alone = np.argwhere(view.cast(whole, np.flatnonzero(mask)).geom >= 0)[:, ::-1]
        assert box.visible_fraction == len(rows) / len(alone), info.name
        assert box.visible_px == (tuple(map(float, extent)) if len(rows) < len(alone) else box.amodal_px)
        extent = np.concatenate([alone.min(axis=0), alone.max(axis=0) + 1])
        assert np.mean(np.abs(extent - box.amodal_px) <= 1.0) == 1.0 or info.category in ("post", "tree")
        compared += 1
    assert compared >= 3


def scattered(rng: np.random.Generator, count: int) -> list[Shape]:
    return [
        (
            int(rng.choice(ROUND)),
            tuple(rng.uniform(0.1, 1.0, 3).tolist()),
            tuple(rng.uniform([-3, -8, -6], [25, 8, 6]).tolist()),
        )
        for _ in range(count)
    ]


def turned(view: View, rng: np.random.Generator) -> View:
    rotation = rotation_rpy(*rng.uniform(-0.3, 0.3, 3)) @ R_BODY_OPTICAL
    pose = Transform(rotation=rotation, translation_m=np.zeros(3))
    return View(view.geoms, np.eye(3)[None], np.zeros((1, 3)), pose, CAMERA)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31))
def test_a_window_of_pixels_is_cast_like_rays_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    view = turned(view_of(scattered(rng, 30)), rng)
    x0, y0 = (int(v) for v in rng.integers(0, [600, 440]))
    x1, y1 = (int(v) for v in rng.integers([x0 + 1, y0 + 1], [641, 481]))
    some = np.flatnonzero(rng.random(30) < 0.7)
    x = (np.arange(x0, x1) + 0.5 - CAMERA.cx_px) / CAMERA.fx_px
    y = (np.arange(y0, y1) + 0.5 - CAMERA.cy_px) / CAMERA.fy_px
    grid = np.stack(np.broadcast_arrays(x, y[:, None], 1.0), axis=-1) @ view.T_world_camera.rotation.T
    grid /= np.linalg.norm(grid, axis=-1, keepdims=True)
    names = ("kind", "size_m", "body", "rotation", "position_m", "bound_m")
    slow = rays.cast(
        rays.Geoms(**{name: getattr(view.geoms, name)[some] for name in names}),
        np.eye(3)[None, None], np.zeros((1, 1, 3)), np.zeros(len(y), np.int64), np.zeros((len(y), 3)), grid,
    )  # fmt: skip
    found = view.cast((x0, y0, x1, y1), some)
    assert np.array_equal(found.geom, np.append(some, -1)[slow.geom])
    np.testing.assert_allclose(found.range_m, slow.range_m, rtol=1e-9)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), ground=st.booleans(), own=st.integers(1, 4), others=st.integers(0, 12))
def test_nothing_that_hides_an_object_is_overlooked(seed: int, ground: bool, own: int, others: int) -> None:
    """Fractions and boxes against every pixel of the whole image, among all geoms."""
    rng = np.random.default_rng(seed)
    shapes = scattered(rng, own + others)
    if ground:
        shapes.append((rays.PLANE, (0.0, 0.0, 1.0), (0.0, 0.0, float(rng.uniform(-6.0, -0.5)))))
    view = turned(view_of(shapes), rng)
    box = true_box(view, 0, np.arange(own), 4.0)
    whole = (0, 0, CAMERA.width_px, CAMERA.height_px)
    alone = view.cast(whole, np.arange(own)).geom >= 0
    first = view.cast(whole, np.arange(len(shapes))).geom
    seen = (first >= 0) & (first < own)
    if box is None:
        assert alone.sum() == 0 or np.flatnonzero(alone.any(axis=1)).size <= 4
        return
    assert box.visible_fraction == seen.sum() / alone.sum()
    rows, columns = np.nonzero(seen)
    if len(rows) == 0:
        assert box.visible_px is None
        return
    extent = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
    assert box.visible_px is not None
    assert np.abs(extent - box.visible_px).max() <= (1.5 if box.visible_fraction == 1.0 else 0.0)
