"""What is called a cause, and what is not: by hand, by law, and on 360 runs whose causes are hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from simbench.explain.attribution import attribute, attribute_sampled
from simbench.explain.dividends import dividends, up_to
from simbench.explain.family import exceeds, limit, t_values
from simbench.explain.permutations import orders, sampled
from tests.simbench.explain.hidden import Trial, judged, trials

NAMES = ("a", "b", "c", "d", "e", "f", "g")


def table(k: int, runs: int, effects: dict[int, float], noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Losses [2^k r]: the given dividends, and noise of each run with each set."""
    rng = np.random.default_rng(seed)
    masks = np.arange(1 << k)
    values = rng.normal(0.3, 0.1, runs) + noise * rng.normal(size=(1 << k, runs))
    for mask, size in effects.items():
        values[(masks & mask) == mask] += size
    return values


def test_two_causes_by_hand_with_shares_of_the_total() -> None:
    found = attribute(table(2, 8, {1: 0.1, 2: 0.3, 3: 0.4}, noise=0.01), NAMES[:2], range(8))
    assert [e.causes for e in found.dividends] == [("a",), ("b",), ("a", "b")]
    assert [e.summary.mean for e in found.dividends] == pytest.approx([0.1, 0.3, 0.4], abs=0.03)
    assert [e.share for e in found.dividends] == pytest.approx([0.125, 0.375, 0.5], abs=0.04)
    assert [e.share for e in found.shapley] == pytest.approx([0.375, 0.625], abs=0.04)
    assert found.verdict == "caused" and [e.causes for e in found.named] == [("a", "b"), ("b",), ("a",)]
    assert found.remainder is None and found.left_out == ()


def test_a_gain_stays_negative_and_is_named_too() -> None:
    found = attribute(table(2, 8, {1: 0.5, 2: -0.2}, noise=0.005), NAMES[:2], range(8))
    assert found.dividends[1].summary.mean == pytest.approx(-0.2, abs=0.02)
    assert found.dividends[1].share == pytest.approx(-2 / 3, abs=0.06) and found.dividends[1].counts


def test_where_the_total_may_be_zero_there_are_no_percentages() -> None:
    found = attribute(table(2, 8, {1: 0.3, 2: -0.3}, noise=0.02, seed=1), NAMES[:2], range(8))
    low, high = found.total.summary.ci95 or (1.0, 1.0)
    assert low <= 0.0 <= high
    assert all(e.share is None for e in (*found.dividends, *found.shapley))
    assert {e.causes for e in found.named} == {("a",), ("b",)}  # causes there are


def test_many_small_costs_that_only_count_together_are_not_called_no_cause() -> None:
    """Five causes cost 0.02 each, and every run differs by 0.02 with every set."""
    found = attribute(table(5, 8, {1 << i: 0.02 for i in range(5)}, noise=0.02, seed=2), NAMES[:5], range(8))
    assert found.named == () and found.total.counts
    assert found.verdict == "undecided" and "together" in found.why


def test_fewer_than_six_runs_have_numbers_but_no_interval_and_no_verdict() -> None:
    found = attribute(table(2, 5, {1: 0.5}), NAMES[:2], range(5))
    assert found.verdict == "undecided" and "at least 6" in found.why and found.named == ()
    assert found.dividends[0].summary.mean == pytest.approx(0.5)
    assert all(e.summary.ci95 is None and e.together is None and e.share is None for e in found.dividends)


def test_a_run_without_a_value_is_left_out_whole_and_forbids_no_cause() -> None:
    losses = table(2, 9, {}, noise=0.01, seed=3)
    assert attribute(losses, NAMES[:2], range(9)).verdict == "no cause"
    losses[2, 4] = np.nan
    found = attribute(losses, NAMES[:2], range(100, 109))
    assert found.left_out == (104,) and {e.summary.n for e in found.dividends} == {8}
    assert found.verdict == "undecided" and "no value" in found.why


def test_a_cause_is_named_also_beside_runs_without_a_value() -> None:
    losses = table(2, 9, {1: 0.5}, noise=0.01)
    losses[3, 0] = np.nan
    found = attribute(losses, NAMES[:2], range(9))
    assert found.verdict == "caused" and found.named[0].causes == ("a",) and found.left_out == (0,)


def test_no_run_with_a_value_is_told_and_breaks_nothing() -> None:
    found = attribute(np.full((4, 7), np.nan), NAMES[:2], range(7))
    assert found.verdict == "undecided" and len(found.left_out) == 7 and found.total.summary.mean is None


def test_what_rounding_leaves_is_no_effect() -> None:
    """0.1 + 0.2 alone and together: the pair is 0 but for rounding, in every run alike."""
    losses = np.array([[0.0], [0.1], [0.2], [0.1 + 0.2]]) + np.linspace(0.1, 0.9, 8)
    found = attribute(losses, NAMES[:2], range(8))
    assert (dividends(losses)[3] != 0.0).any()
    assert found.dividends[2].summary.points == (0.0,) * 8 and not found.dividends[2].counts
    assert [e.causes for e in found.named] == [("b",), ("a",)]


