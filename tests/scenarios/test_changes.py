"""`PATH=VALUE`: one value of a scenario file is another, all else stays."""

from __future__ import annotations

import pytest

from scenarios.changes import changed
from scenarios.errors import BadInput
from scenarios.load import load_scenario

TREE = {"a": {"b": [1, {"c": 2}], "d": {"uniform": [0, 1]}}, "e": "word"}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("a.b.0=5", {"a": {"b": [5, {"c": 2}], "d": {"uniform": [0, 1]}}, "e": "word"}),
        ("a.b.1.c = 7.5", {"a": {"b": [1, {"c": 7.5}], "d": {"uniform": [0, 1]}}, "e": "word"}),
        ("a.d=3", {"a": {"b": [1, {"c": 2}], "d": 3}, "e": "word"}),
        ("e={uniform: [1, 2]}", {"a": TREE["a"], "e": {"uniform": [1, 2]}}),
    ],
)
def test_only_the_named_value_changes(change: str, expected: object) -> None:
    before = repr(TREE)
    assert changed(TREE, [change]) == expected
    assert repr(TREE) == before


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("a.b", ("PATH=VALUE",)),
        ("=3", ("PATH=VALUE",)),
        ("a=3", ("whole part", "b, d")),
        ("a.x=3", ("'x'", "b, d")),
        ("a.b.7=3", ("'7'", "0 to 1")),
        ("e.f=3", ("nothing below",)),
    ],
)
def test_a_change_that_leads_nowhere_costs_one_sentence(change: str, words: tuple[str, ...]) -> None:
    with pytest.raises(BadInput) as error:
        changed(TREE, [change])
    assert all(word in str(error.value) for word in words), str(error.value)


def test_a_changed_scenario_is_checked_like_a_file() -> None:
    family = load_scenario("overtake-approach", ["systems.car.duration_s=3"])
    assert family.resolve(0).system("car").duration_s == 3.0
    with pytest.raises(BadInput, match="duration_s"):
        load_scenario("overtake-approach", ["systems.car.duration_s=-3"])
