"""Predictions of what was not fitted, against closed forms and against draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from simbench.reproduce.fit.emulate import Emulator, fit_emulator, predict
from simbench.reproduce.fit.infer import Emulated, Observed, infer
from simbench.reproduce.fit.predict import predictive


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


@pytest.fixture(scope="module")
def emulators() -> list[Emulator]:
    gen = rng(1)
    x = gen.random((100, 2))
    y = np.column_stack([0.3 + 0.5 * x[:, 0], np.where(x[:, 0] > 0.5, 1.0, 0.0) * 0.2 + 0.4])
    y += 0.05 * gen.standard_normal((100, 2))
    return [fit_emulator(x, y[:, 0]), fit_emulator(x, y[:, 1])]


def posterior(draws: np.ndarray, keep: int = 2000):
    """Of one fitted number: 0.5 ± 0.1 for the first parameter."""
    cells = Emulated(mean=draws[:, [0]], sd=np.zeros((len(draws), 1)))
    return infer(draws, cells, Observed.of([0.5]), 0.01 * np.eye(1), 0.0, rng(), keep=keep)


def test_of_one_draw_it_is_a_normal_with_all_its_parts(emulators: list[Emulator]) -> None:
    draws = np.array([[0.5, 0.5]])
    printed = Observed.of([0.6, float("nan")], passes=2, frame_sd=[0.2, 0.0], frames=[10, 1])
    first, second = predictive(posterior(draws), emulators, printed, discrepancy_sd=0.03)
    mean, sd = (float(v[0]) for v in predict(emulators[0], draws))
    total = (emulators[0].noise_sd ** 2 / 2 + 0.2**2 / 10 + 0.03**2 + sd**2) ** 0.5
    normal = stats.norm(mean, total)
    assert (first.mean, first.sd) == pytest.approx((mean, total))
    assert (first.p5, first.p50, first.p95) == pytest.approx(normal.ppf([0.05, 0.5, 0.95]).tolist())
    assert first.printed == 0.6 and first.tail_p == pytest.approx(2 * normal.sf(0.6))
    assert second.printed is None and second.tail_p is None and second.mean != mean


def test_it_is_the_spread_of_draws_of_the_posterior_and_their_scatter(emulators: list[Emulator]) -> None:
    draws, gen = rng(2).random((20_000, 2)), rng(3)
    some = posterior(draws, keep=50_000)
    printed = Observed.of([0.4, 0.8])
    found = predictive(some, emulators, printed)
    for k, emulator in enumerate(emulators):
        mean, sd = predict(emulator, draws[some.resampled])
        runs = mean + np.hypot(sd, emulator.noise_sd) * gen.standard_normal(len(mean))
        one = found[k]
        assert (one.mean, one.sd) == pytest.approx((runs.mean(), runs.std()), abs=0.003)
        assert (one.p5, one.p50, one.p95) == pytest.approx(
            np.percentile(runs, [5, 50, 95]).tolist(), abs=0.005
        )
        below = float(np.mean(runs < printed.values[k]))
        assert one.tail_p == pytest.approx(2 * min(below, 1 - below), abs=0.01)


def test_what_carries_no_weight_counts_for_nothing(emulators: list[Emulator]) -> None:
    draws = rng(4).random((500, 2))
    far = np.vstack([draws, np.full((500, 2), 1e3)])
    printed = Observed.of([0.5, 0.5])
    for one, two in zip(
        predictive(posterior(draws), emulators, printed),
        predictive(posterior(far), emulators, printed),
        strict=True,
    ):
        assert (one.p5, one.p50, one.p95, one.tail_p) == pytest.approx((two.p5, two.p50, two.p95, two.tail_p))


def test_what_cannot_be_counts_at_the_limit_of_what_can(emulators: list[Emulator]) -> None:
    some, printed = (
        posterior(rng(2).random((500, 2))),
        Observed.of([0.9, 0.9], frame_sd=[0.9, 0.0], frames=[2, 2]),
    )
    wide, _ = predictive(some, emulators, printed)
    share, _ = predictive(some, emulators, printed, possible=(0.0, 1.0))
    assert wide.p5 < 0.0 and wide.p95 > 1.0
    assert (share.p5, share.p50, share.p95) == (0.0, wide.p50, 1.0)
    assert (share.mean, share.sd, share.tail_p) == (wide.mean, wide.sd, wide.tail_p)


def test_an_emulator_for_every_number() -> None:
    with pytest.raises(ValueError, match="0 emulators for 1"):
        predictive(posterior(np.array([[0.5, 0.5]])), [], Observed.of([0.5]))
