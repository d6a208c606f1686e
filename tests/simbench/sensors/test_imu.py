"""Gyro and odometer against the motion that they measure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusion.geometry import Transform, rotation_exp, rotation_log
from scenarios.load import load_sensor
from scenarios.scenario import ImuSensor, Path
from simbench.motion import Motion
from simbench.path import Track, make_track
from simbench.sensors import imu
from tests.simbench.scenes import a_shake, straight, toy_world

S = 1_000_000_000


def sensor(**changes: object) -> ImuSensor:
    declared = load_sensor("imu-mems")
    assert isinstance(declared, ImuSensor)
    quiet: dict[str, object] = {
        "gyro_noise_dps_rthz": 0.0, "gyro_bias_dps": 0.0,
        "odometer_scale_error": 0.0, "odometer_step_mps": 0.0,
    }  # fmt: skip
    return declared.model_copy(update={**quiet, **changes})


def motion(track: Track | None = None, shaken: bool = True) -> Motion:
    return Motion(
        world=toy_world([], [track or straight((0.0, 0.0), 20.0, 8.0)]),
        ego_actor=0,
        T_ego_root=Transform.identity(),
        T_ego_sensor={},
        body_shake=a_shake(4, 0.02) if shaken else None,
    )


def rates(of: Motion, declared: ImuSensor, seed: int = 0, end_s: float = 2.0) -> np.ndarray:
    messages = imu.measure("imu", declared, of, round(end_s * S), np.random.default_rng(seed))
    return np.array([m.rate_radps for m in messages])


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
    angle = np.deg2rad(np.arange(0, 120, 5))
    points = tuple((float(20 * np.sin(a)), float(20 * (1 - np.cos(a)))) for a in angle)
    rate = rates(motion(make_track(Path(waypoints_m=points, speed_mps=8.0)), shaken=False), sensor())
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
    messages = imu.measure("imu", declared, motion(profile), 2 * S, np.random.default_rng(seed))
    velocity = np.array([m.velocity_mps for m in messages])
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


def test_messages_come_at_the_rate_with_their_latency() -> None:
    messages = imu.measure("imu", sensor(latency_ms=5.0), motion(), S, np.random.default_rng(0))
    assert [m.seq for m in messages] == list(range(101))
    assert [m.stamp_ns for m in messages] == list(range(0, S + 1, 10_000_000))
    assert {m.arrival_ns - m.stamp_ns for m in messages} == {5_000_000}
    assert {m.sensor for m in messages} == {"imu"}


def test_the_gyro_never_reads_a_brackets_flex() -> None:
    plain = motion()
    bent = replace(plain, flex={"cam": a_shake(3, 0.05)})
    assert np.array_equal(rates(plain, sensor()), rates(bent, sensor()))
