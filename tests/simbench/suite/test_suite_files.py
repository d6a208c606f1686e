"""JUnit, Markdown and the page: whatever a pipeline says, they stay whole."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbench.report.suite_page import write_page
from simbench.suite.judge import answer
from simbench.suite.junit import junit
from simbench.suite.markdown import markdown
from simbench.suite.side import Side
from tests.simbench.suite.sides import GROUP, ran, runs, side


def with_crash(why: str) -> Side:
    crashed = ran(None, status="pipeline_error", gross=None, outputs=None, why=why)
    return side({GROUP: runs([0.9, 0.7, crashed], limits={"precision": ">=0.95"})})


@given(st.text(max_size=60))
def test_whatever_a_pipeline_raises_the_files_stay_whole(why: str) -> None:
    new = with_crash(why)
    found = answer(new)
    root = ElementTree.fromstring(junit(found, new, {}))
    assert root.get("errors") == "2"  # the run, and the limit without its value
    text = markdown(found, new, command="simbench run gate", against=None)
    rows = [line for line in text.splitlines() if line.startswith("| 💥")]
    assert len(rows) == 2
    assert all(row.replace("\\|", "").count("|") == 10 for row in rows)


def test_failure_error_and_skipped_are_told_apart() -> None:
    many = {
        "a/x/car/none/p": runs([0.9] * 6, limits={"precision": ">=0.95"}),
        "b/x/car/none/p": runs([0.9] * 6, limits={"precision": ">=0.5"}, failed_runs=0.01),
        "c/x/car/none/p": runs([ran(None, status="timeout", gross=None, outputs=None, why="slow")]),
    }
    new = side(many)
    root = ElementTree.fromstring(junit(answer(new), new, {"a/x/car/none/p/0": 1.5}))
    assert (root.get("failures"), root.get("errors"), root.get("skipped")) == ("1", "1", "1")
    assert root.get("tests") == str(len(list(root.iter("testcase"))))
    case = next(case for case in root.iter("testcase") if case.get("name") == "seed 0")
    assert case.get("time") == "1.500"
    names = [p.get("name") for p in case.iter("property")]
    assert names == ["seed", "hash", "command"]


def test_the_page_tells_what_was_raised_as_text(tmp_path: Path) -> None:
    new = with_crash("<script>alert(1)</script>")
    old = side({GROUP: runs([0.9, 0.7, 0.8])})
    page = write_page(
        answer(new, old), new, old, tmp_path, description="d", against="base.json", coverage=None,
        command="simbench run gate", cost="",
    ).read_text(encoding="utf-8")  # fmt: skip
    assert "<script>" not in page
    assert "&lt;script&gt;alert(1)" in page


@pytest.mark.parametrize(("groups", "each"), [(400, 20), (2, 5_000)])
def test_the_page_stays_small_with_many_groups_and_with_many_runs(
    tmp_path: Path, groups: int, each: int
) -> None:
    limit = {"precision": ">=0.95"}
    many = {
        f"g{i}/x/car/none/robust": runs([0.9 + 0.001 * (i % 7)] * each, limits=limit) for i in range(groups)
    }
    old = {name: runs([0.9 + 0.0001 * (s % 20) for s in range(each)]) for name in many}
    new = side(many)
    page = write_page(
        answer(new, side(old)), new, side(old), tmp_path, description="d", against="b", coverage=None,
        command="c", cost="",
    )  # fmt: skip
    assert page.stat().st_size < 1_000_000
