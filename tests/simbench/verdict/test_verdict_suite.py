"""All judgements together: Holm, intersection-union, the order of the list."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbench.verdict.decide import Judgement, Verdict
from simbench.verdict.holm import holm
from simbench.verdict.overall import suite_verdict

ps = st.lists(st.floats(0, 1), max_size=8)


def judged(verdict: Verdict, difference: float | None = 0.0, p: float | None = 0.5) -> Judgement:
    return Judgement(
        verdict=verdict, better="higher", margin=0.05, alpha=0.05, n=20, method="bootstrap", old=0.9, new=0.9,
        difference=difference, p_regression=p,
    )  # fmt: skip


PASS = judged("PASS", p=1.0)


# -- Holm ---------------------------------------------------------------------------------------------------


def test_holm_by_hand() -> None:
    """Of 0.01, 0.04, 0.03, 0.005: 4 * 0.005, 3 * 0.01, 2 * 0.03, and 0.04 no less than that."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx((0.03, 0.06, 0.06, 0.02))
    assert holm([]) == () and holm([0.3]) == (0.3,)


@given(ps)
def test_holm_lies_between_no_correction_and_bonferroni(p: list[float]) -> None:
    assert all(raw <= a <= min(1.0, len(p) * raw) or a == raw for raw, a in zip(p, holm(p), strict=True))


@given(ps, st.data())
def test_holm_grows_with_every_p(p: list[float], data: st.DataObject) -> None:
    more = [data.draw(st.floats(value, 1)) for value in p]
    assert all(a <= b for a, b in zip(holm(p), holm(more), strict=True))


@given(ps, st.floats(0, 1))
def test_one_more_question_never_lowers_an_adjusted_p(p: list[float], other: float) -> None:
    assert all(a <= b for a, b in zip(holm(p), holm([*p, other])[:-1], strict=True))


@given(ps, st.permutations(range(8)))
def test_holm_does_not_depend_on_the_order(p: list[float], order: list[int]) -> None:
    order = [i for i in order if i < len(p)]
    assert holm([p[i] for i in order]) == tuple(holm(p)[i] for i in order)


@pytest.mark.parametrize("bad", [-0.1, 1.1, math.nan])
def test_what_is_no_p_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="p-values"):
        holm([0.1, bad])


# -- the suite ----------------------------------------------------------------------------------------------


def test_a_suite_passes_when_all_of_it_passes() -> None:
    assert suite_verdict({"a": PASS, "b": PASS}).verdict == "PASS"
    assert suite_verdict({"a": PASS, "b": judged("INCONCLUSIVE")}).verdict == "INCONCLUSIVE"


def test_nothing_compared_is_an_error() -> None:
    assert suite_verdict({}).verdict == "ERROR"


def test_a_regression_must_survive_holm() -> None:
    """0.03 alone is a regression; beside one other question it is 0.06, beside one without a p still 0.03."""
    bad = replace(judged("REGRESSION", -0.08, 0.03), note="left out")
    assert suite_verdict({"a": bad}).verdict == "REGRESSION"
    two = suite_verdict({"a": bad, "b": PASS})
    assert two.verdict == "INCONCLUSIVE" and two.adjusted == pytest.approx({"a": 0.06, "b": 1.0})
    note = two.judgements[0][1].note
    assert note == "a regression alone, but not among all that was tested (Holm's p 0.06); left out"
    assert suite_verdict({"a": bad, "b": judged("PASS", p=None)}).verdict == "REGRESSION"


def test_the_worst_comes_first() -> None:
    rows = {
        "pass": PASS,
        "small": judged("REGRESSION", -0.07, 1e-4),
        "unclear": judged("INCONCLUSIVE", -0.04),
        "large": judged("REGRESSION", -0.2, 1e-4),
        "worse margin": replace(judged("REGRESSION", -0.1, 1e-4), margin=0.01),
        "error": judged("ERROR", None, None),
        "good": judged("PASS", 0.1, 1.0),
    }
    found = suite_verdict(rows)
    assert found.verdict == "ERROR"
    order = ["error", "worse margin", "large", "small", "unclear", "pass", "good"]
    assert [key for key, _ in found.judgements] == order


def test_judgements_of_two_looks_are_not_mixed() -> None:
    with pytest.raises(ValueError, match="alphas"):
        suite_verdict({"a": PASS, "b": replace(PASS, alpha=0.0177)})


@given(st.lists(st.sampled_from(["ERROR", "REGRESSION", "INCONCLUSIVE", "PASS"]), min_size=1, max_size=6))
def test_one_more_pass_never_makes_a_suite_worse_or_an_error_vanish(verdicts: list[Verdict]) -> None:
    rows = {i: judged(v, p=1e-6 if v == "REGRESSION" else 0.9) for i, v in enumerate(verdicts)}
    found = suite_verdict(rows)
    assert suite_verdict({**rows, "more": PASS}).verdict == found.verdict == found.judgements[0][1].verdict
    assert len(found.judgements) == len(verdicts)
