"""One verdict: rows by hand, and laws that hold whatever the values are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from scenarios.seeding import stream
from simbench.verdict.decide import WORST_FIRST, Judgement, judge
from simbench.verdict.differences import differences

numbers = st.integers(-200, 200).map(lambda v: v / 1000)
lists = st.sampled_from([2, 5, 6, 12, 20, 30]).flatmap(lambda n: st.lists(numbers, min_size=n, max_size=n))
ZIGZAG = (0.01, -0.01)


def of(old: Any, new: Any, **how: Any) -> Judgement:
    sides = [side if isinstance(side, dict) else dict(enumerate(side)) for side in (old, new)]
    return judge(sides[0], sides[1], **{"better": "higher", "rng": stream(0, "test"), **how})


def lost(by: float, n: int = 20) -> Judgement:
    """A version that loses `by`, give or take 0.01."""
    return of([0.9] * n, [0.9 - by + ZIGZAG[i % 2] for i in range(n)])


# -- the rules, by hand -------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [6, 12, 20, 40])
@pytest.mark.parametrize(
    ("by", "verdict", "note"),
    [
        (-0.1, "PASS", None),
        (0.0, "PASS", None),
        (0.03, "PASS", "a loss, inside the margin"),
        (0.05, "INCONCLUSIVE", None),
        (0.07, "REGRESSION", None),
    ],
    ids=["gain", "no change", "loss inside the margin", "loss of exactly the margin", "loss beyond it"],
)
def test_rules(n: int, by: float, verdict: str, note: str | None) -> None:
    judgement = lost(by, n)
    assert (judgement.verdict, judgement.note) == (verdict, note)
    assert judgement.old == pytest.approx(0.9) and judgement.new == pytest.approx(0.9 - by)
    assert judgement.difference == pytest.approx(-by) and judgement.n == n


def test_of_an_error_less_is_better() -> None:
    old, new = [0.10] * 20, [0.18 + ZIGZAG[i % 2] for i in range(20)]
    judgement = of(old, new, better="lower")
    assert (judgement.verdict, round(judgement.difference or 0, 6)) == ("REGRESSION", -0.08)
    assert of(new, old, better="lower").verdict == "PASS"


@pytest.mark.parametrize(("n", "note"), [(1, "n = 1 run: illustration"), (5, "n = 5 runs: illustration")])
def test_few_runs_are_an_illustration(n: int, note: str) -> None:
    judgement = lost(0.5, n)
    assert (judgement.verdict, judgement.note, judgement.low) == ("INCONCLUSIVE", note, None)


def test_a_run_that_lost_its_value_is_an_error_and_named() -> None:
    old = {seed: 0.9 for seed in range(30)}
    judgement = of(old, {**old, 3: None, 17: None})
    assert judgement.verdict == "ERROR"
    assert judgement.note == "2 runs (3, 17) lost the value that the old version had"


@pytest.mark.parametrize(
    ("old", "new"),
    [({}, {}), ({1: 0.5}, {}), ({1: 0.5}, {2: 0.5}), ({1: None}, {1: None}), ({1: None}, {1: 0.5})],
    ids=["no runs", "no new runs", "other runs", "no values", "new values only"],
)
@pytest.mark.parametrize("identical", [False, True])
def test_nothing_is_never_a_pass(old: Any, new: Any, identical: bool) -> None:
    judgement = of(old, new, identical=identical)
    assert judgement.verdict == "ERROR"
    assert judgement.note == "no samples: no run has a value on both sides"


def test_identical_outputs_pass_even_with_few_runs() -> None:
    judgement = of([0.5, 0.7], [0.5, 0.7], identical=True)
    assert (judgement.verdict, judgement.method, judgement.note) == ("PASS", "identical", "identical")


def test_identical_outputs_with_other_values_are_an_error() -> None:
    assert of([0.5] * 20, [0.6] * 20, identical=True).verdict == "ERROR"


def test_equal_differences_say_what_they_cannot_exclude() -> None:
    """14 % of runs may differ: (1 - 0.14)^20 = 0.05."""
    judgement = of([0.5] * 20, [0.5] * 20)
    assert judgement.verdict == "PASS"
    assert judgement.note == "all differences are equal; up to 14% of runs may still differ"


def test_what_was_left_out_is_said() -> None:
    both = {seed: 0.9 + 0.01 * (seed % 3) for seed in range(8)}
    old = {**both, 100: 0.5, 101: None, 102: None}
    new = {**{k: v + 0.001 * (k % 2) for k, v in both.items()}, 101: None, 102: 0.5, 103: 0.5, 104: 0.5}
    assert of(old, new).note == (
        "1 run (101) without a value on either side left out; 1 run (102) with a new value only left out; "
        "1 run (100) of the old version only left out; 2 runs (103, 104) of the new version only left out"
    )


def test_sign_flips_are_the_exact_ones_of_d_plus_the_margin() -> None:
    new = stream(5, "flips").normal(-0.02, 0.04, 9)
    flips = of([0.0] * 9, list(new)).sign_flip
    assert flips is not None
    test = stats.permutation_test(
        (new + 0.05,), np.mean, permutation_type="samples", n_resamples=np.inf, alternative="greater"
    )
    assert flips.passing == pytest.approx(test.pvalue)
    assert of([0.0] * 40, [0.01] * 39 + [0.0]).sign_flip is None


@pytest.mark.parametrize(
    "how",
    [
        {"margin": 0.0},
        {"margin": -0.1},
        {"margin": np.nan},
        {"margin": np.inf},
        {"alpha": 0.0},
        {"alpha": 0.5},
    ],
)
def test_no_margin_and_no_alpha_are_refused(how: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"margin|alpha"):
        of([0.5] * 20, [0.5] * 20, **how)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="run 7 is not finite"):
        of([0.5] * 20, [0.5] * 7 + [bad] + [0.5] * 12)


# -- laws ---------------------------------------------------------------------------------------------------


@given(lists)
@settings(max_examples=60)
def test_swapping_the_sides_mirrors_everything(new: list[float]) -> None:
    """A REGRESSION becomes an improvement beyond the margin, and the other way round."""
    old = [0.0] * len(new)
    there, back = of(old, new), of(new, old)
    assert back.difference == pytest.approx(-(there.difference or 0.0))
    if there.low is not None:
        assert (back.low, back.high) == pytest.approx((-there.high, -there.low), abs=1e-12)
        if abs(there.high + 0.05) > 1e-9:
            assert (there.verdict == "REGRESSION") == (back.low > 0.05)
    assert replace(of(old, new, better="lower"), better="higher", old=back.old, new=back.new) == back


@given(lists, st.floats(0.001, 0.3), st.floats(1.0, 3.0))
@settings(max_examples=60)
def test_a_wider_margin_never_takes_a_pass_away_nor_makes_a_regression(
    new: list[float], margin: float, wider: float
) -> None:
    old = [0.0] * len(new)
    ranks = [WORST_FIRST.index(of(old, new, margin=m).verdict) for m in (margin, margin * wider)]
    assert ranks[1] >= ranks[0]


@given(lists, st.data())
@settings(max_examples=60)
def test_more_lost_values_never_improve(new: list[float], data: st.DataObject) -> None:
    gone = data.draw(st.sets(st.integers(0, len(new) - 1)))
    more = gone | data.draw(st.sets(st.integers(0, len(new) - 1)))
    old = [0.0] * len(new)
    ranks = [
        WORST_FIRST.index(of(old, [None if i in holes else v for i, v in enumerate(new)]).verdict)
        for holes in (set(), gone, more)
    ]
    assert ranks == sorted(ranks, reverse=True)


@given(lists, st.randoms(use_true_random=False))
@settings(max_examples=40)
def test_the_order_of_runs_decides_nothing(new: list[float], random: Any) -> None:
    keys = list(range(len(new)))
    random.shuffle(keys)
    assert of({k: 0.0 for k in keys}, {k: new[k] for k in reversed(keys)}) == of([0.0] * len(new), new)


@given(lists)
@settings(max_examples=40)
def test_p_values_agree_with_the_verdict(new: list[float]) -> None:
    judgement = of([0.0] * len(new), new)
    if judgement.p_pass is not None and judgement.p_regression is not None:
        assert (judgement.p_pass <= 0.05) == (judgement.verdict == "PASS")
        assert (judgement.p_regression <= 0.05) == (judgement.verdict == "REGRESSION")


@given(
    st.dictionaries(st.integers(0, 9), st.none() | numbers),
    st.dictionaries(st.integers(0, 9), st.none() | numbers),
)
def test_every_run_is_counted_once(old: dict[int, float | None], new: dict[int, float | None]) -> None:
    paired = differences(old, new, "lower")
    groups = [paired.missing, paired.lost, paired.gained, paired.only_old, paired.only_new]
    assert len(paired.d) + sum(map(len, groups)) == len(old.keys() | new.keys())
    assert paired.d.sum() == pytest.approx(
        sum(a - b for a, b in ((old[k], new[k]) for k in old if k in new) if a is not None and b is not None)
    )


def test_a_direction_must_be_one() -> None:
    with pytest.raises((ValueError, TypeError), match="better"):
        differences({}, {}, "more")  # type: ignore[arg-type]
