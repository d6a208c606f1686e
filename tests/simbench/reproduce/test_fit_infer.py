"""The posterior against closed forms of the linear normal model, and the sentences about it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.reproduce.fit.describe import (
    fitting,
    posterior_correlations,
    posterior_covariance,
    posterior_means,
    posterior_quantiles,
    prior_share,
)
from simbench.reproduce.fit.emulate import fit_emulator
from simbench.reproduce.fit.infer import (
    Emulated,
    Observed,
    Posterior,
    common_covariance,
    emulated,
    infer,
    resample,
    run_covariance,
    spread,
)

A = np.array([[1.0, 0.5], [-0.3, 0.8], [0.2, 0.1]])
B = np.array([0.1, -0.2, 0.3])
RUN = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.02], [0.0, 0.02, 0.05]])
Y = np.array([0.8, 0.1, 0.6])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def linear(draws: np.ndarray, sd: float = 0.0) -> Emulated:
    mean = draws @ A.T + B
    return Emulated(mean=mean, sd=np.full(mean.shape, sd))


def test_sigma_is_the_sum_of_its_parts_and_only_runs_are_shared_by_passes() -> None:
    """Row by hand: 0.04/2 + 0.3²/9 + 0.1² = 0.04 and with an emulator SD of 0.3, 0.13."""
    observed = Observed.of([0.0, 0.0, 0.0], passes=2, frame_sd=[0.3, 0.0, 0.0], frames=[9, 1, 1])
    common = common_covariance(observed, RUN, 0.1)
    assert common[0] == pytest.approx([0.04, 0.005, 0.0])
    assert common[1, 1] == pytest.approx(0.045 + 0.01)
    by_cell = common_covariance(observed, RUN, np.array([0.0, 0.2, 0.0]))
    assert np.diag(by_cell) == pytest.approx([0.03, 0.085, 0.025])
    assert spread(linear(np.zeros((1, 2)), 0.3), observed, RUN, 0.1)[0, 0] == pytest.approx(0.13**0.5)


def test_under_a_wide_prior_it_is_the_least_squares_posterior() -> None:
    draws = rng(1).uniform(-4.0, 4.0, (200_000, 2))
    sigma = RUN / 2 + 0.05**2 * np.eye(3) + 0.1**2 * np.eye(3)
    information = A.T @ np.linalg.inv(sigma) @ A
    covariance = np.linalg.inv(information)
    mean = covariance @ A.T @ np.linalg.inv(sigma) @ (Y - B)
    found = infer(draws, linear(draws, 0.1), Observed.of(Y.tolist(), passes=2), RUN, 0.05, rng())
    assert found.why is None and found.ess > 1500
    error = np.sqrt(np.diag(covariance) / found.ess)
    assert np.all(np.abs(posterior_means(found) - mean) < 4.0 * error)
    assert posterior_covariance(found) == pytest.approx(covariance, rel=0.08, abs=0.002)
    expected = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert posterior_correlations(found)[0, 1] == pytest.approx(expected, abs=0.04)
    low, high = posterior_quantiles(found, [0.05, 0.95])
    assert high - low == pytest.approx(2 * 1.6449 * np.sqrt(np.diag(covariance)), rel=0.05)
    assert draws[found.resampled].mean(axis=0) == pytest.approx(posterior_means(found), abs=0.01)


def test_under_a_normal_prior_it_is_the_conjugate_posterior_and_its_evidence() -> None:
    from scipy.stats import multivariate_normal

    draws = rng(2).standard_normal((100_000, 2))
    information = A.T @ np.linalg.inv(RUN) @ A + np.eye(2)
    mean = np.linalg.solve(information, A.T @ np.linalg.inv(RUN) @ (Y - B))
    found = infer(draws, linear(draws), Observed.of(Y.tolist()), RUN, 0.0, rng())
    sd = np.sqrt(np.diag(np.linalg.inv(information)))
    assert np.all(np.abs(posterior_means(found) - mean) < 4.0 * sd / found.ess**0.5)
    evidence = multivariate_normal(B, RUN + A @ A.T).logpdf(Y)
    assert found.log_evidence == pytest.approx(evidence, abs=0.03)


def test_runs_of_a_linear_bench_lead_to_the_posterior_of_its_true_means() -> None:
    gen = rng(3)
    design, draws = gen.random((96, 2)), gen.random((20_000, 2))
    noise = np.linalg.cholesky(RUN) @ gen.standard_normal((3, 96)) * 0.1
    outputs = design @ A.T + B + noise.T
    emulators = [fit_emulator(design, column) for column in outputs.T]
    covariance = run_covariance(emulators, independent=False)
    assert covariance == pytest.approx(0.01 * RUN, abs=0.0003)
    data = Observed.of((A @ [0.6, 0.4] + B).tolist())
    found = infer(draws, emulated(emulators, draws), data, covariance, 0.0, rng())
    exact = infer(draws, linear(draws), data, 0.01 * RUN, 0.0, rng())
    assert posterior_means(found) == pytest.approx(posterior_means(exact), abs=0.02)
    spreads = [np.sqrt(np.diag(posterior_covariance(p))) for p in (found, exact)]
    assert spreads[0] == pytest.approx(spreads[1], rel=0.25)


def test_drives_of_their_own_have_no_covariance() -> None:
    gen = rng(4)
    x = gen.random((30, 2))
    shared = gen.standard_normal(30)
    emulators = [fit_emulator(x, x[:, 0] + 0.1 * shared), fit_emulator(x, x[:, 1] + 0.2 * shared)]
    apart = run_covariance(emulators, independent=True)
    assert np.diag(apart) == pytest.approx([e.noise_sd**2 for e in emulators]) and apart[0, 1] == 0.0
    joined = run_covariance(emulators, independent=False)
    assert joined[0, 1] / np.sqrt(joined[0, 0] * joined[1, 1]) > 0.8
    assert np.linalg.eigvalsh(joined).min() > 0.0
    assert np.diag(joined) == pytest.approx(np.diag(apart))


def test_outputs_that_lack_different_runs_are_matched_by_row() -> None:
    gen = rng(5)
    x = gen.random((40, 1))
    shared = gen.standard_normal(40)
    first, second = 0.1 * shared.copy(), 0.1 * shared.copy()
    first[[0, 1, 2]], second[[20, 30]] = np.nan, np.nan
    joined = run_covariance([fit_emulator(x, first), fit_emulator(x, second)], independent=False)
    assert joined[0, 1] / np.sqrt(joined[0, 0] * joined[1, 1]) > 0.9


@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=30), st.integers(1, 300), st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_systematic_resampling_keeps_every_row_as_often_as_its_weight(
    raw: list[float], count: int, seed: int
) -> None:
    weights = np.array(raw) + 1e-6
    weights /= weights.sum()
    times = np.bincount(resample(weights, count, rng(seed)), minlength=len(weights))
    assert times.sum() == count
    assert np.all(np.abs(times - count * weights) < 1.0 + 1e-6)


def posterior(weights: list[float], draws: list[list[float]]) -> Posterior:
    w = np.array(weights) / np.sum(weights)
    return Posterior(
        draws=np.array(draws), weights=w, log_likelihood=np.log(w), distance2=np.arange(float(len(w))) * 3.0,
        ess=float(1.0 / (w**2).sum()), log_evidence=0.0, resampled=np.arange(len(w)), cells=2, why=None,
    )  # fmt: skip


def test_quantiles_means_and_shares_by_hand() -> None:
    some = posterior([1.0, 6.0, 2.0, 1.0], [[1.0, 0.0], [2.0, 1.0], [3.0, 0.0], [9.0, 1.0]])
    assert posterior_quantiles(some, [0.05, 0.1, 0.5, 0.9, 0.95])[:, 0].tolist() == [1.0, 1.0, 2.0, 3.0, 9.0]
    assert posterior_quantiles(some, [0.3, 0.31])[:, 1].tolist() == [0.0, 1.0]
    assert posterior_means(some) == pytest.approx([2.8, 0.7])
    assert prior_share(some, 0.6) == 0.25 and prior_share(some, 0.8) == 0.5 and prior_share(some, 1.0) == 1.0
    # chi-square of two cells: 5.99
    assert fitting(some).tolist() == [True, True, False, False]


def test_a_column_that_does_not_vary_has_no_correlation() -> None:
    some = posterior([1.0, 2.0, 1.0], [[1.0, 5.0], [2.0, 5.0], [3.0, 5.0]])
    found = posterior_correlations(some)
    assert found[0, 0] == pytest.approx(1.0) and np.isnan(found[0, 1]) and np.isnan(found[1, 1])


def test_data_that_say_nothing_leave_the_prior() -> None:
    draws = rng(6).random((5000, 2))
    found = infer(draws, linear(draws), Observed.of(Y.tolist()), RUN, 1e4, rng())
    assert found.ess == pytest.approx(5000, rel=1e-6)
    assert prior_share(found) == pytest.approx(0.95, abs=0.001)
    assert fitting(found).all()


def test_few_effective_draws_are_said() -> None:
    draws = rng(7).random((400, 2))
    found = infer(draws, linear(draws), Observed.of([9.0, 9.0, 9.0]), 1e-4 * RUN, 0.0, rng())
    assert found.ess < 5 and found.why is not None and "draws carry the posterior" in found.why
    assert np.isfinite(found.log_evidence) and found.weights.sum() == pytest.approx(1.0)
    assert not fitting(found).any()


def test_the_set_that_fits_holds_the_truth_as_often_as_it_says() -> None:
    gen, inside = rng(8), []
    draws = gen.random((400, 2))
    for truth in range(400):
        y = A @ draws[truth] + B + np.linalg.cholesky(RUN) @ gen.standard_normal(3)
        found = infer(draws, linear(draws), Observed.of(y.tolist()), RUN, 0.0, gen)
        inside.append(fitting(found)[truth])
    assert np.mean(inside) == pytest.approx(0.95, abs=0.035)


def test_a_seed_gives_the_same_posterior() -> None:
    draws = rng(9).random((300, 2))
    one, two = (infer(draws, linear(draws), Observed.of(Y.tolist()), RUN, 0.1, rng(4)) for _ in range(2))
    assert np.array_equal(one.resampled, two.resampled) and np.array_equal(one.weights, two.weights)


def test_what_cannot_be_weighed_is_refused() -> None:
    draws = rng().random((10, 2))
    with pytest.raises(ValueError, match="not finite"):
        infer(draws, linear(draws), Observed.of([0.1, float("nan"), 0.2]), RUN, 0.1, rng())
    with pytest.raises(ValueError, match="need a discrepancy"):
        infer(draws, linear(draws), Observed.of(Y.tolist()), np.zeros((3, 3)), 0.0, rng())
    with pytest.raises(ValueError, match="at least 1"):
        Observed.of([0.1], passes=0)
    with pytest.raises(ValueError, match="number of frames"):
        Observed.of([0.1], frame_sd=[0.2])
    with pytest.raises(ValueError, match="2 values, 1 frame SDs"):
        Observed.of([0.1, 0.2], frame_sd=[0.2], frames=[3, 3])
