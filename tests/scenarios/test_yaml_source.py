"""The careful YAML reader: what it reads, what it refuses, and that it always says where."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from scenarios.errors import BadInput
from scenarios.yaml_source import MAX_BYTES, MAX_DEPTH, parse_yaml, read_yaml

WORDS = st.text(st.characters(min_codepoint=0x20, max_codepoint=0xD7FF), max_size=12)
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**15), 10**15),
    st.floats(allow_nan=False, allow_infinity=False),
    WORDS,
)
TREES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(WORDS, inner, max_size=4),
    max_leaves=12,
)


@given(tree=TREES)
@example(tree={"on": "yes", "a": "1e3", "b": "12:30", "c": 1e-05, "d": "nan", "e": "1_000", "f": 1e300})
def test_what_json_writes_is_read_back(tree: object) -> None:
    """JSON is YAML, and its writer is not ours."""
    assert parse_yaml(json.dumps(tree), "x").data == tree


def test_every_path_knows_its_line() -> None:
    text = "# a comment\na: 1\nb:\n  - x\n  - {c: 2,\n     d: 3}\n\ne: [1,\n    2]\n"
    lines = parse_yaml(text, "f.yaml").where.lines
    assert {path: line for path, line in lines.items() if path} == {
        ("a",): 2,
        ("b",): 3,
        ("b", 0): 4,
        ("b", 1): 5,
        ("b", 1, "c"): 5,
        ("b", 1, "d"): 6,
        ("e",): 8,
        ("e", 0): 8,
        ("e", 1): 9,
    }


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        ("-.5", -0.5),
        ("+7", 7),
        ("010", 10),
        ("0x10", "0x10"),
        ("1_000", "1_000"),
        ("12:30:00", "12:30:00"),
        ("2020-01-01", "2020-01-01"),
        ("on", "on"),
        ("no", "no"),
        ("true", True),
        ("~", None),
        ('"1"', "1"),
        ("-", [None]),
    ],
)
def test_a_plain_word_is_read_by_the_core_schema(text: str, value: object) -> None:
    data = parse_yaml(f"a: {text}" if text != "-" else "a:\n  -", "x").data["a"]
    assert data == value and type(data) is type(value)


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("a: 1\nb: &x 2\nc: *x\n", 2, "anchor &x"),
        ("a: *x\n", 1, "alias *x"),
        ("a: 1\n\na: 2\n", 3, "stands here twice, first in line 1"),
        ("a: {b: 1,\n b: 2}\n", 2, "stands here twice"),
        ("a: !!python/object/apply:os.system [x]\n", 1, "tag"),
        ("a: ! x\n", 1, "tag"),
        ("a: !!binary aGk=\n", 1, "tag"),
        ("a: .nan\n", 1, "not finite"),
        ("a:\n  - nan\n", 2, "not finite"),
        ("a: -.inf\n", 1, "not finite"),
        ("a: 1e999\n", 1, "not finite"),
        ("a: " + "9" * 5000, 1, "digits"),
        ("1: x\n", 1, "key must be a word"),
        ("true: x\n", 1, "key must be a word"),
        ("? [a, b]\n: x\n", 1, "key must be a word"),
        ("<<: {a: 1}\n1: 2", 2, "key must be a word"),
        ("a: [1, 2\n", 2, "not YAML"),
        ("a: 1\n---\nb: 2\n", 2, "not YAML"),
        ("a: 1\n b: 2", 2, "not YAML"),
        ("a: 1\nb: \x07\n", 2, "control character"),
        ("a: " + "[" * (MAX_DEPTH + 5) + "]" * (MAX_DEPTH + 5), 1, "nested deeper"),
        ("a: " + "[" * 100_000, 1, "nested deeper"),
    ],
)
def test_what_is_refused_is_refused_in_one_sentence_with_its_line(text: str, line: int, says: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_yaml(text, "f.yaml")
    error = caught.value
    assert (error.file, error.line) == ("f.yaml", line)
    assert says in str(error) and "\n" not in str(error) and len(str(error)) < 300


def test_nothing_at_all_is_refused() -> None:
    with pytest.raises(BadInput, match="holds nothing"):
        parse_yaml("# only a comment\n", "f.yaml")


def test_a_file_above_one_megabyte_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "big.yaml"
    path.write_bytes(b"a: " + b"x" * MAX_BYTES)
    with pytest.raises(BadInput, match=r"larger than 1 MB"):
        read_yaml(path)


def test_what_is_not_a_readable_text_file_is_refused(tmp_path: Path) -> None:
    binary = tmp_path / "b.yaml"
    binary.write_bytes(b"a: 1\nb: \xff\xfe\n")
    with pytest.raises(BadInput, match="line 2: not UTF-8 text"):
        read_yaml(binary)
    with pytest.raises(BadInput, match="no such file"):
        read_yaml(tmp_path / "none.yaml")
    with pytest.raises(BadInput, match="not a file"):
        read_yaml(tmp_path)
    with pytest.raises(BadInput, match="cannot be read"):
        read_yaml(tmp_path / ("x" * 400 + ".yaml"))


@given(text=st.text(max_size=60))
def test_any_text_is_read_or_refused_and_nothing_else(text: str) -> None:
    try:
        parse_yaml(text, "f.yaml")
    except BadInput as error:
        assert "\n" not in str(error)
