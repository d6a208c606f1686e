"""Roads: spectrum, coherence, events, and what a wheel makes of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.signal import csd, welch

from scenarios.faults import RoadEvent, Roughness
from simbench.dynamics.road import (
    MARGIN,
    PERIOD_M,
    ROUGHNESS_M3,
    STEP_M,
    Road,
    averaged,
    between,
    cross_ratio,
    draw_road,
    mirrored,
    rolled_over,
    roughness_m3,
)

CLASSES: tuple[Roughness, ...] = ("A", "B", "C", "D", "E")


def drawn(roughness: Roughness = "C", seed: int = 0, events: tuple[RoadEvent, ...] = ()) -> Road:
    return draw_road(np.random.default_rng(seed), roughness, events)


def event(kind: str = "bump", track: str = "both", at_m: float = 10.0, height_m: float = 0.1) -> RoadEvent:
    return RoadEvent.model_validate(
        {"kind": kind, "at_m": at_m, "height_m": height_m, "length_m": 2.0, "track": track}
    )


# -- spectrum ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("roughness", CLASSES)
def test_over_two_kilometres_every_octave_lies_within_its_class(roughness: Roughness) -> None:
    """By Welch. A class reaches from half to twice its mean; every octave must come within 20 % of it (35 %
    for the longest waves, of which the road has few).
    """
    mean = ROUGHNESS_M3[roughness]
    road = drawn(roughness)
    arc_m = np.arange(0.0, 2000.0, 0.02)
    for side in ("left", "right"):
        n, density = welch(road.heights_m(side, arc_m), fs=50.0, nperseg=2**14)  # type: ignore[arg-type]
        for low, high in pairwise((0.022, 0.044, 0.088, 0.18, 0.35, 0.71, 1.41, 2.83, 5.6, 9.0)):
            inside = (n >= low) & (n < high)
            found = float(np.mean(density[inside] * (n[inside] / 0.1) ** 2))
            assert 0.5 * mean < found < 2.0 * mean
            assert found == pytest.approx(mean, rel=0.35 if low < 0.08 else 0.2), (side, low)


def test_nothing_lies_outside_the_band() -> None:
    n = np.fft.rfftfreq(len(drawn().left_m), STEP_M)
    power = np.abs(np.fft.rfft(drawn().left_m)) ** 2
    assert power[(n < 0.0109) | (n > 10.01)].sum() < 1e-20 * power.sum()


def test_the_table_tells_its_own_roughness() -> None:
    for roughness in CLASSES:
        assert roughness_m3(drawn(roughness, seed=4)) == pytest.approx(ROUGHNESS_M3[roughness], rel=0.03)
    assert roughness_m3(drawn("smooth")) == 0.0


def test_a_class_is_the_same_road_twice_as_high_as_the_class_before() -> None:
    for smoother, rougher in pairwise(CLASSES):
        np.testing.assert_allclose(
            2.0 * drawn(smoother).left_m, drawn(rougher).left_m, rtol=1e-12, atol=1e-15
        )


def test_parallel_tracks_cohere_as_an_isotropic_plane_does() -> None:
    """The cosine transform of (n^2 + m^2)^(-3/2) across the lines, integrated numerically."""
    for n in (0.02, 0.1, 0.4):
        for apart_m in (0.5, 1.5):

            def plane(m: float, n: float = n) -> float:
                return float((n * n + m * m) ** -1.5)

            across, _ = quad(plane, 0.0, np.inf, weight="cos", wvar=2.0 * np.pi * apart_m)
            alone, _ = quad(plane, 0.0, np.inf)
            assert cross_ratio(np.array([n]), apart_m)[0] == pytest.approx(across / alone, rel=1e-5)


def test_left_and_right_are_as_coherent_as_asked() -> None:
    road = drawn("C", seed=1)
    n, cross = csd(road.left_m, road.right_m, fs=1.0 / STEP_M, nperseg=2**14)
    _, left = welch(road.left_m, fs=1.0 / STEP_M, nperseg=2**14)
    _, right = welch(road.right_m, fs=1.0 / STEP_M, nperseg=2**14)
    for low, high in pairwise((0.02, 0.05, 0.1, 0.2, 0.4, 1.0)):
        inside = (n >= low) & (n < high)
        weight = n[inside] ** 2
        found = np.sum(weight * cross[inside].real) / np.sum(weight * np.sqrt(left * right)[inside])
        asked = np.average(cross_ratio(n[inside], 1.5))
        assert found == pytest.approx(asked, abs=0.12)


# -- one road ---------------------------------------------------------------------------------------------


def test_the_same_seed_is_the_same_road_and_another_is_another() -> None:
    assert drawn(seed=3).left_m.tobytes() == drawn(seed=3).left_m.tobytes()
    assert np.abs(np.corrcoef(drawn(seed=3).left_m, drawn(seed=4).left_m)[0, 1]) < 0.2


@settings(max_examples=20)
@given(start_m=st.floats(-500.0, 500.0), length_m=st.floats(0.5, 40.0), part=st.floats(0.1, 0.9))
def test_what_a_wheel_meets_does_not_depend_on_how_far_it_drives(
    start_m: float, length_m: float, part: float
) -> None:
    road = ROADS["rough"]
    arc_m = start_m + np.linspace(0.0, length_m, 200)
    i = round(200 * part)
    whole = road.met_m("left", arc_m, 0.33, 0.15)
    np.testing.assert_allclose(road.met_m("left", arc_m[:i], 0.33, 0.15), whole[:i], atol=1e-12)
    np.testing.assert_allclose(road.met_m("left", arc_m[i:], 0.33, 0.15), whole[i:], atol=1e-12)


ROADS = {"rough": drawn("D", 2, (event(at_m=-3.0), event("pothole", "left"), event("seam", at_m=20.0)))}


def test_a_road_repeats_after_its_period() -> None:
    arc_m = np.linspace(-3.0, 3.0, 50)
    road = drawn()
    np.testing.assert_allclose(
        road.heights_m("left", arc_m), road.heights_m("left", arc_m + PERIOD_M), atol=1e-9
    )


def test_a_mirrored_road_has_its_sides_and_events_exchanged() -> None:
    road = drawn("B", 5, (event("kerb", "left"), event("joint", "right", 15.0), event("bump", "both", 30.0)))
    other, arc_m = mirrored(road), np.linspace(0.0, 40.0, 500)
    assert np.array_equal(other.heights_m("left", arc_m), road.heights_m("right", arc_m))
    assert np.array_equal(other.heights_m("right", arc_m), road.heights_m("left", arc_m))
    again = mirrored(other)
    assert again.events == road.events and np.array_equal(again.left_m, road.left_m)


# -- events -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "heights_mm"),  # at 9.9, 10.5, 11.0, 11.5, 12.1 m of a thing of 100 mm from 10 to 12 m
    [
        ("bump", [0, 50, 100, 50, 0]),
        ("kerb", [0, 100, 100, 100, 0]),
        ("pothole", [0, -100, -100, -100, 0]),
        ("joint", [0, -100, -100, -100, 0]),
        ("seam", [0, 75, 50, 25, 0]),
    ],
)
def test_an_event_has_its_shape(kind: str, heights_mm: list[float]) -> None:
    arc_m = np.array([9.9, 10.5, 11.0, 11.5, 12.1])
    found = drawn("smooth", events=(event(kind),)).heights_m("left", arc_m)
    np.testing.assert_allclose(1e3 * found, heights_mm, atol=1e-9)


def test_an_event_lies_on_its_track_only_and_a_single_track_vehicle_meets_all() -> None:
    road, arc_m = drawn("smooth", events=(event("kerb", "right"),)), np.linspace(9.0, 13.0, 100)
    assert not road.heights_m("left", arc_m).any() and road.heights_m("right", arc_m).any()
    assert not road.met_m("left", arc_m, 0.1, 0.05).any()
    single = road.met_m(None, arc_m, 0.1, 0.05)
    assert np.array_equal(single, road.met_m("right", arc_m, 0.1, 0.05)) and single.max() > 0.09


# -- wheels -----------------------------------------------------------------------------------------------

TABLES = st.lists(st.floats(-0.1, 0.1), min_size=150, max_size=150).map(np.array)


@settings(max_examples=30)
@example(heights=np.zeros(150), radius_m=0.41, more=0.0)  # 41 cells are longer than 0.41, in float64
@given(heights=TABLES, radius_m=st.floats(0.05, 0.5), more=st.floats(0.0, 0.1))
def test_a_disc_never_sinks_in_never_floats_and_a_larger_one_runs_higher(
    heights: np.ndarray, radius_m: float, more: float
) -> None:
    path = rolled_over(heights, radius_m)
    assert np.all(path >= heights) and path.max() <= heights.max()
    assert np.all(rolled_over(heights, radius_m + more) >= path - 1e-15)
    np.testing.assert_allclose(rolled_over(heights + 0.3, radius_m), path + 0.3, atol=1e-12)


def test_a_disc_climbs_a_step_along_a_circle_about_its_edge() -> None:
    """Hub path over a step of height h: sqrt(r^2 - x^2) + h - r once the rim meets the edge, x before it."""
    heights = np.where(np.arange(200) >= 100, 0.1, 0.0)
    path, r = rolled_over(heights, 0.33), 0.33
    for before_m in (0.05, 0.1, 0.2):
        expected = 0.1 - (r - np.sqrt(r**2 - before_m**2))
        assert path[100 - round(before_m / STEP_M)] == pytest.approx(max(expected, 0.0), abs=1e-12)
    assert path[100 - 25] == 0.0 and np.all(path[100:] == 0.1)


def test_a_short_hole_hardly_takes_a_wheel() -> None:
    heights = np.where((np.arange(200) >= 100) & (np.arange(200) < 110), -0.1, 0.0)
    sunk = -rolled_over(heights, 0.33).min()
    assert sunk == pytest.approx(0.33 - np.sqrt(0.33**2 - 0.05**2), abs=1e-3)


@pytest.mark.parametrize("length_m", [0.05, 0.15, 0.123])
def test_the_contact_averages_a_wave_as_a_sinc_and_leaves_a_slope_alone(length_m: float) -> None:
    rows = np.arange(400)
    cycles_per_m = 1.5
    wave = np.sin(2.0 * np.pi * cycles_per_m * rows * STEP_M)
    left = averaged(wave, length_m)[50:-50]
    np.testing.assert_allclose(left, wave[50:-50] * np.sinc(cycles_per_m * length_m), atol=2e-3)
    np.testing.assert_allclose(averaged(0.01 * rows, length_m)[50:-50], 0.01 * rows[50:-50], atol=1e-12)


def test_between_the_rows_a_table_is_smooth_and_on_them_exact() -> None:
    table = np.random.default_rng(0).normal(size=64)
    assert np.array_equal(between(table, np.arange(64.0)), table)
    parabola = (np.arange(64.0) - 30.0) ** 2
    np.testing.assert_allclose(between(parabola, np.array([20.25, 30.5])), [9.75**2, 0.25], rtol=1e-12)


def test_a_wheel_fits_into_the_margin() -> None:
    assert MARGIN * STEP_M > 0.5
