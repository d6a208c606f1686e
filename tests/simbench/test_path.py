"""Scripted drives against numerical integration."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from scenarios.scenario import Path
from simbench.path import make_track

S = 1_000_000_000


def ns(t_s: float | list[float] | np.ndarray) -> np.ndarray:
    return np.round(np.atleast_1d(np.asarray(t_s)) * S).astype(np.int64)


@st.composite
def profiles(draw: st.DrawFn) -> tuple[tuple[float, float], ...]:
    times = draw(st.lists(st.integers(0, 100), min_size=1, max_size=6, unique=True))
    return tuple((t / 10.0, draw(st.integers(0, 200)) / 10.0) for t in sorted(times))


@settings(max_examples=50)
@given(profile=profiles(), end_s=st.floats(-3.0, 14.0))
def test_the_distance_driven_is_the_integral_of_the_speed(
    profile: tuple[tuple[float, float], ...], end_s: float
) -> None:
    track = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=profile))
    end_ns = ns(end_s)
    t = np.linspace(0.0, end_ns[0] / S, 200_001)
    expected = np.trapezoid(track.speed_at(np.round(t * S).astype(np.int64)), t)
    assert track.arc_m(end_ns)[0] == pytest.approx(expected, abs=1e-5)


def test_a_speed_profile_holds_its_end_values_and_is_linear_between() -> None:
    track = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=((1.0, 2.0), (3.0, 6.0))))
    np.testing.assert_allclose(track.speed_at(ns([-1.0, 0.0, 1.0, 2.0, 3.0, 9.0])), [2, 2, 2, 4, 6, 6])
    # 2 m in the first second, then (2 + 6) / 2 * 2 s = 8 m, then 6 m/s
    np.testing.assert_allclose(track.arc_m(ns([-1.0, 0.0, 1.0, 3.0, 4.0])), [-2, 0, 2, 10, 16], atol=1e-12)


def test_one_waypoint_goes_straight_along_its_heading() -> None:
    track = make_track(Path(waypoints_m=((3.0, -2.0),), heading_deg=90.0, speed_mps=5.0))
    xy, heading = track.at(ns([0.0, 2.0, -1.0]))
    np.testing.assert_allclose(xy, [[3.0, -2.0], [3.0, 8.0], [3.0, -7.0]], atol=1e-12)
    np.testing.assert_allclose(heading, np.pi / 2)


def test_two_waypoints_are_an_exact_line_that_goes_on_past_its_end() -> None:
    track = make_track(Path(waypoints_m=((0.0, 0.0), (3.0, 4.0)), speed_mps=1.0))
    xy, heading = track.at(ns([0.0, 2.5, 10.0]))
    np.testing.assert_allclose(xy, [[0, 0], [1.5, 2.0], [6.0, 8.0]], atol=1e-12)
    np.testing.assert_allclose(heading, np.arctan2(4.0, 3.0))


CURVE = ((0.0, 0.0), (20.0, 1.0), (40.0, 12.0), (48.0, 30.0))


def test_a_curve_passes_its_waypoints() -> None:
    track = make_track(Path(waypoints_m=CURVE, speed_mps=10.0))
    xy, _ = track.at(ns(np.arange(0.0, 7.0, 0.001)))
    for point in CURVE:
        assert np.hypot(*(xy - point).T).min() < 0.006  # between two samples 1 cm apart


def test_on_a_curve_speed_and_heading_are_those_of_the_motion() -> None:
    track = make_track(Path(waypoints_m=CURVE, speed_mps=8.0))
    t, h = np.arange(0.5, 5.0, 0.1), 0.02
    (after, _), (before, _) = track.at(ns(t + h)), track.at(ns(t - h))
    velocity = (after - before) / (2.0 * h)
    _, heading = track.at(ns(t))
    np.testing.assert_allclose(np.hypot(*velocity.T), 8.0, rtol=2e-4)
    np.testing.assert_allclose(np.arctan2(velocity[:, 1], velocity[:, 0]), heading, atol=2e-3)


def test_the_length_of_a_curve_is_its_numerical_arc_length() -> None:
    track = make_track(Path(waypoints_m=CURVE, speed_mps=8.0))
    points = np.array(CURVE)
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    tangent = CubicSpline(chord, points).derivative()
    u = np.linspace(0.0, chord[-1], 400_001)
    length = np.trapezoid(np.hypot(*tangent(u).T), u)
    assert track.knot_s[-1] == pytest.approx(length, rel=1e-6)


def test_past_its_end_a_curve_goes_on_straight() -> None:
    track = make_track(Path(waypoints_m=CURVE, speed_mps=8.0))
    end_s = track.knot_s[-1] / 8.0
    xy, heading = track.at(ns([end_s, end_s + 1.0, end_s + 2.0]))
    assert heading[0] == pytest.approx(heading[2])
    np.testing.assert_allclose(
        xy[2] - xy[1], 8.0 * np.array([np.cos(heading[0]), np.sin(heading[0])]), atol=1e-6
    )
