"""Limits and questions: what is written, what a run must do to keep it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import BadInput
from simbench.frontier.command import parse_along
from simbench.frontier.question import margins_of, questions
from simbench.limits import parse_limits
from simbench.stress.ledger import Outcome


def outcome(pipeline: str = "robust", seed: int = 0, status: str = "ok", **values: float | None) -> Outcome:
    named = {name.replace("__", "."): value for name, value in values.items()}
    return Outcome(
        point=(1.0,), seed=seed, pipeline=pipeline, status=status, why=None, values=named, command="again",
        seconds={},
    )  # fmt: skip


@given(value=st.floats(0, 1), limit=st.floats(0, 1).map(lambda v: float(f"{v:.6g}")))
def test_a_value_keeps_a_limit_exactly_when_it_lies_on_the_right_side(value: float, limit: float) -> None:
    least, most = parse_limits([f"precision>={limit:.6g}", f"mae_m<={limit:.6g}"])
    assert (least.margin(value) >= 0) == (value >= limit)
    assert (most.margin(value) >= 0) == (value <= limit)
    assert least.margin(None) < 0 and most.margin(None) < 0


def test_a_stem_stands_for_the_trajectory_and_a_full_name_for_itself() -> None:
    names = [limit.text for limit in parse_limits(["mae_m<=0.3", "mae_m.raw <= .5", "tpr>=0.5"])]
    assert names == ["mae_m.smooth<=0.3", "mae_m.raw<=0.5", "tpr>=0.5"]


def test_a_signed_part_of_the_budget_is_as_bad_on_either_side() -> None:
    (limit,) = parse_limits(["budget_lateral_m.total<=0.2"])
    assert limit.margin(-0.5) == limit.margin(0.5) < 0 < limit.margin(-0.1)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (["precison>=0.9"], "did you mean 'precision'?"),
        (["mae_n<=0.3"], "did you mean 'mae_m'?"),
        (["precision"], "METRIC>=NUMBER"),
        (["precision=0.9"], "METRIC>=NUMBER"),
        (["precision>=high"], "no number"),
        (["precision>=nan"], "no number"),
        (["precision<=0.9"], "precision>=0.9"),
        (["mae_m<=0.3", "mae_m.smooth<=0.2"], "two limits"),
    ],
)
def test_a_limit_that_makes_no_sense_costs_one_sentence(limits: list[str], words: str) -> None:
    with pytest.raises(BadInput) as error:
        parse_limits(limits)
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("along", "words"),
    [
        ("motion.road=A,B", "is a list"),
        ("timing.trigger_offset_ms=0,50", "is a list"),
        ("timing.trigger_offset_ms=0:150:7", "without a count"),
        ("timing.trigger_offset_ms=-10:150", "below 0"),
        ("timing.triger_offset_ms=0:150", "--along: unknown fault"),
    ],
)
def test_an_axis_without_an_upward_range_is_refused(along: str, words: str) -> None:
    with pytest.raises(BadInput) as error:
        parse_along([along])
    assert words in str(error.value) and "--vary" not in str(error.value)


def test_a_run_keeps_limits_together_only_when_it_keeps_each_and_a_failed_run_keeps_none() -> None:
    limits = parse_limits(["precision>=0.9", "mae_m<=0.3"])
    deciding, asked = questions(("robust",), limits, "share")
    assert [len(q.limits) for q in deciding] == [2] and len(asked) == 3
    runs = [
        outcome(seed=0, precision=0.95, mae_m__smooth=0.2),
        outcome(seed=1, precision=0.95, mae_m__smooth=0.4),
        outcome(seed=2, precision=0.85, mae_m__smooth=0.2),
        outcome(seed=3, precision=0.95, mae_m__smooth=None),
        outcome(seed=4, status="receipt_mismatch", precision=0.95, mae_m__smooth=0.2),
    ]
    kept = {key: [m >= 0 for m in row] for key, row in margins_of(asked, list(reversed(runs))).items()}
    together, precision, error = (question.key for question in asked)
    assert kept[together] == [True, False, False, False, False]
    assert kept[precision] == [True, True, False, True, False]
    assert kept[error] == [True, False, True, False, False]


def test_of_means_every_limit_chooses_levels() -> None:
    deciding, asked = questions(("robust",), parse_limits(["precision>=0.9", "mae_m<=0.3"]), "mean")
    assert deciding == asked and all(len(question.limits) == 1 for question in asked)
