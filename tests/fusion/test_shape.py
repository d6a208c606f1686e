"""Step 4: the 3 x 3 descriptor, its rotation, and the similarity that picks a cluster."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import rel_entr

from fusion.shape import (
    SHAPES_SCHEMA,
    descriptor,
    format_benchmark_shapes,
    kl_divergence,
    learn_shape,
    load_benchmark_shapes,
    main_axis,
    parse_benchmark_shapes,
    select,
    similarity,
    tilt_rad,
    upright,
)

pixels = arrays(np.float64, st.tuples(st.integers(1, 60), st.just(2)), elements=st.integers(0, 900))
shares = arrays(np.float64, 9, elements=st.floats(0.01, 1.0)).map(lambda a: a / a.sum())


def turned(uv: np.ndarray, angle_rad: float) -> np.ndarray:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return uv @ np.array([[c, s], [-s, c]])  # positive from u to v


@given(pixels)
def test_a_descriptor_sums_to_one(uv: np.ndarray) -> None:
    assert descriptor(uv).sum() == pytest.approx(1.0)


@given(pixels, st.integers(2, 5))
def test_the_number_of_points_does_not_matter(uv: np.ndarray, times: int) -> None:
    np.testing.assert_allclose(descriptor(np.tile(uv, (times, 1))), descriptor(uv))


@given(pixels, st.integers(-500, 500), st.sampled_from([0.25, 0.5, 2.0, 8.0]))
def test_place_and_size_in_the_image_do_not_matter(uv: np.ndarray, shift: int, scale: float) -> None:
    np.testing.assert_allclose(descriptor(uv * scale + shift), descriptor(uv))


def test_a_descriptor_counts_row_by_row_from_the_top_left() -> None:
    uv = np.array([[0.0, 0.0], [5.0, 0.5], [9.0, 0.0], [9.0, 9.0], [8.0, 8.0]])
    expected = np.zeros(9)
    expected[[0, 1, 2, 8]] = [0.2, 0.2, 0.2, 0.4]
    np.testing.assert_allclose(descriptor(uv), expected)


def test_a_line_fills_the_middle_third_and_one_point_the_middle_cell() -> None:
    np.testing.assert_allclose(
        descriptor(np.array([[5.0, 0.0], [5.0, 4.5], [5.0, 9.0]])), [0, 1 / 3, 0, 0, 1 / 3, 0, 0, 1 / 3, 0]
    )
    assert descriptor(np.array([[3.0, 3.0]]))[4] == 1.0


def test_no_points_have_no_descriptor() -> None:
    with pytest.raises(ValueError, match="at least one"):
        descriptor(np.zeros((0, 2)))


@given(angle_deg=st.floats(-39.0, 39.0), axis=st.sampled_from(["vertical", "horizontal"]))
def test_a_tilt_of_up_to_forty_degrees_is_undone(angle_deg: float, axis: str) -> None:
    rng = np.random.Generator(np.random.PCG64(0))
    uv = rng.uniform([-15, -60], [15, 60], (400, 2))
    if axis == "horizontal":
        uv = uv[:, ::-1].copy()
    own = tilt_rad(uv, axis)  # a finite sample has a small tilt of its own
    tilted = turned(uv, np.deg2rad(angle_deg))
    assert tilt_rad(tilted, axis) == pytest.approx(own + np.deg2rad(angle_deg), abs=1e-9)
    assume(abs(own + np.deg2rad(angle_deg)) < np.deg2rad(40.0))
    straight, rotation = upright(tilted, axis, 40.0)
    assert rotation == pytest.approx(-own - np.deg2rad(angle_deg), abs=1e-9)
    assert tilt_rad(straight, axis) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(descriptor(straight), descriptor(upright(uv, axis, 40.0)[0]), atol=1e-9)


@pytest.mark.parametrize("angle_deg", [41.0, 60.0, 90.0, -41.0, -85.0])
def test_a_larger_tilt_is_left_alone(angle_deg: float) -> None:
    uv = turned(np.column_stack([np.zeros(50), np.linspace(-50, 50, 50)]), np.deg2rad(angle_deg))
    straight, rotation = upright(uv, "vertical", 40.0)
    assert rotation == 0.0 and np.array_equal(straight, uv)


def test_points_without_a_main_direction_are_left_alone() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    for uv in (square, square[:1]):
        assert upright(uv, "vertical", 40.0)[1] == 0.0


def test_people_stand_and_vehicles_lie() -> None:
    assert [main_axis(c) for c in ("pedestrian", "rider", "car", "truck")] == [
        "vertical",
        "vertical",
        "horizontal",
        "horizontal",
    ]


@given(shares, shares)
def test_kl_divergence_is_scipys_relative_entropy_of_the_smoothed_cells(p: np.ndarray, q: np.ndarray) -> None:
    smooth_p, smooth_q = (p + 1e-3) / 1.009, (q + 1e-3) / 1.009
    assert kl_divergence(p, q) == pytest.approx(float(rel_entr(smooth_p, smooth_q).sum()), abs=1e-12)


@given(shares, shares)
def test_similarity_is_one_for_equal_shapes_and_falls_with_divergence(p: np.ndarray, q: np.ndarray) -> None:
    assert similarity(kl_divergence(p, p)) == pytest.approx(1.0)
    assert 0.0 < similarity(kl_divergence(p, q)) <= 1.0
    assert similarity(1.0) == pytest.approx(2.0 / (1.0 + np.e)) and similarity(2.0) < similarity(1.0)


def test_empty_cells_do_not_make_the_divergence_infinite() -> None:
    p, q = np.eye(9)[0], np.eye(9)[8]
    assert np.isfinite(kl_divergence(p, q)) and similarity(kl_divergence(p, q)) > 0.0
    assert similarity(1e6) > 0.0


def test_the_most_similar_cluster_is_chosen_or_by_the_literal_argmax_the_least_or_the_largest() -> None:
    divergences, counts = np.array([0.4, 0.1, 2.0]), np.array([9, 5, 7])
    assert select(divergences, counts, "most_similar") == 1
    assert select(divergences, counts, "least_similar") == 2
    assert select(divergences, counts, "most_points") == 0


def test_a_learned_shape_is_the_mean_of_upright_descriptors() -> None:
    column = np.column_stack([np.zeros(30), np.linspace(0, 10, 30)])
    leaning = turned(column, np.deg2rad(20.0))
    empty = np.zeros((0, 2))
    np.testing.assert_allclose(
        learn_shape([column, leaning, empty], "rider"),
        descriptor(upright(column, "vertical", 40)[0]),
        atol=0.02,
    )
    with pytest.raises(ValueError, match="no points of any rider"):
        learn_shape([empty], "rider")


def test_the_stored_shapes_say_where_they_come_from_and_sum_to_one() -> None:
    stored = load_benchmark_shapes()
    assert "command" in stored.provenance
    assert {"car", "rider", "pedestrian"} <= set(stored.shapes)
    for shape in stored.shapes.values():
        assert shape.sum() == pytest.approx(1.0) and not shape.flags.writeable


def test_a_category_that_was_never_learned_has_the_uniform_shape() -> None:
    np.testing.assert_allclose(load_benchmark_shapes().of("unheard of"), np.full(9, 1 / 9))


def test_shapes_survive_being_written_and_read() -> None:
    shape = np.array([1, 2, 3, 4, 5, 6, 7, 8, 4]) / 40.0
    text = format_benchmark_shapes({"car": shape, "rider": shape[::-1]}, {"command": "x", "seeds": [1, 2]})
    read = parse_benchmark_shapes(text)
    np.testing.assert_allclose(read.shapes["car"], shape, atol=1e-3)
    assert read.provenance == {"command": "x", "seeds": [1, 2]}


@pytest.mark.parametrize(
    "document",
    [
        [],
        {"schema": "other", "provenance": {}, "shapes": {"car": [1 / 9] * 9}},
        {"schema": SHAPES_SCHEMA, "shapes": {"car": [1 / 9] * 9}},
        {"schema": SHAPES_SCHEMA, "provenance": {}, "shapes": {}},
        {"schema": SHAPES_SCHEMA, "provenance": {}, "shapes": {"car": [1 / 8] * 8}},
        {"schema": SHAPES_SCHEMA, "provenance": {}, "shapes": {"car": [0.2] * 9}},
        {"schema": SHAPES_SCHEMA, "provenance": {}, "shapes": {"car": [2.0, -1.0] + [0.0] * 7}},
    ],
)
def test_a_document_that_is_no_list_of_shapes_is_refused(document: object) -> None:
    with pytest.raises(ValueError, match="shape"):
        parse_benchmark_shapes(json.dumps(document))
