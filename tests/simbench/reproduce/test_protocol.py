"""The paper's printed tests follow from its printed means; its protocol is held against other programs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from simbench.paper import MAE, TABLE_I, TABLE_II, PaperTpr
from simbench.reproduce.protocol import Frames, dependence, draw, intra_class
from simbench.score.statistics import one_sample_t

ROWS = pytest.mark.parametrize("row", TABLE_II.values(), ids=[f"{s}-{r}" for s, r in TABLE_II])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


@ROWS
def test_table_three_follows_from_means_and_spreads(row: PaperTpr) -> None:
    found = one_sample_t(row.fusion, row.fusion_sd, row.n, 0.5)
    assert found.t == pytest.approx(row.half_t, abs=0.011)
    assert found.p == pytest.approx(row.half_p, abs=0.0006) or (row.half_p == 0.001 and found.p < 0.001)


@ROWS
def test_the_paired_p_follows_from_t_and_for_one_row_only_if_it_is_one_sided(row: PaperTpr) -> None:
    two = 2.0 * stats.t.sf(row.paired_t, row.n - 1)
    if row.paired_p == 0.001:
        assert two < 0.001
    else:
        assert two == pytest.approx(0.012, abs=0.0005), "two-sided"
        assert two / 2.0 == pytest.approx(row.paired_p, abs=0.0005), "as printed"


def test_the_average_of_table_one_is_the_printed_one() -> None:
    assert np.mean(TABLE_I["car"]) == pytest.approx(0.9415, abs=0.0001)
    assert np.mean(TABLE_I["wearable"]) == 1.0
    assert MAE["car"].n + MAE["wearable"].n == 102


def passes(count: int, frames: int, between: float, within: float, seed: int = 1) -> Frames:
    """Differences whose spread between and within passes is known."""
    gen = rng(seed)
    shift = np.repeat(between * gen.standard_normal(count), frames)
    before = np.full(count * frames, 0.4)
    after = before + 0.3 + shift + within * gen.standard_normal(count * frames)
    return Frames(before=before, after=after, run=np.repeat(np.arange(count), frames))


@pytest.mark.parametrize(("between", "within"), [(0.3, 0.1), (0.1, 0.1), (0.0, 0.2)])
def test_the_share_of_variance_between_passes_is_found(between: float, within: float) -> None:
    frames = passes(4000, 12, between, within)
    expected = between**2 / (between**2 + within**2)
    found = intra_class(frames.after - frames.before, frames.run)
    assert found == pytest.approx(expected, abs=0.03)


def test_it_is_that_of_an_analysis_of_variance_by_another_program() -> None:
    frames = passes(9, 7, 0.2, 0.2)
    values = frames.after - frames.before
    f = stats.f_oneway(*[values[frames.run == g] for g in range(9)]).statistic
    assert intra_class(values, frames.run) == pytest.approx((f - 1.0) / (f + 6.0))


@given(st.permutations(range(40)), st.floats(-5, 5), st.floats(0.1, 9))
@settings(max_examples=40, deadline=None)
def test_it_depends_on_no_order_no_offset_and_no_unit(order: list[int], offset: float, unit: float) -> None:
    frames = passes(8, 5, 0.2, 0.3)
    values, some = frames.after - frames.before, np.array(order)
    assert intra_class(unit * values[some] + offset, frames.run[some]) == pytest.approx(
        intra_class(values, frames.run), abs=1e-9
    )


def test_frames_that_are_all_alike_within_a_pass_are_worth_one_each() -> None:
    frames = passes(5, 10, 0.3, 0.0)
    found = dependence(frames, 50, 5)
    assert found.icc == pytest.approx(1.0)
    assert found.effective_n == pytest.approx(5.0)


def test_independent_frames_are_worth_what_they_count() -> None:
    found = dependence(passes(300, 10, 0.0, 0.2), 19, 2)
    assert found.effective_n == pytest.approx(19.0)


def test_two_passes_that_differ_make_ten_frames_worth_less_than_three() -> None:
    """By hand: ICC 0.8, 5 frames a pass: 10 / (1 + 4 * 0.8) = 2.4."""
    found = dependence(passes(4000, 2, 0.4, 0.2), 10, 2)
    assert found.icc == pytest.approx(0.8, abs=0.02)
    assert found.effective_n == pytest.approx(10 / (1 + 4 * found.icc))


@pytest.mark.parametrize("groups", [np.zeros(8, dtype=np.int64), np.arange(8)])
def test_one_pass_or_one_frame_each_tells_nothing_of_dependence(groups: np.ndarray) -> None:
    assert intra_class(np.arange(8.0), groups) is None
    frames = Frames(before=np.zeros(8), after=np.arange(8.0), run=groups)
    assert dependence(frames, 5, 2).effective_n is None


def test_a_draw_of_all_frames_is_the_whole_and_its_tests_are_scipys() -> None:
    frames = passes(4, 5, 0.1, 0.2)
    found = draw(frames, 1000, rng())
    assert found.n == 20
    assert found.before[0] == pytest.approx(0.4) and found.after[0] == pytest.approx(frames.after.mean())
    two = stats.ttest_rel(frames.after, frames.before)
    one = stats.ttest_rel(frames.after, frames.before, alternative="greater")
    half = stats.ttest_1samp(frames.after, 0.5, alternative="greater")
    assert (found.t[0], found.p_two_sided[0]) == pytest.approx((two.statistic, two.pvalue))
    assert found.p_one_sided[0] == pytest.approx(one.pvalue)
    assert (found.half_t[0], found.half_p[0]) == pytest.approx((half.statistic, half.pvalue))
    assert found.after_sd[0] == pytest.approx(frames.after.std(ddof=1))


def test_draws_of_ten_scatter_about_the_whole_as_draws_without_putting_back_do() -> None:
    frames = passes(10, 10, 0.1, 0.2)
    means = draw(frames, 10, rng(), 2000).after
    assert np.mean(means) == pytest.approx(frames.after.mean(), abs=0.005)
    expected = frames.after.std(ddof=1) * math.sqrt((1 - 10 / 100) / 10)
    assert np.std(means) == pytest.approx(expected, rel=0.06)


def test_frames_without_spread_have_no_test() -> None:
    frames = Frames(before=np.full(6, 0.2), after=np.full(6, 0.7), run=np.arange(6))
    found = draw(frames, 6, rng())
    assert np.isnan([found.t[0], found.p_two_sided[0], found.p_one_sided[0], found.half_t[0]]).all()
    assert found.after[0] == pytest.approx(0.7)
    assert np.isnan(draw(frames, 1, rng()).t[0]), "one frame"
