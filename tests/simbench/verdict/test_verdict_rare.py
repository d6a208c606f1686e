"""The second gate: rows by hand, SciPy's exact tests."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from simbench.verdict.rare import FailureJudgement, judge_failures, mcnemar, share


def of(old: set[int], new: set[int], n: int = 20, limit: float | None = None) -> FailureJudgement:
    return judge_failures({i: i in old for i in range(n)}, {i: i in new for i in range(n)}, limit=limit)


@given(st.integers(1, 100).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_bounds_of_a_share_are_scipys(counts: tuple[int, int]) -> None:
    failed, n = counts
    ours = share(failed, n)
    both_sides = stats.binomtest(failed, n).proportion_ci(0.9, method="exact")
    assert (ours.low, ours.high) == pytest.approx((both_sides.low, both_sides.high), abs=1e-9)


@pytest.mark.parametrize("n", [20, 100, 1000])
def test_no_failure_in_n_allows_about_three_over_n(n: int) -> None:
    assert share(0, n).high == pytest.approx(3 / n, rel=0.08)
    assert share(0, n).high == pytest.approx(1 - 0.05 ** (1 / n))


@given(st.integers(0, 30), st.integers(0, 30))
def test_mcnemar_is_a_binomial_test(began: int, ended: int) -> None:
    theirs = (
        stats.binomtest(began, began + ended, 0.5, alternative="greater").pvalue if began + ended else 1.0
    )
    assert mcnemar(began, ended) == pytest.approx(theirs)


@pytest.mark.parametrize(
    ("old", "new", "verdict"),
    [
        (set(), set(), "PASS"),
        ({1, 2}, {1, 2}, "PASS"),
        ({1, 2, 3}, {4, 5, 6}, "PASS"),
        (set(), {1, 2, 3, 4}, "PASS"),
        (set(), {1, 2, 3, 4, 5}, "REGRESSION"),
        ({6, 7, 8}, {1, 2, 3, 4, 5}, "PASS"),
    ],
    ids=["none", "the same", "others, as many", "4 new: p 1/16", "5 new: p 1/32", "5 begin, 3 end"],
)
def test_new_failures(old: set[int], new: set[int], verdict: str) -> None:
    judgement = of(old, new)
    assert judgement.verdict == verdict
    assert set(judgement.began) == new - old and set(judgement.ended) == old - new
    assert (judgement.note is None) == (not new - old), "new failures are named even where they may be chance"


@pytest.mark.parametrize(
    ("failed", "n", "verdict", "note"),
    [
        (
            0,
            20,
            "INCONCLUSIVE",
            "0 of 20 runs fail, up to 0.139 of all, limit 0.1, 29 runs without a failure would do",
        ),
        (0, 29, "PASS", None),
        (1, 40, "INCONCLUSIVE", "1 of 40 runs fail, up to 0.113 of all, limit 0.1"),
        (1, 46, "PASS", None),
        (10, 40, "REGRESSION", "limit failed: 10 of 40 runs fail, at least 0.142 of all, limit 0.1"),
    ],
)
def test_a_limit_on_the_share(failed: int, n: int, verdict: str, note: str | None) -> None:
    same = set(range(failed))
    judgement = of(same, same, n, limit=0.1)
    assert (judgement.verdict, judgement.note) == (verdict, note)


@pytest.mark.parametrize("limit", [0.0, 1.0])
def test_the_ends_of_a_limit(limit: float) -> None:
    """No number of runs shows that nothing ever fails; anything keeps a limit of 1."""
    assert of(set(), set(), 1000, limit=limit).verdict == ("PASS" if limit else "INCONCLUSIVE")


@pytest.mark.parametrize(
    ("old", "new"), [({}, {}), ({1: False}, {2: False}), ({1: None}, {1: None}), ({1: None}, {1: False})]
)
def test_nothing_is_never_a_pass(old: Mapping[int, bool | None], new: Mapping[int, bool | None]) -> None:
    assert judge_failures(old, new).verdict == "ERROR"


def test_a_run_that_cannot_be_said_to_fail_any_more_is_an_error() -> None:
    old = dict.fromkeys(range(20), False)
    judgement = judge_failures(old, {**old, 4: None})
    assert (judgement.verdict, judgement.note) == (
        "ERROR",
        "1 run (4) cannot be said to fail or not any more",
    )


def test_few_runs_are_an_illustration() -> None:
    assert (of(set(), {0}, 5).verdict, of(set(), {0}, 5).note) == ("INCONCLUSIVE", "n = 5 runs: illustration")


@given(st.sets(st.integers(0, 19)), st.sets(st.integers(0, 19)), st.integers(0, 19))
def test_one_more_failure_is_never_better(old: set[int], new: set[int], more: int) -> None:
    assert (of(old, new | {more}).p_new or 0) <= (of(old, new).p_new or 0) + 1e-12


def test_arguments_that_make_no_sense_are_refused() -> None:
    for bad in (
        lambda: share(3, 2),
        lambda: share(0, 0),
        lambda: mcnemar(-1, 0),
        lambda: of({1}, {1}, limit=1.5),
    ):
        with pytest.raises(ValueError):
            bad()
