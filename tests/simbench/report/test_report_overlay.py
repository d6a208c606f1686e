"""One crop: every point is drawn as what it is, where it is."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from simbench.report.overlay import (
    HEIGHT,
    LARGEST_DOT,
    SMALLEST_DOT,
    WIDTH,
    common_field,
    crop_svg,
    cut,
    dot_size,
    marks_of,
)
from tests.simbench.report.make import rng, view

CAMERA = PinholeCamera(fx_px=900, fy_px=900, cx_px=480, cy_px=300, width_px=960, height_px=600)
side = st.floats(4, 900)


def test_every_point_in_the_image_is_drawn_once_as_what_it_is() -> None:
    shown = view(3)
    marks = marks_of(shown, "probabilistic", CAMERA)
    mapped = shown.mapped["probabilistic"]
    assert len(marks.right) == int((mapped & shown.right).sum()) > 0
    assert len(marks.wrong) == int((mapped & ~shown.right).sum()) > 0
    assert len(marks.missed) == int((~mapped & shown.on_target).sum()) > 0
    assert sum(map(len, (marks.right, marks.wrong, marks.missed, marks.other))) == len(shown.uv_px)


def test_points_outside_the_image_are_not_drawn() -> None:
    shown = view(3)
    beyond = replace(shown, uv_px=shown.uv_px + np.array([700, 0], dtype=np.float32))
    marks = marks_of(beyond, "probabilistic", CAMERA)
    assert not any(map(len, (marks.right, marks.wrong, marks.missed, marks.other)))


def test_without_an_answer_nothing_is_mapped_and_without_a_box_there_is_no_aoi() -> None:
    marks = marks_of(replace(view(3), box_px=None), "no such pipeline", CAMERA)
    assert len(marks.right) == len(marks.wrong) == 0
    assert marks.aoi is None
    assert "nan" not in crop_svg(marks, common_field([marks], CAMERA), None, "x")


def test_the_aoi_is_twice_as_wide_as_the_box() -> None:
    assert marks_of(view(3), "probabilistic", CAMERA).aoi == (380.0, 250.0, 460.0, 350.0)


@given(st.floats(0, 900), st.floats(0, 560), side, side, st.floats(-80, 80))
def test_the_field_has_its_aspect_and_holds_what_lies_in_the_image(
    x: float, y: float, w: float, h: float, shift: float
) -> None:
    box = (x, y, min(x + w, 960.0), min(y + h, 600.0))
    shown = replace(view(1), box_px=box, outline_px=box, true_px=(x, y), told_px=(min(x + shift, 960.0), y))
    marks = marks_of(shown, "probabilistic", CAMERA)
    x0, y0, x1, y1 = common_field([marks], CAMERA)
    assert (x1 - x0) / (y1 - y0) == pytest.approx(WIDTH / HEIGHT)
    assert x0 <= box[0] + 1e-6 and box[2] <= x1 + 1e-6 and y0 <= box[1] + 1e-6 and box[3] <= y1 + 1e-6


@given(st.floats(-400, 900), st.floats(-400, 560), st.floats(4, 2000), st.floats(4, 2000))
def test_a_target_that_is_larger_than_the_image_is_shown_with_all_of_the_image_and_little_beside_it(
    x: float, y: float, w: float, h: float
) -> None:
    box = (max(x, 0.0), max(y, 0.0), min(x + max(w, 4.0 - x), 960.0), min(y + max(h, 4.0 - y), 600.0))
    shown = replace(view(1), box_px=box, outline_px=(x, y, x + w, y + h), true_px=(x, y), told_px=(x + w, y))
    x0, y0, x1, y1 = common_field([marks_of(shown, "probabilistic", CAMERA)], CAMERA)
    assert x1 - x0 <= 960.0 + 1e-6 and y1 - y0 <= 960.0 / (WIDTH / HEIGHT) + 1e-6
    assert x0 >= -1e-6 and x1 <= 960.0 + 1e-6


def test_a_pixel_of_the_picture_lands_where_the_drawing_puts_it() -> None:
    for sharper in (1, 2):
        picture = np.zeros((600 * sharper, 960 * sharper, 3), dtype=np.uint8)
        u, v = 500, 320
        picture[v * sharper : (v + 1) * sharper, u * sharper : (u + 1) * sharper] = 255
        field = (450.0, 286.0, 550.0, 354.0)
        shown = cut(picture, field, 960, 400).astype(float).sum(axis=2)
        rows, columns = np.indices(shown.shape)
        at = ((columns + 0.5) * shown).sum() / shown.sum(), ((rows + 0.5) * shown).sum() / shown.sum()
        assert at[0] == pytest.approx((u + 0.5 - field[0]) * 4, abs=0.3)
        assert at[1] == pytest.approx((v + 0.5 - field[1]) * 4, abs=0.3)


def test_the_svg_holds_as_many_dots_and_crosses_as_points() -> None:
    marks = marks_of(view(3), "probabilistic", CAMERA)
    svg = crop_svg(marks, common_field([marks], CAMERA), None, "crop")
    right = re.search(r'class="right"[^>]* d="([^"]*)"', svg)
    wrong = re.search(r'class="wrong"[^>]* d="([^"]*)"', svg)
    assert right is not None and right[1].count("M") == len(marks.right)
    assert wrong is not None and wrong[1].count("M") == len(marks.wrong)


def test_the_arrow_says_its_length_in_pixels_of_the_camera() -> None:
    marks = marks_of(view(1, shift=12.34), "probabilistic", CAMERA)
    assert ">12.3 px</text>" in crop_svg(marks, common_field([marks], CAMERA), None, "crop")
    lost = replace(marks, shift_px=None)
    assert "px</text>" not in crop_svg(lost, common_field([marks], CAMERA), None, "crop")


def test_the_label_is_escaped() -> None:
    marks = marks_of(view(1), "probabilistic", CAMERA)
    svg = crop_svg(marks, common_field([marks], CAMERA), None, '"><script>')
    assert "<script" not in svg


def test_dots_shrink_where_points_are_dense() -> None:
    g = rng("dots")
    sparse, dense = g.uniform(0, 400, (20, 2)), g.uniform(0, 40, (900, 2))
    assert dot_size(sparse) == LARGEST_DOT
    assert dot_size(dense) == SMALLEST_DOT
    assert dot_size(sparse[:1]) == LARGEST_DOT
