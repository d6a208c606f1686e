"""Bounds of a mean difference: laws of shift, scale and mirror; p-values that agree; Student by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from scenarios.seeding import stream
from simbench.verdict.bounds import Bounds, bounds, candidates, draw_counts

numbers = st.integers(-1000, 1000).map(lambda v: v / 1000)
samples = st.sampled_from([6, 12, 19, 20, 25, 40]).flatmap(
    lambda n: st.lists(numbers, min_size=n, max_size=n).map(np.array)
)
few_differ = st.sampled_from([12, 20, 40]).flatmap(
    lambda n: st.lists(st.sampled_from([0.0] * 9 + [-0.5]), min_size=n, max_size=n).map(np.array)
)
alphas = st.sampled_from([0.0177, 0.0185, 0.0276, 0.05, 0.1, 0.3])


def of(values: np.ndarray) -> Bounds:
    said = bounds(np.asarray(values, dtype=np.float64), stream(0, "test"))
    assert said is not None
    return said


@given(samples | few_differ, st.floats(-3, 3), alphas)
@settings(max_examples=40)
def test_bounds_move_with_the_values(values: np.ndarray, shift: float, alpha: float) -> None:
    here, there = of(values), of(values + shift)
    assert there.lower(alpha) == pytest.approx(here.lower(alpha) + shift, abs=1e-9)
    assert there.upper(alpha) == pytest.approx(here.upper(alpha) + shift, abs=1e-9)


@given(samples | few_differ, st.floats(0.01, 100), alphas)
@settings(max_examples=40)
def test_bounds_scale_with_the_values(values: np.ndarray, scale: float, alpha: float) -> None:
    here, there = of(values), of(values * scale)
    assert there.lower(alpha) == pytest.approx(scale * here.lower(alpha), rel=1e-6, abs=1e-9)
    assert there.upper(alpha) == pytest.approx(scale * here.upper(alpha), rel=1e-6, abs=1e-9)


@given(samples | few_differ, alphas)
@settings(max_examples=40)
def test_turning_the_values_round_swaps_the_bounds(values: np.ndarray, alpha: float) -> None:
    here, there = of(values), of(-values)
    assert there.lower(alpha) == pytest.approx(-here.upper(alpha), abs=1e-12)
    assert there.p_at_most(0.25) == pytest.approx(here.p_at_least(-0.25), abs=1e-12)


@given(samples | few_differ, alphas, numbers)
@settings(max_examples=60)
def test_p_is_at_most_alpha_exactly_where_the_bound_is_beyond(
    values: np.ndarray, alpha: float, limit: float
) -> None:
    said = of(values)
    for edge in (limit, said.lower(alpha) - 1e-6, said.lower(alpha) + 1e-6):
        assert (said.p_at_most(edge) <= alpha) == (said.lower(alpha) > edge)
    for edge in (limit, said.upper(alpha) - 1e-6, said.upper(alpha) + 1e-6):
        assert (said.p_at_least(edge) <= alpha) == (said.upper(alpha) < edge)


@given(samples)
@settings(max_examples=40)
def test_a_smaller_alpha_gives_a_wider_interval_around_the_mean(values: np.ndarray) -> None:
    said = of(values)
    lows, highs = ([side(a) for a in (0.01, 0.05, 0.2)] for side in (said.lower, said.upper))
    assert lows == sorted(lows) and highs == sorted(highs, reverse=True)
    assert lows[-1] <= values.mean() + 1e-12 and highs[-1] >= values.mean() - 1e-12


@pytest.mark.parametrize("n", [6, 12, 19])
def test_below_20_runs_the_bounds_are_scipys_t_test(n: int) -> None:
    values = stream(3, "t", n).normal(-0.02, 0.04, n)
    said = of(values)
    assert said.method == "t"
    assert said.p_at_most(-0.05) == pytest.approx(
        stats.ttest_1samp(values, -0.05, alternative="greater").pvalue
    )
    assert said.p_at_least(-0.05) == pytest.approx(
        stats.ttest_1samp(values, -0.05, alternative="less").pvalue
    )


def test_from_20_runs_of_normal_values_the_bootstrap_is_near_the_t_test() -> None:
    values = stats.norm.ppf((np.arange(200) + 0.5) / 200)
    said, t = of(values), stats.t.ppf(0.95, 199) / np.sqrt(200) * values.std(ddof=1)
    assert said.method == "bootstrap"
    assert (said.lower(0.05), said.upper(0.05)) == pytest.approx((-t, t), abs=0.006)


def test_a_resample_by_hand() -> None:
    """0, 1, 5 drawn as they are (t* = 0), as 0, 0, 1 and as 1, 5, 5; written out from the definition."""
    values, counts = (
        np.array([[0.0, 1.0, 5.0]]),
        np.array([[1.0, 1.0, 1.0], [2.0, 1.0, 0.0], [0.0, 1.0, 2.0]]),
    )
    sd = np.sqrt(14 / 3)
    drawn = np.array([0.0, 0.0, 1.0])
    small = (drawn.mean() - 2.0) / max(drawn.std(), 0.25 * sd)
    drawn = np.array([1.0, 5.0, 5.0])
    large = (drawn.mean() - 2.0) / drawn.std()
    assert candidates(values, counts)[0] == pytest.approx([2.0, 2.0 - sd * small, 2.0 - sd * large])


def test_a_lower_bound_reaches_further_where_few_runs_carry_a_loss() -> None:
    """Student's bounds are as far to either side; a tail of losses must widen the lower one."""
    values = np.array([0.0] * 17 + [-1.0, -0.8, -0.6])
    said = of(values)
    assert values.mean() - said.lower(0.05) > 1.3 * (said.upper(0.05) - values.mean())


@pytest.mark.parametrize("n", [6, 19, 20, 40])
def test_equal_values_leave_no_doubt(n: int) -> None:
    said = of(np.full(n, 0.1 + 0.2))
    assert said.lower(0.05) == said.upper(0.05) == pytest.approx(0.3)
    assert said.p_at_most(0.29) <= 1e-4 and said.p_at_most(0.31) == 1.0
    assert said.p_at_least(0.31) <= 1e-4 and said.p_at_least(0.29) == 1.0


@pytest.mark.parametrize("n", [0, 1, 5])
def test_below_6_runs_there_are_none(n: int) -> None:
    assert bounds(np.zeros(n), stream(0, "test")) is None


def test_many_runs_are_resampled_in_parts() -> None:
    values = stream(2, "many").normal(size=3000)
    said = of(values)
    assert said.lower(0.05) == pytest.approx(values.mean() - 1.645 / np.sqrt(3000), abs=0.002)


def test_counts_say_how_often_each_value_is_drawn() -> None:
    counts = draw_counts(7, 500, stream(0, "counts"))
    assert counts.shape == (500, 7) and (counts.sum(axis=1) == 7).all()
    assert counts.mean() == 1.0 and counts.var() == pytest.approx(6 / 7, rel=0.1)
