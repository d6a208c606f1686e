"""A swaying path against its closed form and finite differences of its own motion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.scenario import Bend, Path, Sway
from simbench.bend import BentRoad
from simbench.path import Track, make_track

S = 1_000_000_000
CURVE = ((0.0, 0.0), (20.0, 1.0), (40.0, 12.0), (48.0, 30.0))
BEND = Bend(at_m=5.0, length_m=60.0, radius_m=50.0, turn="right")

sways = st.builds(
    Sway, amplitude_m=st.floats(0.0, 0.3), frequency_hz=st.floats(0.5, 1.0), phase_deg=st.floats(0.0, 360.0)
)


def ns(t_s: np.ndarray) -> np.ndarray:
    return np.round(t_s * S).astype(np.int64)


TIMES_S = np.linspace(0.1, 4.9, 97)
PAST_THE_END_S = np.linspace(12.03, 16.03, 41)  # of the curve and of the bend


@given(sway=sways, heading=st.floats(-180.0, 180.0), speed=st.floats(2.0, 12.0))
def test_across_a_straight_way_the_sway_is_a_sine(sway: Sway, heading: float, speed: float) -> None:
    path = Path(waypoints_m=((3.0, -2.0),), heading_deg=heading, speed_mps=speed, sway=sway)
    xy, _ = make_track(path).at(ns(TIMES_S))
    c, s = np.cos(np.deg2rad(heading)), np.sin(np.deg2rad(heading))
    along, left = ((xy - [3.0, -2.0]) @ np.array([[c, -s], [s, c]])).T
    angle = 2.0 * np.pi * sway.frequency_hz * TIMES_S + np.deg2rad(sway.phase_deg)
    np.testing.assert_allclose(along, speed * TIMES_S, atol=1e-9)
    np.testing.assert_allclose(left, sway.amplitude_m * np.sin(angle), atol=1e-9)


def the_tracks(sway: Sway, profile: tuple[tuple[float, float], ...]) -> list[Track]:
    return [
        make_track(Path(waypoints_m=((0.0, 1.0),), speed_mps=profile, sway=sway)),
        make_track(Path(waypoints_m=CURVE, speed_mps=profile, sway=sway)),
        make_track(Path(waypoints_m=((0.0, -3.0),), speed_mps=profile, sway=sway), BentRoad(BEND)),
    ]


@settings(max_examples=25)
@given(sway=sways, slow=st.floats(3.0, 6.0), fast=st.floats(7.0, 9.0))
def test_heading_and_speed_are_those_of_the_swaying_motion(sway: Sway, slow: float, fast: float) -> None:
    t_s = np.concatenate([TIMES_S, PAST_THE_END_S * 7.0 / slow])
    for track in the_tracks(sway, ((1.0, fast), (3.0, slow))):
        h_s = 1e-3
        (after, _), (before, _) = track.at(ns(t_s + h_s)), track.at(ns(t_s - h_s))
        velocity = (after - before) / (2.0 * h_s)
        np.testing.assert_allclose(np.hypot(*velocity.T), track.speed_at(ns(t_s)), rtol=5e-4)
        _, heading = track.at(ns(t_s))
        turn = np.angle(np.exp(1j * (heading - np.arctan2(velocity[:, 1], velocity[:, 0]))))
        np.testing.assert_allclose(turn, 0.0, atol=1e-3)


def test_a_sway_of_nothing_changes_nothing_bit_for_bit() -> None:
    still = Sway(amplitude_m=0.0, frequency_hz=0.7, phase_deg=40.0)
    path = Path(waypoints_m=CURVE, speed_mps=6.0)
    plain, swayed = make_track(path), make_track(path.model_copy(update={"sway": still}))
    for a, b in zip(plain.at(ns(TIMES_S)), swayed.at(ns(TIMES_S)), strict=True):
        assert np.array_equal(a, b)
    assert np.array_equal(plain.speed_at(ns(TIMES_S)), swayed.speed_at(ns(TIMES_S)))


def test_a_swaying_rider_of_5_metres_a_second_by_hand() -> None:
    """0.2 m at 0.5 Hz: across at pi / 5 m/s where it crosses its line, so 5.039 m/s and 7.16 degrees."""
    sway = Sway(amplitude_m=0.2, frequency_hz=0.5)
    track = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=5.0, sway=sway))
    t_ns = ns(np.array([0.0, 0.5, 1.0, 1.5]))
    xy, heading = track.at(t_ns)
    np.testing.assert_allclose(xy, [[0.0, 0.0], [2.5, 0.2], [5.0, 0.0], [7.5, -0.2]], atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(heading), [7.1625, 0.0, -7.1625, 0.0], atol=1e-3)
    np.testing.assert_allclose(track.speed_at(t_ns), [5.03932, 5.0, 5.03932, 5.0], atol=1e-5)
    assert track.arc_m(t_ns)[3] == pytest.approx(7.5)  # along the path; the sway adds nothing
