"""Straight lines through a design: what is known beforehand comes back, and intervals cover what they say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.reproduce.cells import BASELINE, METHOD
from simbench.reproduce.levels import LEVELS
from simbench.reproduce.slopes import slopes, straight
from tests.simbench.reproduce.made_up import LOSS, SMALL, made_up


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def test_what_lies_on_a_line_gives_the_line_without_doubt() -> None:
    x = rng().random((20, 2))
    line = straight(x, 3.0 - 2.0 * x[:, 0] + 0.5 * x[:, 1], tests=2)
    assert line.at == pytest.approx([3.0, -2.0, 0.5])
    assert line.half == pytest.approx(0.0, abs=1e-9) and line.r2 == pytest.approx(1.0)


def test_three_rows_by_hand() -> None:
    """x = 0, 1, 2; y = 0, 1, 0.5: slope 0.25, intercept 0.25; off the line by -0.25, 0.5, -0.25; leverage
    5/6, 1/3, 5/6. HC3 variance of the slope: (1.5 ** 2 + 0 + 1.5 ** 2) / 4 = 1.125. Student's t: 12.71."""
    line = straight(np.array([[0.0], [1.0], [2.0]]), np.array([0.0, 1.0, 0.5]), tests=1)
    assert line.at == pytest.approx([0.25, 0.25])
    assert line.half[1] == pytest.approx(12.7062 * 1.125**0.5, rel=1e-4)


@given(shift=st.floats(-5, 5), scale=st.floats(0.1, 10), seed=st.integers(0, 99))
@settings(max_examples=30, deadline=None)
def test_another_unit_of_what_is_measured_changes_the_unit_only(
    shift: float, scale: float, seed: int
) -> None:
    x, noise = rng(seed).random((30, 3)), rng(seed + 1).normal(size=30)
    y = x @ np.array([1.0, 0.0, -1.0]) + noise
    one, two = straight(x, y, tests=3), straight(x, shift + scale * y, tests=3)
    assert two.at[1:] == pytest.approx(scale * one.at[1:], abs=1e-9)
    assert two.half[1:] == pytest.approx(scale * one.half[1:]) and two.r2 == pytest.approx(one.r2)


def test_intervals_hold_together_as_often_as_they_say_where_scatter_is_unequal() -> None:
    """The scatter grows fivefold along the first cause: plain least squares would promise too much there."""
    x = rng(1).random((128, 9))
    truth, draws = np.linspace(-0.1, 0.1, 9), rng(2)
    held = 0
    for _ in range(400):
        y = 0.5 + x @ truth + draws.normal(size=128) * 0.02 * (1.0 + 4.0 * x[:, 0])
        line = straight(x, y, tests=9)
        held += bool((np.abs(line.at[1:] - truth) <= line.half[1:]).all())
    assert 0.92 <= held / 400 <= 0.99


def test_too_few_runs_are_no_line() -> None:
    with pytest.raises(ValueError, match="3 runs for 3 numbers"):
        straight(rng().random((3, 2)), np.zeros(3), tests=1)


def test_causes_that_cost_alike_are_said_to_cost_alike() -> None:
    """Made-up runs lose by the mean of all levels in shares of their bounds."""
    found = slopes(made_up().part("fit"))
    for one in found:
        if one.metric == "tpr" and one.pipeline in (BASELINE, METHOD):
            each = -LOSS[one.pipeline] / len(LEVELS[one.cell.split()[0]])
            assert one.n == SMALL.fit_points
            for slope in one.causes:
                assert slope.ci[0] <= each <= slope.ci[1], (one.cell, one.pipeline, slope)
