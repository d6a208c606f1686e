"""Curves and their answers: exact where arithmetic is, on the safe side where it is not."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.seeding import stream
from simbench.frontier.choose import EXTRA, START, next_level, start_levels
from simbench.frontier.crossing import answer, first_below, last_kept, met_again
from simbench.frontier.curve import GRID
from simbench.frontier.logistic import logistic_curve
from simbench.frontier.mean import mean_curve
from simbench.frontier.search import Found, Goal, Margins, runs_for, search, shown_share
from simbench.frontier.share import share_curve

Q = "limit"


def found(values: Callable[[float], Sequence[float]], goal: Goal) -> tuple[Found, list[float]]:
    """The answer to margins that are a function of the level; what was measured, in order."""
    asked: list[float] = []

    def measure(levels: Sequence[float]) -> Sequence[Margins]:
        asked.extend(levels)
        return [{Q: list(values(level))} for level in levels]

    return search(measure, (Q,), goal, lambda q: stream(0, "test", q))[Q], asked


def thresholds(n: int, middle: float = 0.6, sd: float = 0.08) -> np.ndarray:
    return middle + sd * stream(1, "thresholds").normal(size=n)


@given(cross=st.floats(0.02, 0.98), slope=st.floats(0.1, 100))
def test_a_straight_line_crosses_where_it_crosses(cross: float, slope: float) -> None:
    assert first_below(slope * (cross - GRID)) == pytest.approx(cross, abs=1e-9)
    assert last_kept(slope * (cross - GRID), None) == pytest.approx(cross, abs=1e-9)
    assert met_again(slope * (cross - GRID)) == ()


def test_the_first_crossing_counts_and_later_stretches_are_listed() -> None:
    wave = np.cos(4 * np.pi * GRID) + 0.0
    assert first_below(wave) == pytest.approx(1 / 8, abs=1e-4)
    ((a, b), (c, d)) = met_again(wave)
    assert (a, b, c, d) == pytest.approx((3 / 8, 5 / 8, 7 / 8, 1.0), abs=1e-4)


def test_a_curve_that_starts_below_is_broken_at_zero_and_one_that_never_falls_has_no_crossing() -> None:
    assert first_below(GRID - 0.5) == 0.0
    assert first_below(GRID + 0.5) is None and last_kept(GRID + 0.5, None) == 1.0
    assert last_kept(-GRID - 0.5, None) is None


@settings(max_examples=15, deadline=None)
@given(cross=st.floats(0.15, 0.85), seed=st.integers(0, 1000))
def test_without_scatter_the_mean_of_a_line_crosses_where_the_line_does(cross: float, seed: int) -> None:
    shift = stream(seed, "shift").normal(size=8) * 0.05
    shift -= shift.mean()
    at, _ = found(lambda x: cross - x + shift, Goal(functional="mean"))
    assert at.answer.best == pytest.approx(cross, abs=2e-3)
    assert at.answer.safe_to is not None and at.answer.safe_to < cross, "seeds scatter, so the bound is lower"


@pytest.mark.parametrize("goal", [Goal(), Goal(functional="mean"), Goal(monotone=True)])
def test_the_order_of_seeds_changes_nothing_but_the_draws(goal: Goal) -> None:
    limits = thresholds(20)
    one, _ = found(lambda x: limits - x, goal)
    other, _ = found(lambda x: limits[::-1] - x, goal)
    assert one.levels.tolist() == other.levels.tolist()
    assert one.answer.best == pytest.approx(other.answer.best, abs=1e-6)
    np.testing.assert_allclose(one.curve.error, other.curve.error, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("goal", [Goal(), Goal(functional="mean"), Goal(monotone=True)])
def test_a_bound_lies_below_the_estimate_and_inside_the_interval(goal: Goal) -> None:
    limits = thresholds(30)
    at = found(lambda x: limits - x, goal)[0].answer
    assert at.best is not None and at.safe_to is not None and at.interval is not None
    low, high = at.interval
    assert 0 <= low <= at.safe_to < at.best < (1.0 if high is None else high)
    true = 0.6 - (0.0 if goal.functional == "mean" else 1.2816 * 0.08)
    assert at.best == pytest.approx(true, abs=0.06)


@pytest.mark.parametrize("goal", [Goal(), Goal(functional="mean")])
def test_four_times_the_runs_give_a_nearer_bound(goal: Goal) -> None:
    few, many = (found(lambda x, n=n: thresholds(n) - x, goal)[0].answer for n in (30, 120))
    assert few.safe_to is not None and many.safe_to is not None
    assert few.best is not None and many.best is not None
    assert many.best - many.safe_to < few.best - few.safe_to


def test_below_six_runs_there_is_an_estimate_and_no_bound() -> None:
    at = found(lambda x: thresholds(5) - x, Goal())[0].answer
    assert at.best is not None and at.safe_to is None and at.interval is None


def test_a_limit_that_every_run_keeps_is_safe_over_the_range_only_if_so_many_runs_can_show_it() -> None:
    assert runs_for(0.9) == 29 and shown_share(29) > 0.9 > shown_share(28)
    few, many = (found(lambda _, n=n: np.ones(n), Goal())[0].answer for n in (28, 29))
    assert few.best is None and few.safe_to is None
    assert many.best is None and many.safe_to == 1.0
    assert found(lambda _: np.ones(6), Goal(functional="mean"))[0].answer.safe_to == 1.0


def test_a_limit_that_is_broken_without_any_error_is_broken_at_zero() -> None:
    at = found(lambda x: np.linspace(-1, 0.5, 20) - x, Goal())[0].answer
    assert at.broken_at_start and not at.safe_to


def test_a_dip_is_found_and_what_comes_after_it_is_listed() -> None:
    dip = found(lambda x: 0.1 - 0.3 * np.exp(-(((x - 0.4) / 0.12) ** 2)) + 0.01 * thresholds(20), Goal())[0]
    assert dip.answer.best == pytest.approx(0.4 - 0.12 * np.sqrt(np.log(0.3 / 0.106)), abs=0.03)
    ((start, end),) = dip.answer.again
    assert 0.45 < start < 0.6 and end == 1.0


def test_a_logistic_curve_only_falls_whatever_the_runs_do() -> None:
    levels = np.linspace(0, 1, 10)
    rising = logistic_curve(levels, levels[:, None] > np.linspace(0, 1, 20), 0.9)
    falling = logistic_curve(levels, levels[:, None] < np.linspace(0, 1, 20), 0.9)
    assert np.ptp(rising.margin) == pytest.approx(0, abs=1e-9)
    assert (np.diff(falling.margin) < 0).all()


def test_levels_start_even_and_then_gather_around_the_limit() -> None:
    at, asked = found(lambda x: thresholds(20) - x, Goal(functional="mean"))
    assert asked[:START] == pytest.approx(np.linspace(0, 1, START), abs=1e-6)
    assert START < len(asked) <= START + EXTRA and len(set(asked)) == len(asked)
    assert at.answer.best is not None
    assert np.abs(np.array(asked[START:]) - at.answer.best).max() < 0.2


def test_where_everything_is_far_from_the_limit_no_more_is_measured() -> None:
    assert found(lambda x: 5.0 + 0.01 * thresholds(20) - x, Goal(functional="mean"))[1] == list(
        start_levels()
    )


def test_a_share_among_many_runs_is_what_was_counted() -> None:
    levels = np.linspace(0, 1, 10)
    limits = np.linspace(0.2, 1.2, 400)
    curve = share_curve(levels, levels[:, None] < limits, 0.9)
    assert answer(curve, stream(0, "x")).best == pytest.approx(0.3, abs=0.02), (
        "a tenth of the limits lies below"
    )


@pytest.mark.parametrize("which", ["mean", "share"])
def test_the_influence_of_a_seed_is_what_happens_when_it_weighs_more(which: str) -> None:
    """Against a fit with one seed taken twice."""
    levels = np.linspace(0, 1, 10)
    margins = thresholds(60)[None, :] - levels[:, None]
    twice = np.concatenate([margins, margins[:, :1]], axis=1)
    fit = mean_curve if which == "mean" else lambda x, m: share_curve(x, m >= 0, 0.9)
    one, more = fit(levels, margins), fit(levels, twice)
    middle = np.abs(one.margin) < 1.0
    predicted = one.influence[0][middle] / 61
    np.testing.assert_allclose((more.margin - one.margin)[middle], predicted, atol=0.03)
    assert np.abs(predicted).max() > 0.001


def test_next_level_halves_a_gap() -> None:
    levels = np.linspace(0, 1, 10)
    curve = mean_curve(levels, 0.6 - levels[:, None] + 0.05 * thresholds(20)[None, :])
    level = next_level(levels, curve)
    assert level is not None and np.abs(levels - level).min() == pytest.approx(1 / 18, abs=1e-5)
