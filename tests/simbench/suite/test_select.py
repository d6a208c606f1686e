"""-k and -m."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import BadInput
from scenarios.suite import load_suite
from simbench.suite.plan import Group, groups_of
from simbench.suite.select import chosen

GROUPS: tuple[Group, ...] = groups_of(load_suite("regression"), seeds=(0, 1, 10))
ALL = {(g.name, s) for g in GROUPS for s in g.seeds}

words = st.sampled_from(["close", "wearable", "CAR", "demo", "robust", "none/robust/1"])
expressions = st.recursive(
    words,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from([" and ", " or "]), inner).map("".join).map("({})".format),
        inner.map("not {}".format),
    ),
    max_leaves=6,
)


def meant(text: str) -> set[tuple[str, int]]:
    return {(group.name, seed) for group, seed in chosen(GROUPS, words=text)}


@given(expressions, expressions)
def test_expressions_are_sets(a: str, b: str) -> None:
    assert meant(f"not {a}") == ALL - meant(a)
    assert meant(f"({a}) and ({b})") == meant(a) & meant(b)
    assert meant(f"({a}) or ({b})") == meant(a) | meant(b)


def test_a_word_is_found_in_the_id_whatever_its_capitals() -> None:
    assert {name for name, _ in meant("CLOSE")} == {"clean/overtake-close/car/none/robust"}
    assert len(meant("overtake-close and none/robust/1")) == 2  # seeds 1 and 10


def test_and_binds_closer_than_or() -> None:
    assert meant("close or curve and wearable") == meant("close")


def test_a_tag_is_of_a_block() -> None:
    found = chosen(GROUPS, tags="errors and not worn")
    assert {group.block for group, _ in found} == {"road"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a word is missing at the end"),
        ("close and", "a word is missing at the end"),
        ("(close", "a parenthesis is not closed"),
        ("close curve", "nothing may follow before 'curve'"),
        ("or close", "a word is missing before 'or'"),
        (")", "a word is missing before ')'"),
    ],
)
def test_a_malformed_expression_costs_one_sentence(text: str, words: str) -> None:
    with pytest.raises(BadInput) as caught:
        chosen(GROUPS, words=text)
    assert words in str(caught.value)


def test_a_tag_that_no_block_has_is_told_with_the_nearest() -> None:
    with pytest.raises(BadInput, match=r"no block has the tag 'eror'.*did you mean 'errors'"):
        chosen(GROUPS, tags="eror")


def test_only_some_cases_are_let_through() -> None:
    group = replace(GROUPS[0], seeds=(3, 4))
    assert [s for _, s in chosen([group], only={group.case(4)})] == [4]
