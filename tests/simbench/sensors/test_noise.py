"""Quick normal numbers against the distribution itself, quick uniform ones against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from simbench.sensors.noise import standard_normal, standard_uniform


def numbers(seed: int = 0, count: int = 400_000) -> np.ndarray:
    return standard_normal(np.random.default_rng(seed), (count,)).astype(np.float64)


def test_they_follow_the_normal_distribution() -> None:
    drawn = numbers()
    assert stats.kstest(drawn, "norm").pvalue > 0.01
    assert drawn.mean() == pytest.approx(0.0, abs=4.0 / np.sqrt(len(drawn)))
    assert drawn.std() == pytest.approx(1.0, abs=4.0 / np.sqrt(2 * len(drawn)))
    assert stats.kurtosis(drawn) == pytest.approx(0.0, abs=4.0 * np.sqrt(24 / len(drawn)))


def test_both_tails_are_there_up_to_four_standard_deviations() -> None:
    drawn = numbers(count=4_000_000)
    for tail in (drawn > 3.0, drawn < -3.0):
        assert tail.mean() == pytest.approx(stats.norm.sf(3.0), rel=0.06)
    assert 4.2 < drawn.max() < 4.4
    assert -4.4 < drawn.min() < -4.2


def test_neighbours_are_independent() -> None:
    drawn = numbers()
    for lag in (1, 2, 3, 4):
        assert abs(np.corrcoef(drawn[:-lag], drawn[lag:])[0, 1]) < 4.0 / np.sqrt(len(drawn))


def test_the_same_seed_gives_the_same_numbers_in_any_shape() -> None:
    flat = standard_normal(np.random.default_rng(3), (30,))
    assert np.array_equal(flat.reshape(2, 3, 5), standard_normal(np.random.default_rng(3), (2, 3, 5)))
    assert not np.array_equal(flat, standard_normal(np.random.default_rng(4), (30,)))


@pytest.mark.parametrize("shape", [(0,), (1,), (7,), (3, 64, 5)])
def test_uniform_numbers_are_those_of_numpy(shape: tuple[int, ...]) -> None:
    theirs = np.random.default_rng(5).random(shape, dtype=np.float32)
    ours = standard_uniform(np.random.default_rng(5), shape)
    assert ours.dtype == np.float32 and np.array_equal(ours, theirs)
