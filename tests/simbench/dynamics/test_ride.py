"""A ride: what it answers between its states, where it ends, and what it does not depend on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.faults import RoadEvent
from scenarios.scenario import Path
from simbench.dynamics.ride import Overturned, Ride, drive_over
from simbench.dynamics.road import Road, draw_road
from simbench.path import make_track
from simbench.shake import BodyShake, Shake

MS, S = 1_000_000, 1_000_000_000
ROAD = draw_road(np.random.default_rng(1), "C")
PIVOT = (-0.5, 0.0, 0.4)


def ridden(
    first_s: float = -0.2,
    last_s: float = 1.5,
    road: Road = ROAD,
    speed_mps: float = 12.0,
    profile: str = "car",
) -> Ride:
    track = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=speed_mps))
    return drive_over(
        road, "C", profile, track, PIVOT, round(first_s * S), round(last_s * S)  # type: ignore[arg-type]
    )  # fmt: skip


RIDE = ridden()


def made(mount: np.ndarray, start_ns: int = 0) -> Ride:
    """A ride of these states, one a millisecond."""
    return Ride(
        start_ns=start_ns, step_ns=MS, base=mount, body=mount, mount=mount, linear=mount,
        roughness="C", roughness_m3=256e-6, events=0,
    )  # fmt: skip


def waves(hertz: float, amplitude: float = 0.01, seconds: float = 10.0) -> np.ndarray:
    t = np.arange(round(seconds * 1e3) + 1) * 1e-3
    return amplitude * np.stack([np.sin(2 * np.pi * hertz * t + k) for k in range(4)], axis=1)


def test_a_ride_can_stand_wherever_a_scripted_shake_can() -> None:
    assert isinstance(RIDE, BodyShake)
    assert issubclass(Shake, BodyShake)


def test_at_its_states_a_ride_gives_its_states() -> None:
    t_ns = RIDE.start_ns + RIDE.step_ns * np.arange(len(RIDE.mount), dtype=np.int64)
    np.testing.assert_allclose(RIDE.at(t_ns), RIDE.mount, rtol=0, atol=1e-15)


def test_between_its_states_a_ride_is_exact_to_nanoradians() -> None:
    """A 30 Hz wave, asked where no state is."""
    t_ns = np.arange(50 * MS, 9 * S, 7_654_321, dtype=np.int64)
    expected = 0.01 * np.stack([np.sin(2e-9 * np.pi * 30.0 * t_ns + k) for k in range(4)], axis=1)
    np.testing.assert_allclose(made(waves(30.0)).at(t_ns), expected, atol=5e-8)


@settings(max_examples=20)
@given(t_ns=st.integers(-100 * MS, 1400 * MS))
def test_value_rate_and_its_change_have_no_kinks(t_ns: int) -> None:
    """One-sided differences over 2 us agree, at the states themselves too."""
    for centre in (t_ns, t_ns // MS * MS):
        around = np.array(
            [centre - 2000, centre - 1000, centre, centre + 1000, centre + 2000], dtype=np.int64
        )
        value, rate = RIDE.at(around), RIDE.rate_at(around)
        np.testing.assert_allclose((value[4] - value[0]) / 4e-6, rate[2], atol=1e-7)
        before, after = (rate[2] - rate[1]) / 1e-6, (rate[3] - rate[2]) / 1e-6
        np.testing.assert_allclose(before, after, atol=0.05)


def test_asked_beyond_its_ends_a_ride_refuses() -> None:
    first, last = RIDE.start_ns, RIDE.start_ns + (len(RIDE.mount) - 1) * MS
    assert first == -200 * MS and last == 1500 * MS
    RIDE.at(np.array([first, last]))
    for beyond in (first - 1, last + 1):
        with pytest.raises(ValueError, match=r"the ride was integrated from -0.200 to 1.500 s, not at"):
            RIDE.at(np.array([0, beyond]))
    assert RIDE.at(np.zeros(0, dtype=np.int64)).shape == (0, 4)


def test_rms_and_rate_of_a_wave_follow_the_closed_form() -> None:
    ride = made(waves(4.0, 0.2))
    np.testing.assert_allclose(ride.rms(10.0), 0.2 / np.sqrt(2.0), rtol=2e-3)
    np.testing.assert_allclose(ride.rate_rms(10.0), 0.2 / np.sqrt(2.0) * 2.0 * np.pi * 4.0, rtol=2e-3)


def test_the_linear_rms_is_taken_over_the_run_only() -> None:
    early = np.concatenate([np.full((500, 4), 3.0), waves(4.0, 0.2, 5.0)])
    ride = replace(made(early, -500 * MS), linear=early)
    np.testing.assert_allclose(ride.linear_rms(5.0), ride.rms(5.0), rtol=1e-9)


def test_the_same_seed_gives_the_same_bytes() -> None:
    again = ridden(road=draw_road(np.random.default_rng(1), "C"))
    for part in ("base", "body", "mount", "linear"):
        assert getattr(RIDE, part).tobytes() == getattr(again, part).tobytes()


def test_a_longer_ride_begins_as_the_shorter_one() -> None:
    longer = ridden(last_s=2.0)
    n = len(RIDE.mount) - 2  # the road's rate at the last row is one-sided
    np.testing.assert_allclose(longer.mount[:n], RIDE.mount[:n], atol=1e-12)


def test_where_it_was_put_on_the_road_is_forgotten() -> None:
    earlier = ridden(first_s=-2.7)
    skipped = len(earlier.mount) - len(RIDE.mount)
    difference = np.abs(earlier.mount[skipped:] - RIDE.mount)
    assert np.rad2deg(difference[:, :3]).max() < 0.01
    assert difference[:, 3].max() < 1e-4


def test_a_creeping_body_stands_as_the_road_under_its_wheels() -> None:
    """At walking pace, on a road whose right side lies 10 mm lower: the plane through the four wheels."""
    road = Road(left_m=ROAD.left_m, right_m=ROAD.left_m - 0.01)
    ride = ridden(last_s=4.0, speed_mps=0.3, road=road)
    arc_m = 0.3 * np.arange(-0.2, 4.0005, 1e-3)
    front, rear = (road.met_m("left", arc_m + x, 0.33, 0.15) for x in (1.36, -1.34))
    pitch = (rear - front) / 2.7
    assert np.ptp(pitch) > 0.003
    np.testing.assert_allclose(ride.base[:, 3], rear - pitch * 0.84 - 0.005, atol=2e-3)
    np.testing.assert_allclose(np.rad2deg(ride.base[:, 0]), np.rad2deg(0.01 / 1.5), atol=0.03)
    np.testing.assert_allclose(np.rad2deg(ride.base[:, 1]), np.rad2deg(pitch), atol=0.06)


def test_heave_is_read_at_the_pivot() -> None:
    """On the road's slope alone, a pivot farther back lies lower by the slope times the way."""
    slope = 0.002
    x = np.arange(409_600) * 0.01
    ramp = slope * np.clip(np.minimum(x, 4096.0 - x), 0.0, 40.0)
    road = Road(left_m=ramp, right_m=ramp)
    track = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=2.0))
    heaves = [
        drive_over(road, "C", "car", track, (x, 0.0, 0.4), 6 * S, 6 * S + MS).base[0, 3] for x in (0.0, -1.0)
    ]
    assert heaves[0] - heaves[1] == pytest.approx(slope, rel=0.05)


def test_a_rider_who_meets_a_kerb_too_fast_falls() -> None:
    kerb = RoadEvent(kind="kerb", at_m=8.0, height_m=0.3, length_m=3.0)
    road = draw_road(np.random.default_rng(1), "smooth", (kerb,))
    with pytest.raises(Overturned, match="the e-scooter does not stay upright: it tilts by"):
        ridden(last_s=3.0, road=road, speed_mps=5.0, profile="rider")


def test_a_ride_must_end_after_it_starts() -> None:
    with pytest.raises(ValueError, match="must end after it starts"):
        ridden(first_s=1.0, last_s=1.0)
