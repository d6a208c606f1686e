"""Gyro, accelerometer and odometer against the motion that they measure."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.geometry import Transform, rotation_exp, rotation_log
from fusion.messages import EgoMotion
from scenarios.load import load_sensor
from scenarios.scenario import ImuSensor, Path
from simbench.motion import Motion
from simbench.path import Track, make_track
from simbench.sensors import imu
from simbench.sensors.rig import Phases
from simbench.shake import Shake
from tests.simbench.scenes import a_shake, straight, toy_world

S = 1_000_000_000
MS = 1_000_000
G = 9.81
TOGETHER = Phases(gnss_ns=0, imu_ns=0, odometer_ns=0)


def sensor(**changes: object) -> ImuSensor:
    declared = load_sensor("imu-mems")
    assert isinstance(declared, ImuSensor)
    quiet: dict[str, object] = {
        "gyro_noise_dps_rthz": 0.0, "gyro_bias_dps": 0.0, "gyro_walk_dps_rts": 0.0,
        "accel_noise_mps2_rthz": 0.0, "accel_bias_mps2": 0.0, "accel_walk_mps2_rts": 0.0,
        "odometer_rate_hz": 100.0, "odometer_latency_ms": 0.0,
        "odometer_scale_error": 0.0, "odometer_step_mps": 0.0,
    }  # fmt: skip
    return declared.model_copy(update={**quiet, **changes})


def motion(
    track: Track | None = None, shaken: bool = True, place_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Motion:
    return Motion(
        world=toy_world([], [track or straight((0.0, 0.0), 20.0, 8.0)]),
        ego_actor=0,
        T_ego_root=Transform.identity(),
        T_ego_sensor={"imu": Transform(rotation=np.eye(3), translation_m=np.array(place_m))},
        body_shake=a_shake(4, 0.02) if shaken else None,
    )


def messages(
    of: Motion, declared: ImuSensor, seed: int = 0, end_s: float = 2.0, phases: Phases = TOGETHER
) -> tuple[EgoMotion, ...]:
    return imu.measure("imu", declared, of, round(end_s * S), np.random.default_rng(seed), phases)


def rates(of: Motion, declared: ImuSensor, seed: int = 0, end_s: float = 2.0) -> np.ndarray:
    return np.array([m.rate_radps for m in messages(of, declared, seed, end_s)])


def forces(of: Motion, declared: ImuSensor, seed: int = 0, end_s: float = 2.0) -> np.ndarray:
    return np.array([m.specific_force_mps2 for m in messages(of, declared, seed, end_s)])


def circle(radius_m: float, speed_mps: float, left: bool = True) -> Track:
    angle = np.deg2rad(np.arange(0, 240, 5))
    side = 1.0 if left else -1.0
    points = zip(radius_m * np.sin(angle), side * radius_m * (1 - np.cos(angle)), strict=True)
    return make_track(Path(waypoints_m=tuple((float(x), float(y)) for x, y in points), speed_mps=speed_mps))


def test_the_rate_integrates_back_to_the_bodys_attitude() -> None:
    moving = motion(make_track(Path(waypoints_m=((0.0, 0.0), (10.0, 1.0), (18.0, 9.0)), speed_mps=6.0)))
    fast = sensor(rate_hz=1000.0)
    rate = rates(moving, fast)
    t_ns = np.arange(0, 2 * S + 1, 1_000_000)
    R, _ = moving.shaken_ego(t_ns)
    attitude = R[0]
    for k in range(len(t_ns) - 1):
        attitude = attitude @ rotation_exp(0.5 * (rate[k] + rate[k + 1]) * 1e-3)
    assert np.linalg.norm(rotation_log(attitude.T @ R[-1])) < 1e-4
    assert np.linalg.norm(rotation_log(R[0].T @ R[-1])) > 0.3


def test_on_a_circle_the_yaw_rate_is_speed_over_radius() -> None:
    rate = rates(motion(circle(20.0, 8.0), shaken=False), sensor())
    np.testing.assert_allclose(rate[50:150], np.tile([0.0, 0.0, 0.4], (100, 1)), atol=2e-3)


def test_a_body_that_does_not_shake_on_a_straight_road_has_no_rate() -> None:
    assert np.abs(rates(motion(shaken=False), sensor())).max() < 1e-9


def test_bias_is_constant_and_noise_has_the_asked_density() -> None:
    biases, spreads = [], []
    declared = sensor(gyro_bias_dps=0.1, gyro_noise_dps_rthz=0.01)
    for seed in range(50):
        rate = np.rad2deg(rates(motion(shaken=False), declared, seed))
        biases.append(rate.mean(axis=0))
        spreads.append(rate.std(axis=0))
    # A density of 0.01 deg/s/rtHz up to the Nyquist frequency of 50 Hz.
    np.testing.assert_allclose(np.mean(spreads, axis=0), 0.01 * np.sqrt(50.0), rtol=0.03)
    np.testing.assert_allclose(np.std(biases, axis=0), 0.1, rtol=0.4)


def speeds(declared: ImuSensor, seed: int = 0) -> np.ndarray:
    profile = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=((0.0, 2.0), (2.0, 4.0))))
    velocity = np.array([m.velocity_mps for m in messages(motion(profile), declared, seed)])
    assert not velocity[:, 1:].any()
    return velocity[:, 0]


def test_an_ideal_odometer_reads_the_speed() -> None:
    np.testing.assert_allclose(speeds(sensor()), np.linspace(2.0, 4.0, 201), atol=1e-9)


def test_an_odometer_counts_in_steps() -> None:
    found = speeds(sensor(odometer_step_mps=0.05))
    np.testing.assert_allclose(found / 0.05, np.round(found / 0.05), atol=1e-9)
    assert np.abs(found - np.linspace(2.0, 4.0, 201)).max() <= 0.025 + 1e-9
    assert len(np.unique(np.round(found / 0.05))) == 41


def test_the_odometers_scale_is_off_by_one_factor_a_run() -> None:
    factors = []
    for seed in range(50):
        ratio = speeds(sensor(odometer_scale_error=0.01), seed) / np.linspace(2.0, 4.0, 201)
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
        factors.append(ratio[0] - 1.0)
    assert np.std(factors) == pytest.approx(0.01, rel=0.4)


def test_a_message_holds_the_odometers_newest_sample_that_is_old_enough() -> None:
    profile = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=((0.0, 2.0), (2.0, 4.0))))
    slow = sensor(odometer_rate_hz=20.0, odometer_latency_ms=15.0)
    found = messages(motion(profile), slow, phases=replace(TOGETHER, imu_ns=3 * MS, odometer_ns=40 * MS))
    for message in found:
        known_ms = message.stamp_ns / MS - 15.0
        sampled_ms = 40.0 + 50.0 * np.floor((known_ms - 40.0) / 50.0)
        expected = 2.0 + max(sampled_ms, 0.0) / 1000.0
        assert message.velocity_mps[0] == pytest.approx(min(expected, 4.0), abs=1e-9)


def test_messages_come_at_the_rate_with_their_phase_and_latency() -> None:
    found = messages(motion(), sensor(latency_ms=5.0), end_s=1.0, phases=replace(TOGETHER, imu_ns=7 * MS))
    assert [m.seq for m in found] == list(range(100))
    assert [m.stamp_ns for m in found] == list(range(7 * MS, S + 1, 10 * MS))
    assert {m.arrival_ns - m.stamp_ns for m in found} == {5 * MS}
    assert {m.sensor for m in found} == {"imu"}


# -- the accelerometer --------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed_mps", [0.0, 12.5])
def test_at_rest_and_at_constant_velocity_the_accelerometer_reads_only_gravity(speed_mps: float) -> None:
    force = forces(
        motion(straight((3.0, 5.0), 33.0, speed_mps), shaken=False, place_m=(1.0, 0.4, 0.5)), sensor()
    )
    np.testing.assert_allclose(force, np.tile([0.0, 0.0, G], (len(force), 1)), atol=1e-6)


@given(
    radius_m=st.floats(15.0, 60.0),
    speed_mps=st.floats(3.0, 10.0),
    left=st.booleans(),
    arm_x=st.floats(-2.0, 2.0),
    arm_y=st.floats(-1.0, 1.0),
)
@settings(max_examples=15)
def test_on_a_circle_it_reads_v_squared_over_r_towards_the_centre_at_its_own_place(
    radius_m: float, speed_mps: float, left: bool, arm_x: float, arm_y: float
) -> None:
    moving = motion(circle(radius_m, speed_mps, left), shaken=False, place_m=(arm_x, arm_y, 1.0))
    force = forces(moving, sensor(), end_s=3.0)[150:250]
    to_centre = radius_m if left else -radius_m
    turn2 = (speed_mps / radius_m) ** 2
    expected = [-turn2 * arm_x, turn2 * (to_centre - arm_y), G]
    np.testing.assert_allclose(force, np.tile(expected, (100, 1)), atol=0.01 * turn2 * radius_m)


def test_braking_pushes_back_and_a_start_pushes_forward() -> None:
    profile = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=((0.0, 2.0), (1.0, 5.0), (2.0, 1.0))))
    force = forces(motion(profile, shaken=False), sensor())
    np.testing.assert_allclose(force[5:95], np.tile([3.0, 0.0, G], (90, 1)), atol=1e-6)
    np.testing.assert_allclose(force[105:195], np.tile([-4.0, 0.0, G], (90, 1)), atol=1e-6)


def held(axis: int, value: float) -> Shake:
    """A body that leans and does not move: one term of frequency 0."""
    amplitude = np.zeros((4, 1))
    amplitude[axis] = value
    return Shake(frequency_hz=np.zeros(1), amplitude=amplitude, phase_rad=np.full((4, 1), np.pi / 2))


@pytest.mark.parametrize(("axis", "expected"), [(0, (0.0, 1.0)), (1, (-1.0, 0.0)), (2, (0.0, 0.0))])
def test_a_body_that_leans_reads_gravity_along_its_own_axes(axis: int, expected: tuple[float, float]) -> None:
    lean = 0.2  # rolled to the right, nose down, turned left
    leaning = replace(motion(straight((0.0, 0.0), 0.0, 5.0), shaken=False), body_shake=held(axis, lean))
    x, y = np.multiply(expected, G * np.sin(lean))
    z = G if axis == 2 else G * np.cos(lean)
    np.testing.assert_allclose(forces(leaning, sensor()), np.tile([x, y, z], (201, 1)), atol=1e-6)


def test_heave_is_read_as_its_second_derivative() -> None:
    amplitude = np.zeros((4, 1))
    amplitude[3] = 0.004
    heave = Shake(frequency_hz=np.array([12.0]), amplitude=amplitude, phase_rad=np.full((4, 1), 0.3))
    force = forces(replace(motion(shaken=False), body_shake=heave), sensor())
    w, t = 2 * np.pi * 12.0, np.arange(201) * 0.01
    np.testing.assert_allclose(force[:, 2], G - 0.004 * w**2 * np.sin(w * t + 0.3), atol=0.001 * 0.004 * w**2)
    np.testing.assert_allclose(force[:, :2], 0.0, atol=1e-6)


def test_gyro_and_accelerometer_alone_lead_to_where_the_imu_really_went() -> None:
    """Dead reckoning: only the first attitude, place and velocity are given."""
    track = make_track(Path(waypoints_m=((0.0, 0.0), (10.0, 1.0), (18.0, 9.0)), speed_mps=6.0))
    arm = np.array([0.8, -0.3, 1.1])
    moving = motion(track, place_m=(0.8, -0.3, 1.1))
    h = 1e-3
    found = messages(moving, sensor(rate_hz=1000.0), end_s=2.0)
    t_ns = np.array([m.stamp_ns for m in found])
    rotation, origin = moving.shaken_ego(t_ns)
    place = origin + rotation @ arm
    step_ns = 100_000
    (R0, p0), (R1, p1) = (moving.shaken_ego(np.array([side * step_ns])) for side in (-1, 1))
    velocity = ((p1 + R1 @ arm) - (p0 + R0 @ arm))[0] / (2e-9 * step_ns)
    attitude, position = rotation[0], place[0].copy()
    for a, b in pairwise(found):
        turned = attitude @ rotation_exp(0.5 * h * (a.rate_radps + b.rate_radps))
        pull = 0.5 * (attitude @ a.specific_force_mps2 + turned @ b.specific_force_mps2) - [0.0, 0.0, G]
        position += velocity * h + 0.5 * pull * h * h
        velocity = velocity + pull * h
        attitude = turned
    assert np.linalg.norm(place[-1] - place[0]) > 10.0
    np.testing.assert_allclose(position, place[-1], atol=0.005)


# -- noise --------------------------------------------------------------------------------------------------


def allan_variance(value: np.ndarray, group: int) -> np.ndarray:
    """Non-overlapping, per axis, of means over `group` samples."""
    count = len(value) // group
    means = value[: count * group].reshape(count, group, -1).mean(axis=1)
    return 0.5 * np.mean(np.diff(means, axis=0) ** 2, axis=0)


def long_rest(**changes: object) -> tuple[np.ndarray, np.ndarray]:
    """Gyro in deg/s and accelerometer in m/s^2 over 60 s at rest, without gravity."""
    still = motion(straight((0.0, 0.0), 0.0, 0.0), shaken=False)
    declared, found_gyro, found_force = sensor(**changes), [], []
    for seed in range(2):
        of_run = messages(still, declared, seed, end_s=60.0)
        found_gyro.append(np.rad2deg([m.rate_radps for m in of_run]))
        found_force.append(np.array([m.specific_force_mps2 for m in of_run]) - [0.0, 0.0, G])
    return np.concatenate(found_gyro, axis=1), np.concatenate(found_force, axis=1)


def test_white_noise_has_the_allan_variance_of_its_density_at_every_time() -> None:
    gyro, force = long_rest(gyro_noise_dps_rthz=0.01, accel_noise_mps2_rthz=0.002)
    for value, density in ((gyro, 0.01), (force, 0.002)):
        for group, tolerance in ((1, 0.03), (10, 0.1), (100, 0.3)):
            expected = density**2 / (2.0 * group / 100.0)  # one-sided density N: N^2 / (2 tau)
            assert allan_variance(value, group).mean() == pytest.approx(expected, rel=tolerance)


def test_a_bias_walks_as_far_as_the_root_of_time() -> None:
    gyro, force = long_rest(gyro_walk_dps_rts=0.001, accel_walk_mps2_rts=0.003)
    for value, walk in ((gyro, 0.001), (force, 0.003)):
        np.testing.assert_allclose(value[0], 0.0, atol=1e-6)
        for gap_s in (0.1, 1.0):
            gap = round(gap_s * 100)
            assert np.std(value[gap:] - value[:-gap]) == pytest.approx(walk * np.sqrt(gap_s), rel=0.15)
        assert allan_variance(value, 100).mean() == pytest.approx(walk**2 / 3.0, rel=0.3)


def test_a_bias_is_drawn_once_a_run_per_axis() -> None:
    still = motion(straight((0.0, 0.0), 0.0, 0.0), shaken=False)
    found = np.array([forces(still, sensor(accel_bias_mps2=0.05), seed, 0.5) for seed in range(100)])
    np.testing.assert_allclose(found, np.broadcast_to(found[:, :1], found.shape), atol=1e-6)
    np.testing.assert_allclose(np.std(found[:, 0] - [0.0, 0.0, G], axis=0), 0.05, rtol=0.25)


NOISE = {
    "gyro_noise_dps_rthz": 0.01, "gyro_bias_dps": 0.1, "gyro_walk_dps_rts": 0.001,
    "accel_noise_mps2_rthz": 0.002, "accel_bias_mps2": 0.05, "accel_walk_mps2_rts": 0.003,
    "odometer_scale_error": 0.01,
}  # fmt: skip


@pytest.mark.parametrize("part", ["gyro", "accel", "odometer"])
def test_the_noise_of_one_part_moves_no_number_of_another(part: str) -> None:
    without = {name: 0.0 if name.startswith(part) else value for name, value in NOISE.items()}
    loud, quiet = (messages(motion(), sensor(**fields), end_s=0.3) for fields in (NOISE, without))
    read = {"gyro": "rate_radps", "accel": "specific_force_mps2", "odometer": "velocity_mps"}
    for name, field in read.items():
        same = all(
            np.array_equal(getattr(a, field), getattr(b, field)) for a, b in zip(loud, quiet, strict=True)
        )
        assert same == (name != part)


def test_a_longer_run_begins_with_the_numbers_of_a_shorter_one() -> None:
    short, long = (messages(motion(), sensor(**NOISE), end_s=end_s) for end_s in (0.3, 0.5))
    for a, b in zip(short, long, strict=False):
        assert np.array_equal(a.rate_radps, b.rate_radps)
        assert np.array_equal(a.specific_force_mps2, b.specific_force_mps2)
        assert np.array_equal(a.velocity_mps, b.velocity_mps)


def test_the_gyro_never_reads_a_brackets_flex() -> None:
    plain = motion()
    bent = replace(plain, flex={"cam": a_shake(3, 0.05)})
    assert np.array_equal(rates(plain, sensor()), rates(bent, sensor()))
