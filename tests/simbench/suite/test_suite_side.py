"""values.json and baselines: what is written is read again; what is broken costs one sentence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import BadInput
from simbench.suite.side import Runs, Side, read_side, text_of, write_side
from tests.simbench.suite.sides import GROUP, ran, runs, side

values = st.none() | st.floats(allow_nan=False, allow_infinity=False)
rans = st.builds(
    ran, values, status=st.sampled_from(["ok", "timeout"]), gross=st.none() | st.booleans(),
    outputs=st.none() | st.text(max_size=8), scenario=st.text(max_size=8),
    why=st.none() | st.text(max_size=8),
)  # fmt: skip


@given(st.dictionaries(st.text(min_size=1, max_size=8), st.lists(rans, max_size=3).map(runs), max_size=3))
def test_what_is_written_is_read_again(
    tmp_path_factory: pytest.TempPathFactory, groups: dict[str, Runs]
) -> None:
    path = tmp_path_factory.mktemp("side") / "values.json"
    made = side(groups)
    write_side(made, path, commands=True)
    again = read_side(path)
    assert text_of(again, commands=True) == text_of(made, commands=True)
    assert json.loads(path.read_text(encoding="utf-8"))["groups"].keys() == groups.keys()


def test_a_baseline_has_one_line_for_every_run_and_no_commands() -> None:
    text = text_of(side([0.5, 0.25]), commands=False)
    assert '        "1": {"status": "ok", "scenario": "s", "outputs": "1 0.25", "gross": false, ' in text
    assert text.count('"status"') == 2
    assert "command" not in text


def test_a_folder_is_read_by_its_values(tmp_path: Path) -> None:
    write_side(side([0.5]), tmp_path / "values.json", commands=True)
    assert read_side(tmp_path).groups[GROUP].runs["0"].values["precision"] == 0.5


def corrupted(text: str) -> list[tuple[str, str]]:
    whole = json.loads(text)
    return [
        (text[: len(text) // 2], "is not JSON, or is cut off"),
        ("[]", "is no baseline"),
        (json.dumps({**whole, "schema": "simbench-baseline/9"}), "its schema is 'simbench-baseline/9'"),
        (text.replace("0.5}", "NaN}"), "NaN is no number of JSON"),
        (text.replace('"ok"', '"fine"'), "unknown value 'fine'"),
        (text.replace('"0": {', '"x": {'), "'x' is no seed"),
        (json.dumps({**whole, "extra": 1}), "unknown key 'extra'"),
        (json.dumps({k: v for k, v in whole.items() if k != "groups"}), "'groups' is missing"),
        ("[" * 100_000, "is not JSON"),
    ]


@pytest.mark.parametrize("number", range(9))
def test_a_broken_file_costs_one_sentence_that_names_it(tmp_path: Path, number: int) -> None:
    text, words = corrupted(text_of(side([0.5]), commands=False))[number]
    path = tmp_path / "base.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        read_side(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such file"):
        read_side(tmp_path / "none.json")
    with pytest.raises(BadInput, match=r"holds no values\.json"):
        read_side(tmp_path)


def test_sides_are_plain_data() -> None:
    assert Side.model_validate(side([0.5]).model_dump()) == side([0.5])
