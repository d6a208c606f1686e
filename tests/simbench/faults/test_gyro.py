"""What a gyro would find of a shake, and how far its noise takes that: against rotations and draws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from simbench.faults.estimate import BodyAttitude, integrated_rad
from simbench.faults.gyro import GyroNoise, ideal_rates_radps
from simbench.shake import Shake
from tests.simbench.support import staged

STAMP_NS = np.arange(0, 4_000_000_000, 10_000_000, dtype=np.int64)
PERIOD_S = 0.01
PICTURES_NS = np.arange(7_000_000, 3_900_000_000, 83_000_000, dtype=np.int64)
STRAIGHT = np.zeros(len(STAMP_NS))


def a_shake(seed: int, size_rad: float) -> Shake:
    """Three tones per axis."""
    rng = np.random.default_rng(seed)
    return Shake(
        frequency_hz=rng.uniform(0.5, 6.0, 3), amplitude=size_rad * rng.uniform(0.2, 1.0, (4, 3)),
        phase_rad=rng.uniform(0.0, 6.28, (4, 3)),
    )  # fmt: skip


def body(noise: GyroNoise, yaw_rad: np.ndarray = STRAIGHT) -> BodyAttitude:
    return BodyAttitude(
        stamp_ns=STAMP_NS, angle_rad=np.zeros((len(STAMP_NS), 3)), yaw_rad=yaw_rad, sd_rad=0.0, noise=noise
    )


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), size_rad=st.floats(1e-4, 0.3), turn_radps=st.floats(-0.5, 0.5))
def test_an_ideal_gyro_reads_the_turn_of_the_body_in_its_own_axes(
    seed: int, size_rad: float, turn_radps: float
) -> None:
    """Against the rotation vector between attitudes half a millisecond apart."""
    shake = a_shake(seed, size_rad)

    def attitude(t_ns: np.ndarray) -> Rotation:
        angles = shake.at(t_ns)[:, :3] + np.outer(turn_radps * t_ns * 1e-9, [0.0, 0.0, 1.0])
        return Rotation.from_euler("ZYX", angles[:, ::-1])

    turned = attitude(STAMP_NS - 250_000).inv() * attitude(STAMP_NS + 250_000)
    found = ideal_rates_radps(shake, turn_radps * STAMP_NS * 1e-9, STAMP_NS)
    assert found == pytest.approx(turned.as_rotvec() / 5e-4, abs=2e-4 * np.abs(found).max())


def test_small_angles_are_found_as_they_are() -> None:
    shake = a_shake(1, 1e-4)
    attitude = body(GyroNoise())
    drawn = attitude.seen(shake.at(STAMP_NS)[:, :3], STAMP_NS)
    found = attitude.seen(attitude.expected_rad(shake), STAMP_NS)
    assert found == pytest.approx(drawn, abs=2e-2 * 1e-4)


@pytest.mark.parametrize(
    "noise",
    [
        GyroNoise(white_radps=2e-3),
        GyroNoise(wander_radps=3e-4),
        GyroNoise(white_radps=2e-3, wander_radps=3e-4),
    ],
    ids=["white", "wandering bias", "both"],
)
@pytest.mark.parametrize("frames", ["samples", "pictures in between"])
def test_gains_scatter_by_the_sd_that_the_noise_gives(noise: GyroNoise, frames: str) -> None:
    """150 gyros at rest, none of which contains the shake."""
    attitude, rng = body(noise), np.random.default_rng(5)
    t_ns = STAMP_NS if frames == "samples" else PICTURES_NS
    signal = attitude.seen(a_shake(2, 0.01).at(t_ns)[:, :3], t_ns)
    gains = []
    for _ in range(150):
        rate = noise.white_radps * rng.standard_normal((len(STAMP_NS), 3))
        rate += noise.wander_radps * np.cumsum(rng.standard_normal((len(STAMP_NS), 3)), axis=0)
        angle = integrated_rad(rate, STRAIGHT, STAMP_NS)
        at = np.stack([np.interp(t_ns, STAMP_NS, angle[:, a]) for a in range(3)], axis=1)
        gains.append(np.sum(attitude.seen(at, t_ns) * signal) / np.sum(signal**2))
    said = attitude.gain_sd(signal, t_ns)
    assert np.mean(gains) / said == pytest.approx(0.0, abs=0.41)  # 5 SD of 150
    assert np.std(gains) / said == pytest.approx(1.0, abs=0.29)


def test_nothing_drawn_has_no_gain() -> None:
    still = body(GyroNoise(white_radps=1e-3))
    assert still.gain_sd(np.zeros((len(STAMP_NS), 1)), STAMP_NS) == float("inf")


def test_noise_follows_from_the_data_sheet() -> None:
    """0.01 deg/s/sqrt(Hz) at 100 Hz: 0.01 sqrt(50) deg/s a sample."""
    imu = staged().rig.imu
    assert imu is not None
    sensor = imu.model_copy(
        update={"gyro_noise_dps_rthz": 0.01, "gyro_walk_dps_rts": 0.002, "gyro_bias_dps": 0.1}
    )
    noise = GyroNoise.of(sensor, 0.01)
    assert np.rad2deg(noise.white_radps) == pytest.approx(0.0707, rel=1e-3)
    assert np.rad2deg(noise.wander_radps) == pytest.approx(0.0002)
    assert np.rad2deg(noise.bias_radps) == pytest.approx(0.1)