@given(arrays(np.float64, (8, 7), elements=st.floats(-5.0, 5.0, allow_subnormal=False)))
def test_singles_pairs_and_remainder_add_up_to_the_total(losses: np.ndarray) -> None:
    found = attribute(losses, NAMES[:3], range(7))
    small = sum(e.summary.mean or 0.0 for e in found.dividends if len(e.causes) <= 2)
    assert found.remainder is not None and found.total.summary.mean is not None
    assert small + (found.remainder.summary.mean or 0.0) == pytest.approx(found.total.summary.mean, abs=1e-9)
    assert sum(e.summary.mean or 0.0 for e in found.shapley) == pytest.approx(
        found.total.summary.mean, abs=1e-9
    )


@given(arrays(np.float64, (8, 7), elements=st.floats(-5.0, 5.0, allow_subnormal=False)))
def test_what_counts_is_what_its_interval_says(losses: np.ndarray) -> None:
    for e in attribute(losses, NAMES[:3], range(7)).dividends:
        if e.together is not None and abs(e.summary.mean or 0.0) > 1e-9:
            low, high = e.together
            edge = min(abs(low), abs(high)) < 1e-6
            assert e.counts == (not low <= 0.0 <= high) or edge


# -- many causes --------------------------------------------------------------------------------------------


def test_seven_causes_by_singles_pairs_and_orders_are_told_as_all_sets_tell_them() -> None:
    k, runs = 7, 8
    losses = table(k, runs, {1: 0.4, 6: 0.3, 56: 0.2}, noise=0.0005)
    whole = attribute(losses, NAMES, range(runs))
    pairs = list(islice(orders(k, np.random.default_rng(2)), 200))
    drawn = sampled(pairs, lambda masks: losses[list(masks)])
    small = losses[list(up_to(k, 2))]
    found = attribute_sampled(small, losses[-1], drawn, NAMES, range(runs), ())
    exact = {e.causes: e for e in whole.dividends}
    assert len(found.dividends) == 7 + 21
    for e in found.dividends:
        assert e.summary.mean == pytest.approx(exact[e.causes].summary.mean, abs=1e-12)
    assert found.remainder is not None and whole.remainder is not None
    assert found.remainder.summary.mean == pytest.approx(whole.remainder.summary.mean)
    assert found.named[0].causes == ("a",) and found.named[1].causes == ("b", "c")
    assert found.remainder.counts and not whole.remainder.counts  # there a set of three is named instead
    for near, far in zip(found.shapley, whole.shapley, strict=True):
        assert near.sampling_se is not None and far.sampling_se is None
        assert near.summary.mean == pytest.approx(far.summary.mean, abs=5.0 * near.sampling_se + 1e-9)


# -- the limit ----------------------------------------------------------------------------------------------


def test_the_limit_of_six_runs_by_hand() -> None:
    """All of one size: of 64 sign patterns 2 have no spread, 12 have one sign apart, t = (2/3) sqrt(5 /
    (5/9))."""
    effects = np.full((1, 6), 0.3)
    assert t_values(effects)[0] == np.inf
    c = limit(effects, np.random.default_rng(0))
    assert c == pytest.approx((4 / 6) * np.sqrt(5) / np.sqrt(1 - (4 / 6) ** 2))
    assert exceeds(t_values(effects), c).all()


def test_an_effect_in_one_run_of_ten_counts_for_nothing_and_spoils_nothing() -> None:
    rare = np.array([0.9, *[0.0] * 9])
    clear = np.random.default_rng(1).normal(0.3, 0.02, 10)
    both = np.stack([rare, clear])
    assert exceeds(t_values(both), limit(both, np.random.default_rng(0))).tolist() == [False, True]


@pytest.mark.parametrize("runs", [6, 8, 10, 20])
def test_independent_nulls_are_beyond_the_limit_in_at_most_five_per_cent(runs: int) -> None:
    rng = np.random.default_rng(runs)
    wrong = sum(
        exceeds(t_values(effects), limit(effects, rng)).any()
        for effects in (rng.normal(size=(15, runs)) for _ in range(200))
    )
    assert wrong <= 0.05 * 200 + 3 * np.sqrt(0.05 * 0.95 * 200)


# -- hidden causes ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Share:
    right: int
    count: int


def share(of: Sequence[Trial], runs: int) -> Share:
    return Share(sum(judged(trial, runs) for trial in of), len(of))


def test_of_360_hidden_causes_the_largest_dividend_names_a_true_one_and_nulls_are_recognised() -> None:
    runs = 10
    drawn = trials(np.random.default_rng(11), runs=runs, each=60)
    assert len(drawn) == 360
    for kind in ("single", "pair", "interaction", "many", "gain", "null"):
        found = share([trial for trial in drawn if trial.kind == kind], runs)
        assert found.count >= 30 and found.right >= 0.95 * found.count, (kind, found)


def test_a_trial_that_names_the_wrong_cause_is_judged_wrong() -> None:
    losses = table(2, 10, {1: 0.5}, noise=0.01)
    assert judged(Trial(kind="single", losses=losses, true=frozenset({0})), 10)
    assert not judged(Trial(kind="single", losses=losses, true=frozenset({1})), 10)
    assert not judged(Trial(kind="null", losses=losses, true=frozenset()), 10)
    assert not judged(Trial(kind="single", losses=table(2, 10, {}), true=frozenset({0})), 10)
