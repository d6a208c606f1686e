"""Normals against the ray kernel's own, paint against areas, sun and sky against what they must be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.scenario import Road
from simbench.looks import road_paint
from simbench.sensors import light, rays, shade
from tests.simbench.scenes import bound_m, staged

KINDS = (rays.SPHERE, rays.CAPSULE, rays.ELLIPSOID, rays.CYLINDER, rays.BOX)


@settings(max_examples=60)
@given(kind=st.sampled_from(KINDS), seed=st.integers(0, 2**31))
def test_the_normal_where_a_ray_hits_gives_the_kernels_angle_of_incidence(kind: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.2, 1.5, 3)
    geoms = rays.Geoms(
        kind=np.array([kind]), size_m=size[None], body=np.zeros(1, dtype=np.int32), rotation=np.eye(3)[None],
        position_m=np.zeros((1, 3)), bound_m=np.array([bound_m(kind, tuple(size.tolist()))]),
    )  # fmt: skip
    start = rng.standard_normal((40, 3))
    start *= 5.0 / np.linalg.norm(start, axis=1)[:, None]
    toward = rng.uniform(-0.3, 0.3, (40, 3)) - start
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    hits = rays.cast(
        geoms, np.eye(3)[None, None], np.zeros((1, 1, 3)), np.zeros(40, np.int64), start, toward[:, None]
    )
    normal = np.empty(3)
    for i in np.flatnonzero(hits.geom[:, 0] >= 0):
        point = start[i] + hits.range_m[i, 0] * toward[i]
        shade._normal(kind, size, point, normal)
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        assert -normal @ toward[i] == pytest.approx(hits.cosine[i, 0], abs=1e-6)
        assert normal @ point > 0.0  # outward: all of them are star-shaped about their centre


def covered(
    strip: list[float], x: np.ndarray, y: np.ndarray, wide_x: np.ndarray, wide_y: np.ndarray
) -> np.ndarray:
    share = np.zeros(len(x))
    shade._covered(np.array(strip), x, y, wide_x, wide_y, 0, len(x), share)
    return share


@settings(max_examples=60)
@given(
    y0=st.floats(-3.0, 3.0),
    width=st.floats(0.01, 2.0),
    cuts=st.lists(st.floats(-6.0, 6.0), min_size=2, max_size=30, unique=True),
)
def test_pixels_side_by_side_share_a_strips_area_among_them(
    y0: float, width: float, cuts: list[float]
) -> None:
    edges = np.array([-7.0, *sorted(cuts), 7.0])
    edges = edges[np.insert(np.diff(edges) > 1e-6, 0, True)]
    y, wide = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    n = len(y)
    share = covered(
        [-50.0, y0, 50.0, y0 + width, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0], np.zeros(n), y, np.ones(n), wide
    )
    assert (share * wide).sum() == pytest.approx(width, rel=1e-9)
    assert share.min() >= 0.0 and share.max() <= 1.0 + 1e-9


@settings(max_examples=60)
@given(step=st.floats(0.05, 40.0), start=st.floats(0.0, 9.0))
def test_pixels_along_a_dashed_line_share_its_dashes_however_long_they_are(step: float, start: float) -> None:
    edges = np.append(np.arange(0.0, 90.0, step), 90.0)
    edges = edges[np.insert(np.diff(edges) > 1e-6, 0, True)]
    x, wide = 0.5 * (edges[1:] + edges[:-1]) + start, np.diff(edges)
    n = len(x)
    strip = [0.0, -1.0, 200.0, 1.0, 9.0, 3.0, 0.0, 1.0, 1.0, 1.0]
    share = covered(strip, x, np.zeros(n), wide, np.full(n, 0.1))
    assert (share * wide).sum() == pytest.approx(30.0, rel=1e-9)  # ten periods of 3 m


def test_a_pixel_on_the_edge_of_a_line_is_half_painted() -> None:
    strip = [-10.0, 1.0, 10.0, 1.12, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
    share = covered(strip, np.zeros(3), np.array([0.99, 1.0, 1.06]), np.full(3, 0.01), np.full(3, 0.02))
    np.testing.assert_allclose(share, [0.0, 0.5, 1.0], atol=1e-12)


def test_the_painted_rectangles_are_opengls_slabs() -> None:
    world = staged("overtake-approach", "car", 0).world
    paint, model = world.looks.paint, world.model
    slabs = np.flatnonzero(model.geom_group == 2)
    low = model.geom_pos[slabs, :2] - model.geom_size[slabs, :2]
    high = model.geom_pos[slabs, :2] + model.geom_size[slabs, :2]
    expected = np.array([rectangle for _, rectangle in paint.rectangles()])
    np.testing.assert_allclose(np.column_stack([low, high]), expected, atol=1e-9)
    colour = np.array([paint.colour[number] for number, _ in paint.rectangles()])
    np.testing.assert_allclose(model.mat_rgba[model.geom_matid[slabs], :3], colour, atol=1e-6)


def test_two_lanes_have_a_line_on_either_side_and_dashes_between() -> None:
    road = Road(length_m=100.0, width_m=20.0, lanes_m=((-3.5, 0.0), (0.0, 3.5)))
    paint = road_paint(road, (0.3, 0.3, 0.3), (0.9, 0.9, 0.9), (0.3, 0.4, 0.2))
    np.testing.assert_allclose(paint.extent_m[2:, 1::2].mean(axis=1), [-3.5, 3.5, 0.0], atol=1e-12)
    assert paint.period_m.tolist() == [0.0, 0.0, 0.0, 0.0, 9.0]
    assert paint.grass.tolist() == [True, True, False, False, False]
    assert all(x1 <= 50.0 for _, (_, _, x1, _) in paint.rectangles())


def test_display_values_come_back_from_linear_light() -> None:
    codes = np.arange(256) / 255.0
    np.testing.assert_allclose(light.to_srgb(light.to_linear(codes)), codes, atol=1e-12)
    # The standard's own points: both branches meet, and mid grey.
    assert light.to_linear(np.array([0.04045]))[0] == pytest.approx(0.0031308, abs=1e-7)
    assert light.to_linear(np.array([0.5]))[0] == pytest.approx(0.21404, abs=1e-5)


@pytest.mark.parametrize("tile", [light.grain_tile(), light.patch_tile()])
def test_ground_textures_have_mean_0_and_sd_1_and_no_seam(tile: np.ndarray) -> None:
    assert tile.mean() == pytest.approx(0.0, abs=1e-4)
    assert tile.std() == pytest.approx(1.0, abs=1e-4)
    inner, seam = np.abs(np.diff(tile, axis=0)).mean(), np.abs(tile[0] - tile[-1]).mean()
    assert seam == pytest.approx(inner, rel=0.35)
