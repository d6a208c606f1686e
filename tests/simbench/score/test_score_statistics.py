"""Statistics over runs, against closed forms, the paper's tables and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.score.statistics import (
    bca_interval,
    one_sample_t,
    paired,
    paired_t,
    sign_flip_p,
    summarize,
    t_interval,
)

with pytest.MonkeyPatch.context() as patch:  # SciPy draws an unseeded example for its own docs while imported
    patch.setattr(np.random, "default_rng", lambda _=None: np.random.Generator(np.random.PCG64(0)))
    from scipy import stats

finite = st.floats(-10, 10).map(lambda v: round(v, 3))


def rng(seed=0):
    return np.random.default_rng(seed)


# -- the paper's Table III: one-sample right-tailed t against 50 % -----------------------------------------


@pytest.mark.parametrize(
    ("mean", "sd", "n", "t", "p"),
    [
        (65.02, 19.01, 10, "2.50", "0.017"),
        (81.65, 17.93, 19, "7.69", "0.000"),
        (65.46, 18.14, 6, "2.09", "0.046"),
        (75.29, 12.93, 10, "6.19", "0.000"),
    ],
    ids=["car S1", "car S2", "wearable S1", "wearable S2"],
)
def test_the_papers_one_sample_rows_recompute(mean, sd, n, t, p):
    test = one_sample_t(mean, sd, n, 50.0)
    assert (f"{test.t:.2f}", f"{test.p:.3f}", test.df) == (t, p, n - 1)


def test_the_papers_paired_p_of_wearable_s1_is_one_sided():
    """Table II prints t 3.82, p .006 with n = 6: right-tailed .006, two-sided .012."""
    assert f"{one_sample_t(3.82, np.sqrt(6), 6, 0.0, 'greater').p:.3f}" == "0.006"
    assert f"{one_sample_t(3.82, np.sqrt(6), 6, 0.0, 'two-sided').p:.3f}" == "0.012"


@pytest.mark.parametrize("alternative", ["two-sided", "greater", "less"])
def test_paired_t_equals_scipys(alternative):
    a, b = rng(1).normal(size=12), rng(2).normal(0.3, size=12)
    ours, theirs = paired_t(a, b, alternative), stats.ttest_rel(b, a, alternative=alternative)
    assert (ours.t, ours.p) == pytest.approx((theirs.statistic, theirs.pvalue))


def test_a_t_test_without_spread_or_with_one_value_is_refused():
    for sd, n in [(0.0, 5), (1.0, 1)]:
        with pytest.raises(ValueError):
            one_sample_t(1.0, sd, n, 0.0)


# -- sign flip --------------------------------------------------------------------------------------------


def test_six_gains_of_six_have_the_smallest_p_that_six_runs_can_give():
    assert sign_flip_p([1, 2, 3, 4, 5, 6]) == pytest.approx(2 / 64)
    assert sign_flip_p([1, 2, 3, 4, 5, 6], "greater") == pytest.approx(1 / 64)
    assert sign_flip_p([1, 2, 3, 4, 5, 6], "less") == 1.0


def test_ties_that_differ_only_by_rounding_count_as_ties():
    assert sign_flip_p([0.1, 0.2, 0.3]) == pytest.approx(2 / 8)
    assert sign_flip_p([0.1, 0.2, -0.3]) == 1.0  # sum is 5e-17, not above 0


def test_without_any_difference_p_is_one():
    assert sign_flip_p([0.0] * 8) == 1.0


def test_twenty_differences_are_exact_and_twenty_one_are_refused():
    assert sign_flip_p(np.arange(1, 21)) == 2 / 2**20
    with pytest.raises(ValueError, match="1 to 20"):
        sign_flip_p(np.ones(21))


@settings(max_examples=20, deadline=None)
@given(st.lists(finite, min_size=2, max_size=8), st.sampled_from(["two-sided", "greater", "less"]))
def test_sign_flip_equals_a_plain_enumeration(values, alternative):
    d = np.array(values)
    signs = np.array(np.meshgrid(*[[1, -1]] * len(d))).reshape(len(d), -1).T
    sums, seen = signs @ d, d.sum()
    extreme = {
        "two-sided": np.abs(sums) >= abs(seen) - 1e-9,
        "greater": sums >= seen - 1e-9,
        "less": sums <= seen + 1e-9,
    }[alternative]
    assert sign_flip_p(values, alternative) == pytest.approx(extreme.mean())


@given(st.lists(finite, min_size=1, max_size=10))
def test_sign_flip_does_not_care_for_order_sign_or_scale(values):
    p = sign_flip_p(values)
    assert p == sign_flip_p(values[::-1]) == sign_flip_p([-v for v in values])
    assert p == sign_flip_p([4 * v for v in values])
    assert 0 < p <= 1


# -- intervals --------------------------------------------------------------------------------------------


def test_t_interval_of_a_hand_computed_row():
    """1..6: mean 3.5, SD sqrt(3.5), t(.975, 5) = 2.5706: 3.5 +- 1.9633."""
    assert t_interval([1, 2, 3, 4, 5, 6]) == pytest.approx((1.5367, 5.4633), abs=1e-4)


def test_bca_equals_scipys_on_a_skewed_sample():
    values = rng(3).exponential(size=30)
    theirs = stats.bootstrap(
        (values,), np.mean, method="BCa", n_resamples=40_000, rng=rng(5)
    ).confidence_interval
    low, high = bca_interval(values, rng(4), resamples=40_000)
    assert low == pytest.approx(theirs.low, abs=0.015)
    assert high == pytest.approx(theirs.high, abs=0.015)
    # Skew pulls both ends up against the symmetric interval.
    assert (low + high) / 2 > values.mean() + 0.01


def test_bca_of_a_biased_statistic_equals_scipys():
    """The plain variance is biased downwards: the bias correction, not only the skew, must be right."""
    values = rng(3).exponential(size=20)
    theirs = stats.bootstrap((values,), np.var, method="BCa", n_resamples=20_000, rng=rng(5))
    ours = bca_interval(values, rng(4), resamples=20_000, statistic=lambda rows: rows.var(axis=-1))
    width = theirs.confidence_interval.high - theirs.confidence_interval.low
    assert ours == pytest.approx(tuple(theirs.confidence_interval), abs=0.05 * width)


def test_bca_of_equal_values_is_that_value():
    assert bca_interval([0.3] * 25, rng()) == pytest.approx((0.3, 0.3))


@pytest.mark.parametrize("interval", [t_interval, lambda v: bca_interval(v, rng(9), resamples=999)])
def test_an_interval_covers_the_mean_about_95_times_in_100(interval):
    source = rng(11)
    covered = 0
    for _ in range(400):
        low, high = interval(source.normal(size=20))
        covered += low <= 0.0 <= high
    assert 0.90 <= covered / 400 <= 0.98


def test_an_interval_of_one_value_is_refused():
    for make in (t_interval, lambda v: bca_interval(v, rng())):
        with pytest.raises(ValueError, match="at least 2"):
            make([1.0])


# -- summaries --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("n", "method"), [(1, "none"), (5, "none"), (6, "t"), (19, "t"), (20, "bca"), (21, "bca")]
)
def test_the_number_of_runs_decides_the_interval(n, method):
    values = {seed: float(v) for seed, v in enumerate(rng(6).normal(size=n))}
    summary = summarize(values, rng())
    assert summary.method == method
    assert (summary.ci95 is None) == (method == "none")
    if summary.ci95:
        assert summary.ci95[0] < summary.mean < summary.ci95[1]
    assert summary.n == n and len(summary.points) == n


def test_two_runs_are_an_illustration_with_points_and_range():
    summary = summarize({0: 0.5, 1: 0.7}, rng())
    assert summary.note == "n = 2 runs: illustration"
    assert (summary.mean, summary.low, summary.high) == pytest.approx((0.6, 0.5, 0.7))
    assert summary.sd == pytest.approx(0.2 / np.sqrt(2))
    assert summary.points == (0.5, 0.7) and summary.ci95 is None


def test_runs_without_a_value_are_counted_and_not_averaged():
    summary = summarize({0: 0.5, 1: None, 2: 0.7}, rng())
    assert (summary.mean, summary.n, summary.missing) == (pytest.approx(0.6), 2, 1)
    empty = summarize({0: None}, rng())
    assert (empty.mean, empty.n, empty.missing, empty.low) == (None, 0, 1, None)


def test_a_value_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="not finite"):
        summarize({0: float("nan")}, rng())


def test_differences_are_paired_by_run_not_by_position():
    a = {3: 1.0, 1: 2.0, 2: 3.0, 9: 50.0}
    b = {1: 2.5, 2: 3.5, 3: 1.5, 8: -50.0}
    result = paired(a, b, rng())
    assert result.difference.points == pytest.approx((0.5, 0.5, 0.5))
    assert (result.only_a, result.only_b) == (1, 1)
    assert result.sign_flip_p is None


@pytest.mark.parametrize(("n", "has_p"), [(5, False), (6, True), (19, True), (20, True), (21, False)])
def test_the_sign_flip_p_stands_from_six_to_twenty_runs(n, has_p):
    a = {i: 0.0 for i in range(n)}
    b = {i: 1.0 + i for i in range(n)}
    p = paired(a, b, rng()).sign_flip_p
    assert (p is not None) is has_p
    if p is not None:
        assert p == pytest.approx(2.0 / 2**n)


def test_the_same_generator_state_gives_the_same_interval():
    values = {i: float(v) for i, v in enumerate(rng(8).normal(size=25))}
    assert summarize(values, rng(1)) == summarize(values, rng(1))


@given(st.dictionaries(st.integers(), finite, min_size=1, max_size=12))
def test_the_mean_lies_in_the_range_and_order_of_runs_does_not_matter(values):
    summary = summarize(values, rng())
    assert summary.low - 1e-12 <= summary.mean <= summary.high + 1e-12
    backwards = summarize(dict(reversed(values.items())), rng())
    assert backwards.mean == pytest.approx(summary.mean)
