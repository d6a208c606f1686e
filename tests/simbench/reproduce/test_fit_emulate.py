"""Emulators: their gradient, their closed forms against brute force, and what they find of known curves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.reproduce.fit import hyper
from simbench.reproduce.fit.emulate import Emulator, fit_emulator, goodness, left_out, predict, without


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def smooth(x: np.ndarray) -> np.ndarray:
    """A drop that flattens, and a step that is soft: what a share of good points does with levels."""
    return 0.5 * np.exp(-3.0 * x[:, 0]) + 0.3 * np.tanh(3.0 * (x[:, 1] - 0.3))


def example(n: int = 48, d: int = 4, noise: float = 0.03, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    gen = rng(seed)
    x = gen.random((n, d))
    return x, smooth(x) + noise * gen.standard_normal(n)


@pytest.fixture(scope="module")
def fitted() -> Emulator:
    return fit_emulator(*example())


@given(st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_the_gradient_is_that_of_differences(seed: int) -> None:
    gen = rng(seed)
    x, z = gen.random((12, 3)), gen.standard_normal(12)
    at = np.log([0.5, 0.8, 1.2, 0.7, 0.3]) + 0.3 * gen.standard_normal(5)
    _, gradient = hyper.loss(at, x, z)
    steps = 1e-5 * np.eye(5)
    by_difference = [(hyper.loss(at + s, x, z)[0] - hyper.loss(at - s, x, z)[0]) / 2e-5 for s in steps]
    assert gradient == pytest.approx(np.array(by_difference), rel=1e-4, abs=1e-4)


def test_its_posterior_is_that_of_a_normal_density_by_another_program() -> None:
    from scipy.stats import multivariate_normal

    gen = rng(3)
    x, z = gen.random((9, 2)), gen.standard_normal(9)
    at = hyper.Hyper(lengths=np.array([0.4, 0.9]), amplitude=0.8, noise=0.2)
    logs = np.log([0.4, 0.9, 0.8, 0.2])
    density = multivariate_normal(np.zeros(9), hyper.kernel(at, x, x) + 0.04 * np.eye(9)).logpdf(z)
    prior = -0.5 * (np.log(np.array([0.4, 0.9]) / 2**0.5) ** 2).sum() - 0.5 * np.log(0.8 / 0.7) ** 2
    prior -= 0.5 * (np.log(0.2 / 0.3) / 1.5) ** 2
    assert -hyper.loss(logs, x, z)[0] - 4.5 * np.log(2.0 * np.pi) == pytest.approx(density + prior)


def test_left_out_predictions_are_those_of_taking_each_row_away(fitted: Emulator) -> None:
    x, y = example()
    out = left_out(fitted)
    for row in range(0, len(y), 7):
        mean, sd = predict(without(fitted, np.array([row])), x[[row]])
        assert out.mean[row] == pytest.approx(mean[0], abs=1e-9)
        assert out.sd[row] == pytest.approx(np.hypot(sd[0], fitted.noise_sd), rel=1e-7)
        assert out.residual[row] == pytest.approx(y[row] - mean[0], abs=1e-9)


def test_a_prediction_is_the_conditional_of_a_joint_normal(fitted: Emulator) -> None:
    x, y = example()
    new = rng(5).random((3, 4))
    place = (np.vstack([x, new]) - x.min(axis=0)) / np.ptp(x, axis=0)
    joint = hyper.kernel(fitted.hyper, place, place)
    joint[:48, :48] += fitted.hyper.noise**2 * np.eye(48)
    gain = joint[48:, :48] @ np.linalg.inv(joint[:48, :48])
    mean, sd = predict(fitted, new)
    assert mean == pytest.approx(y.mean() + gain @ (y - y.mean()), abs=1e-8)
    left = joint[48:, 48:] - gain @ joint[:48, 48:]
    assert sd == pytest.approx(y.std() * np.sqrt(np.diag(left)), rel=1e-5)


def test_without_noise_it_passes_through_what_it_was_fitted_to() -> None:
    x, y = example(n=60, d=2, noise=0.0)
    emulator = fit_emulator(x, y)
    mean, sd = predict(emulator, x)
    assert emulator.noise_sd < 0.002
    assert np.abs(mean - y).max() < 0.003 and sd.max() < 0.003
    inside = 0.1 + 0.8 * rng(9).random((200, 2))
    assert np.abs(predict(emulator, inside)[0] - smooth(inside)).max() < 0.01


def test_it_finds_the_scatter_of_runs_and_which_inputs_bend() -> None:
    emulator = fit_emulator(*example(n=128, d=5, noise=0.05))
    assert emulator.noise_sd == pytest.approx(0.05, rel=0.25)
    assert emulator.lengths[:2].max() < emulator.lengths[2:].min()
    found = goodness(emulator)
    assert found.n == 128 and found.dropped == 0
    assert 0.045 < found.rmse < 0.07
    assert found.q2 is not None and 0.85 < found.q2 < 0.97
    assert 0.9 < found.within_2sd <= 1.0


def test_sixteen_runs_of_nine_levels_are_few_and_its_doubt_says_so() -> None:
    shares = []
    for seed in range(6):
        emulator = fit_emulator(*example(n=16, d=9, seed=seed))
        new = rng(100 + seed).random((500, 9))
        mean, sd = predict(emulator, new)
        shares.append(np.mean(np.abs(mean - smooth(new)) <= 2.0 * sd))
    assert np.mean(shares) > 0.7, shares


def test_outputs_of_nothing_but_noise_have_no_skill() -> None:
    gen = rng(2)
    found = goodness(fit_emulator(gen.random((40, 3)), gen.standard_normal(40)))
    assert found.q2 is not None and found.q2 < 0.3


@given(st.floats(-50.0, 50.0), st.floats(0.01, 100.0))
@settings(max_examples=5, deadline=None)
def test_units_of_inputs_and_output_do_not_matter(offset: float, unit: float) -> None:
    x, y = example(n=20, d=2)
    new = rng(7).random((5, 2))
    mean, sd = predict(fit_emulator(x, y), new)
    other_mean, other_sd = predict(fit_emulator(unit * x - offset, unit * y + offset), unit * new - offset)
    assert other_mean == pytest.approx(unit * mean + offset, rel=1e-3, abs=1e-3 * unit)
    assert other_sd == pytest.approx(unit * sd, rel=0.02)


def test_a_column_that_does_not_vary_changes_nothing() -> None:
    x, y = example(n=20, d=2)
    more = np.column_stack([x, np.full(20, 3.0)])
    new = rng(7).random((5, 2))
    plain = predict(fit_emulator(x, y), new)
    with_it = predict(fit_emulator(more, y), np.column_stack([new, np.full(5, 8.0)]))
    assert with_it[0] == pytest.approx(plain[0], abs=1e-4)
    assert with_it[1] == pytest.approx(plain[1], rel=0.01)


def test_a_range_wider_than_the_design_adds_doubt_beyond_it() -> None:
    x, y = example(n=20, d=2)
    x[:, 1] *= 0.2
    emulator = fit_emulator(x, y, low=np.zeros(2), high=np.ones(2))
    _, sd = predict(emulator, np.array([[0.5, 0.1], [0.5, 0.9]]))
    assert sd[1] > 3.0 * sd[0]


def test_an_output_that_never_varies_is_predicted_as_it_is() -> None:
    emulator = fit_emulator(rng().random((16, 9)), np.ones(16))
    mean, sd = predict(emulator, rng(1).random((50, 9)))
    assert mean == pytest.approx(np.ones(50)) and sd.max() < 0.02
    assert goodness(emulator).q2 is None


def test_rows_without_an_output_are_dropped_and_counted() -> None:
    x, y = example(n=24, d=2)
    holes = y.copy()
    holes[[3, 17]] = np.nan
    emulator = fit_emulator(x, holes, low=x.min(axis=0), high=x.max(axis=0))
    stay = np.delete(np.arange(24), [3, 17])
    other = fit_emulator(x[stay], y[stay], low=x.min(axis=0), high=x.max(axis=0))
    assert emulator.dropped == 2 and goodness(emulator).dropped == 2
    assert emulator.kept.tolist() == stay.tolist()
    assert predict(emulator, x)[0] == pytest.approx(predict(other, x)[0])
    assert without(emulator, np.array([0, 3])).kept.tolist() == stay[1:].tolist()


def test_the_same_design_gives_the_same_emulator() -> None:
    first, second = fit_emulator(*example()), fit_emulator(*example())
    assert np.array_equal(first.alpha, second.alpha)


@pytest.mark.parametrize(
    ("inputs", "outputs", "words"),
    [
        (np.zeros((5, 2)), np.array([1.0, 2.0, 3.0, np.nan, np.inf]), "3 finite outputs"),
        (np.full((5, 2), np.nan), np.zeros(5), "not finite"),
    ],
)
def test_what_cannot_be_fitted_is_refused(inputs: np.ndarray, outputs: np.ndarray, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        fit_emulator(inputs, outputs)
    with pytest.raises(ValueError, match="no row would be left"):
        without(fit_emulator(*example(n=8, d=2)), np.arange(8))


def test_with_many_inputs_the_scatter_of_runs_is_not_taken_for_bends() -> None:
    found = [fit_emulator(*example(n=64, d=9, noise=0.05, seed=seed)).noise_sd for seed in range(6)]
    assert np.mean(found) == pytest.approx(0.05, rel=0.15), found
