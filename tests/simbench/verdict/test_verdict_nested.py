"""Bounds over many scenarios with some runs each: laws, and how often they are wrong."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.seeding import stream
from simbench.verdict.bounds import bounds
from simbench.verdict.nested import SCENARIOS, nested_bounds

ALPHA = 0.05
sides = st.lists(
    st.lists(st.integers(-1000, 1000).map(lambda v: v / 1000), min_size=1, max_size=4).map(np.array),
    min_size=SCENARIOS, max_size=25,
)  # fmt: skip


def drawn(rng: np.random.Generator, mean: float = 0.0, runs: int = 5) -> list[np.ndarray]:
    """20 scenarios of which each shifts all of its runs."""
    between = rng.normal(mean, 0.03, SCENARIOS)
    return [centre + rng.normal(0.0, 0.03, runs) for centre in between]


@given(sides, st.floats(-3, 3), st.floats(0.01, 100))
@settings(max_examples=15, deadline=None)
def test_bounds_move_and_scale_with_the_values(values: list[np.ndarray], shift: float, scale: float) -> None:
    here = nested_bounds(values, stream(0, "test"))
    there = nested_bounds([scale * one + shift for one in values], stream(0, "test"))
    slack = 1e-9 * max(1.0, scale)
    assert there.lower(ALPHA) == pytest.approx(scale * here.lower(ALPHA) + shift, abs=slack)
    assert there.upper(ALPHA) == pytest.approx(scale * here.upper(ALPHA) + shift, abs=slack)


def test_with_one_run_each_the_bounds_are_those_of_as_many_runs() -> None:
    values = stream(0, "one each").normal(0.0, 1.0, 40)
    nested = nested_bounds(list(values[:, None]), stream(0, "a"))
    flat = bounds(values, stream(0, "b"))
    assert flat is not None
    assert nested.lower(ALPHA) == pytest.approx(flat.lower(ALPHA), abs=0.03)
    assert nested.upper(ALPHA) == pytest.approx(flat.upper(ALPHA), abs=0.03)


def test_scenarios_weigh_the_same_whatever_their_runs() -> None:
    values = [np.zeros(1)] * 10 + [np.ones(50)] * 10
    said = nested_bounds(values, stream(0, "weights"))
    assert said.lower(0.49) == pytest.approx(0.5, abs=0.02)


def test_runs_that_are_alike_within_a_scenario_are_not_taken_as_independent() -> None:
    """Of 400 samples without a true difference the lower bound lies above it in 5 %, within 3 SE; with runs
    taken as independent far more often."""
    rng, wrong, naive, trials = stream(0, "calibration"), 0, 0, 400
    for i in range(trials):
        values = drawn(rng)
        flat = bounds(np.concatenate(values), stream(i, "flat"))
        assert flat is not None
        wrong += nested_bounds(values, stream(i, "nested")).lower(ALPHA) > 0.0
        naive += flat.lower(ALPHA) > 0.0
    assert wrong / trials <= ALPHA + 3.0 * np.sqrt(ALPHA * (1.0 - ALPHA) / trials)
    assert naive / trials > 0.12


@pytest.mark.parametrize("values", [[np.zeros(3)] * 19, [np.zeros(3)] * 19 + [np.zeros(0)]])
def test_fewer_scenarios_or_one_without_a_run_are_refused(values: list[np.ndarray]) -> None:
    with pytest.raises(ValueError, match="from 20 on"):
        nested_bounds(values, stream(0, "few"))
