"""The scripted shake: its closed form, its size, its independence."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.shake import Shake, draw_shake

S = 1_000_000_000
FREQUENCY = np.geomspace(0.4, 20.0, 48)


def drawn(seed: int, rms: list[float], duration_s: float) -> Shake:
    density = np.tile(1.0 / (1.0 + (FREQUENCY - 2.0) ** 2), (len(rms), 1))
    return draw_shake(np.random.default_rng(seed), FREQUENCY, density, np.array(rms), duration_s)


def detrended_rms(value: np.ndarray) -> np.ndarray:
    """About the least-squares line, by the normal equations of a centred time."""
    t = np.arange(len(value)) - 0.5 * (len(value) - 1)
    centred = value - value.mean(axis=0)
    slope = t @ centred / (t @ t)
    return np.asarray(np.sqrt(np.mean((centred - t[:, None] * slope) ** 2, axis=0)))


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**31),
    rms=st.lists(st.floats(1e-4, 0.1), min_size=1, max_size=4),
    duration_s=st.floats(1.0, 12.0),
)
def test_the_realised_rms_is_the_request(seed: int, rms: list[float], duration_s: float) -> None:
    shake = drawn(seed, rms, duration_s)
    t_ns = np.arange(0, int(duration_s * S), 700_000, dtype=np.int64)  # not the step that scaled it
    np.testing.assert_allclose(detrended_rms(shake.at(t_ns)), rms, rtol=0.01)


def test_the_value_is_the_sum_of_its_sinusoids() -> None:
    shake = drawn(3, [0.01, 0.02, 0.03], 5.0)
    t_ns = np.array([-123_456_789, 0, 1, 2_500_000_001, 60 * S], dtype=np.int64)
    for i, t in enumerate(t_ns):
        for axis in range(3):
            total = sum(
                shake.amplitude[axis, k]
                * np.sin(2.0 * np.pi * shake.frequency_hz[k] * (int(t) / S) + shake.phase_rad[axis, k])
                for k in range(len(FREQUENCY))
            )
            assert shake.at(t_ns)[i, axis] == pytest.approx(total, abs=1e-12)


def test_one_instant_has_one_value_however_many_are_asked() -> None:
    shake = drawn(4, [0.01, 0.02], 5.0)
    t_ns = np.arange(0, 2 * S, 97_656_2, dtype=np.int64)
    alone = np.concatenate([shake.at(t_ns[i : i + 1]) for i in range(0, len(t_ns), 97)])
    np.testing.assert_allclose(shake.at(t_ns)[::97], alone, rtol=0, atol=1e-15)


def test_a_straight_line_does_not_count_as_shake() -> None:
    """A quarter of a slow sinusoid is nearly a line: what is left of it is small."""
    slow = Shake(frequency_hz=np.array([0.01]), amplitude=np.ones((1, 1)), phase_rad=np.zeros((1, 1)))
    assert slow.rms(5.0)[0] < 0.01 * np.std(slow.at(np.arange(0, 5 * S, S // 100, dtype=np.int64)))


def test_rms_and_rate_of_one_sinusoid_follow_the_closed_form() -> None:
    one = Shake(frequency_hz=np.array([4.0]), amplitude=np.array([[0.2]]), phase_rad=np.array([[0.3]]))
    assert one.rms(10.0)[0] == pytest.approx(0.2 / np.sqrt(2.0), rel=2e-3)
    assert one.rate_rms(10.0)[0] == pytest.approx(0.2 / np.sqrt(2.0) * 2.0 * np.pi * 4.0, rel=2e-3)


def test_axes_are_independent_and_so_are_seeds() -> None:
    t_ns = np.arange(0, 8 * S, 10_000_000, dtype=np.int64)
    correlations = []
    for seed in range(24):
        value = drawn(seed, [0.01] * 4, 8.0).at(t_ns)
        other = drawn(1000 + seed, [0.01], 8.0).at(t_ns)
        correlations.append(np.corrcoef(np.column_stack([value, other]).T)[np.triu_indices(5, 1)])
    mean = np.mean(correlations, axis=0)
    spread = np.std(correlations, axis=0) / np.sqrt(len(correlations))
    assert np.all(np.abs(mean) < 4.0 * spread)
    assert np.abs(correlations).mean() < 0.2


def test_an_axis_that_is_not_asked_for_stands_still() -> None:
    assert not drawn(1, [0.0, 0.01], 5.0).at(np.arange(0, S, 1000_000, dtype=np.int64))[:, 0].any()


def test_power_lies_where_the_density_asks_for_it() -> None:
    density = np.where((FREQUENCY > 4.0) & (FREQUENCY < 6.0), 1.0, 0.0)[None]
    shake = draw_shake(np.random.default_rng(0), FREQUENCY, density, np.array([0.01]), 10.0)
    value = shake.at(np.arange(0, 10 * S, 5_000_000, dtype=np.int64))[:, 0]
    power = np.abs(np.fft.rfft(value * np.hanning(len(value)))) ** 2
    frequency = np.fft.rfftfreq(len(value), 0.005)
    inside = (frequency > 3.7) & (frequency < 6.3)
    assert power[inside].sum() > 0.999 * power.sum()


def test_the_same_generator_draws_the_same_shake() -> None:
    a, b = drawn(9, [0.01, 0.02], 5.0), drawn(9, [0.01, 0.02], 5.0)
    assert np.array_equal(a.amplitude, b.amplitude)
    assert np.array_equal(a.phase_rad, b.phase_rad)
