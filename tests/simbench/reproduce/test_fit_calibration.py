"""Calibration: ranks are uniform on synthetic truths, and are not once scatter is stated wrongly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from simbench.reproduce.fit.calibration_check import Calibration, calibrate, coverage, holm, uniform_p
from simbench.reproduce.fit.emulate import Emulator, fit_emulator
from simbench.reproduce.fit.infer import run_covariance


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def bench(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Three levels, the third a switch; two outputs of a run, bent by the levels."""
    gen = rng(seed)
    x = np.column_stack([gen.random(n), gen.random(n), gen.integers(0, 2, n).astype(float)])
    first = 0.8 - 0.6 * x[:, 0] ** 1.5 - 0.1 * x[:, 2]
    second = 0.7 * np.exp(-2.0 * x[:, 1]) - 0.2 * x[:, 0] * x[:, 2]
    return x, np.column_stack([first, second]) + 0.05 * gen.standard_normal((n, 2))


@pytest.fixture(scope="module")
def made() -> tuple[np.ndarray, np.ndarray, np.ndarray, list[Emulator]]:
    x, y = bench(200, 1)
    return x, y, bench(3000, 2)[0], [fit_emulator(x, column) for column in y.T]


def checked(made: tuple[np.ndarray, np.ndarray, np.ndarray, list[Emulator]], factor: float) -> Calibration:
    """With the noise's SD stated as a multiple of the true one."""
    x, y, draws, emulators = made
    covariance = factor**2 * run_covariance(emulators, independent=True)
    return calibrate(x, y, draws, rng(3), emulators=emulators, run_cov=covariance)


def test_a_sound_fit_passes(made: tuple[np.ndarray, np.ndarray, np.ndarray, list[Emulator]]) -> None:
    found = checked(made, 1.0)
    assert found.passed and found.holm_p.min() > 0.05, found.holm_p
    assert (found.truths, found.dropped, found.bins, found.of) == (200, 0, 20, 99)
    assert found.ranks.shape == (200, 4) and found.ranks.min() >= 0 and found.ranks.max() <= 99
    for level in found.coverage:
        chance = (level.nominal * (1.0 - level.nominal) / 200) ** 0.5
        assert level.share == pytest.approx(np.full(3, level.nominal), abs=3.0 * chance)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_noise_that_is_stated_wrongly_fails(
    made: tuple[np.ndarray, np.ndarray, np.ndarray, list[Emulator]], factor: float
) -> None:
    found = checked(made, factor)
    assert not found.passed
    assert found.holm_p[-1] < 0.001, "the log likelihood"
    if factor < 1.0:
        assert found.coverage[1].high[0] < 0.9, "intervals that are too narrow miss"
    else:
        assert found.coverage[0].low[0] > 0.5, "intervals that are too wide hold too much"


def test_means_that_are_off_fail(made: tuple[np.ndarray, np.ndarray, np.ndarray, list[Emulator]]) -> None:
    x, y, draws, emulators = made
    found = calibrate(x, y + np.array([0.0, 0.08]), draws, rng(3), emulators=emulators)
    assert not found.passed and found.holm_p[1] < 0.01


def test_sixteen_truths_are_said_to_be_few_and_rows_with_holes_are_counted() -> None:
    x, y = bench(18, 4)
    y[[2, 7], [0, 1]] = np.nan
    draws = bench(1500, 5)[0]
    found = calibrate(x, y, draws, rng(6))
    assert (found.truths, found.dropped, found.bins) == (16, 2, 4)
    assert found.why is not None and "16 truths are few" in found.why
    again = calibrate(x, y, draws, rng(6))
    assert np.array_equal(found.ranks, again.ranks)


def test_posteriors_of_few_draws_are_counted() -> None:
    x, y = bench(100, 4)
    found = calibrate(x, y, bench(60, 5)[0], rng(6))
    assert found.poor == 100 and found.why == "100 of 100 posteriors have fewer than 100 effective draws"


def test_a_truth_outside_all_draws_ranks_last_and_ties_fall_anywhere() -> None:
    """A column that is the same in all draws and the truth ties everywhere: its ranks are uniform."""
    x, y = bench(100, 7)
    draws = bench(800, 8)[0]
    draws[:, 0] *= 1e-6
    x[:, 2], draws[:, 2] = 1.0, 1.0
    found = calibrate(x, y, draws, rng(9))
    assert found.ranks[:, 0].min() == 99
    assert found.p[2] > 0.01 and found.ranks[:, 2].std() > 20


def test_uniform_p_is_that_of_another_program() -> None:
    ranks = rng(1).integers(0, 100, (90, 3))
    counts = [np.histogram(column, bins=10, range=(0, 100))[0] for column in ranks.T]
    assert uniform_p(ranks, 99, 10) == pytest.approx([stats.chisquare(c).pvalue for c in counts])


def test_uniform_ranks_pass_about_as_often_as_they_should() -> None:
    gen = rng(2)
    p = uniform_p(gen.integers(0, 100, (100, 400)), 99, 20)
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.03)


def test_holm_by_hand() -> None:
    assert holm(np.array([0.04, 0.01, 0.03])) == pytest.approx([0.06, 0.03, 0.06])
    assert holm(np.array([0.5, 0.9])).tolist() == [1.0, 1.0]


def test_coverage_is_a_share_with_a_binomial_interval() -> None:
    ranks = np.array([[0, 50], [24, 50], [25, 50], [74, 50], [75, 50], [99, 50]])
    half = coverage(ranks, 99, 0.5)
    assert half.share.tolist() == [2 / 6, 1.0]
    exact = stats.binomtest(2, 6).proportion_ci(0.95, "exact")
    assert (half.low[0], half.high[0]) == pytest.approx((exact.low, exact.high))
    assert half.high[1] == 1.0 and half.low[1] == pytest.approx(0.025 ** (1 / 6))
    wide = coverage(ranks, 99, 0.9)
    assert wide.share.tolist() == [4 / 6, 1.0]
    none = coverage(np.zeros((6, 1), dtype=np.int64), 99, 0.9)
    assert none.low[0] == 0.0 and none.high[0] == pytest.approx(1 - 0.025 ** (1 / 6))


def test_a_design_without_a_whole_row_is_refused() -> None:
    x, y = bench(8, 1)
    y[::2, 0], y[1::2, 1] = np.nan, np.nan
    with pytest.raises(ValueError, match="no row"):
        calibrate(x, y, x, rng())
