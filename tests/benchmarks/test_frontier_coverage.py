"""A frontier's bound holds what it promises, on fewer trials than the benchmark's 2,000."""

from __future__ import annotations

import pytest
from scipy.special import bdtr

from simbench.frontier.curve import Functional
from tests.benchmarks.frontier import row_of
from tests.benchmarks.frontier_trials import CURVES, truth

EACH = 40


@pytest.mark.parametrize(("functional", "runs"), [("mean", 20), ("share", 40)])
def test_the_bound_lies_below_the_truth_as_often_as_promised(functional: Functional, runs: int) -> None:
    """At 120 trials of the curves that cross: as many misses or more would come once in 1,000 times."""
    rows = [row_of(curve, functional, runs, EACH, grids=()) for curve in CURVES if curve != "never crosses"]
    trials, held = len(rows) * EACH, sum(row.bound for row in rows)
    assert bdtr(held, trials, 0.95) > 1e-3, f"{held} of {trials}"
    assert held < trials, "a bound that never misses is too low"
    assert all(row.levels <= 16 for row in rows)


@pytest.mark.parametrize("functional", ["mean", "share"])
def test_the_true_crossings_are_where_the_curves_say(functional: Functional) -> None:
    found = truth("monotone", functional)
    assert found == pytest.approx({"mean": 0.6325, "share": 0.4962}[functional], abs=1e-3)
    assert truth("never crosses", functional) is None
