"""One cause alone: its curve, its band, and the stretches that fit."""

from __future__ import annotations

import numpy as np
import pytest

from simbench.reproduce.fit.emulate import Emulator, fit_emulator, predict
from simbench.reproduce.fit.infer import Observed
from simbench.reproduce.fit.single import alone, grids, stretches

REFERENCE = np.array([0.0, 0.0, 0.0])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


@pytest.fixture(scope="module")
def emulators() -> list[Emulator]:
    """A parabola of the first level, a switch in the third column; the second does nothing."""
    gen = rng(1)
    x = np.column_stack([4.0 * gen.random(80), gen.random(80), gen.integers(0, 2, 80).astype(float)])
    noise = 0.01 * gen.standard_normal((80, 2))
    first = 0.2 + 0.15 * (x[:, 0] - 2.0) ** 2 - 0.3 * x[:, 2] + noise[:, 0]
    return [fit_emulator(x, first), fit_emulator(x, 0.9 - 0.1 * x[:, 0] + noise[:, 1])]


def test_a_curve_is_the_emulator_with_all_others_at_the_reference(emulators: list[Emulator]) -> None:
    levels = (np.linspace(0.0, 4.0, 9), np.linspace(0.0, 1.0, 3), np.array([0.0, 1.0]))
    found = alone(emulators, Observed.of([0.35, 0.6]), 1e-4 * np.eye(2), 0.05, REFERENCE, levels)
    assert [one.parameter for one in found] == [0, 1, 2]
    mean, sd = predict(emulators[1], np.array([[1.5, 0.0, 0.0]]))
    assert (found[0].mean[3, 1], found[0].sd[3, 1]) == pytest.approx((mean[0], sd[0]), rel=1e-6)
    assert found[0].spread[3, 1] == pytest.approx((1e-4 + 0.05**2 + sd[0] ** 2) ** 0.5)
    assert found[0].mean[:, 0] == pytest.approx(0.2 + 0.15 * (levels[0] - 2.0) ** 2, abs=0.04)


def test_a_curve_that_comes_back_fits_in_two_stretches(emulators: list[Emulator]) -> None:
    levels = grids(np.column_stack([np.linspace(0, 4, 50), np.linspace(0, 1, 50), np.arange(50) % 2.0]), 401)
    first, second, switch = alone(
        emulators, Observed.of([0.35, 0.6]), 1e-4 * np.eye(2), 0.0, REFERENCE, levels
    )
    (a, b), (c, d) = first.fits[0]
    assert a < 1.0 < b < 2.0 < c < 3.0 < d and b - a < 0.35 and d - c < 0.35  # 0.2 + 0.15 = 0.35 at 1 and 3
    ((e, f),) = first.fits[1]
    assert e < 3.0 < f and f - e < 1.0
    ((g, h),) = first.together
    assert c - 0.1 < g < 3.0 < h < d + 0.1
    assert second.fits == ((), ()) and second.together == ()
    # with the switch on, cell 1 is 0.8 - 0.3
    other = alone(emulators, Observed.of([0.5, 0.9]), 1e-4 * np.eye(2), 0.0, REFERENCE, levels)[2]
    assert other.fits[0] == ((1.0, 1.0),) and other.fits[1] == ((0.0, 1.0),)
    assert switch.levels.tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ([0, 0, 0, 0], ()),
        ([1, 1, 1, 1], ((1.0, 8.0),)),
        ([1, 0, 1, 1], ((1.0, 1.0), (4.0, 8.0))),
        ([0, 1, 0, 0], ((2.0, 2.0),)),
    ],
)
def test_stretches_by_hand(inside: list[int], expected: tuple[tuple[float, float], ...]) -> None:
    assert stretches(np.array([1.0, 2.0, 4.0, 8.0]), np.array(inside, dtype=bool)) == expected


def test_grids_span_the_prior_and_leave_switches_switches() -> None:
    draws = np.column_stack([[0.5, 3.5, 1.0], [0.0, 1.0, 1.0], [0.0, 0.4, 1.0]])
    found = grids(draws, 4)
    assert found[0].tolist() == [0.5, 1.5, 2.5, 3.5]
    assert found[1].tolist() == [0.0, 1.0] and len(found[2]) == 4
