"""`simbench check`: the table, the exit code, and bad input in one sentence."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest
from click.testing import CliRunner, Result

from simbench.checks import drives
from simbench.checks.relations import QUICK_SEEDS, RELATIONS, SEEDS
from simbench.cli import main

ROOT = Path(__file__).resolve().parents[3]
DOCUMENT = (ROOT / "docs" / "pipeline.md").read_text(encoding="utf-8")
BROKEN = str(Path(__file__).with_name("broken.py"))


@pytest.fixture(scope="module", autouse=True)
def short() -> Iterator[None]:
    """Drives of 0.8 s: what the relations say of whole ones is asked in test_relations.py."""
    drives.recorded.cache_clear()
    with mock.patch.object(drives, "DURATION_S", 0.8):
        yield
    drives.recorded.cache_clear()


def asked(*words: str) -> Result:
    return CliRunner().invoke(main, ["check", *words])


def test_the_documents_example_prints_a_line_for_every_relation_and_all_hold() -> None:
    (command,) = re.findall(r"^python3 dev\.py run simbench check (.+)$", DOCUMENT, re.MULTILINE)
    assert f"Example: simbench check {command}\n" in str(main.commands["check"].help) + "\n"
    done = asked(*shlex.split(command))
    assert done.exit_code == 0, done.output
    *lines, last = done.output.splitlines()
    assert len(lines) == len(RELATIONS)
    for relation, line in zip(RELATIONS, lines, strict=True):
        assert re.match(rf"{relation.name} +{relation.says} +holds +\S", line), line
    assert last == f"static_projection: {len(RELATIONS)} of {len(RELATIONS)} hold"


def test_the_document_names_every_relation() -> None:
    for relation in RELATIONS:
        assert f"| {relation.name} |" in DOCUMENT


def test_what_falls_over_and_what_says_nothing_fails() -> None:
    fallen = asked(f"{BROKEN}:FallsOver", "--quick")
    assert fallen.exit_code == 1 and f"0 of {len(RELATIONS)} hold\n" in fallen.output, fallen.output
    silent = asked(f"{BROKEN}:Silent", "--quick")
    assert silent.exit_code == 1 and f"1 of {len(RELATIONS)} hold, 8 cannot be said" in silent.output


def test_a_pipeline_that_is_not_there_is_bad_input() -> None:
    done = asked("robus")
    assert done.exit_code == 2 and "did you mean 'robust'?" in done.output


def test_quick_takes_the_fewest_seeds_that_allow_an_interval() -> None:
    assert len(QUICK_SEEDS) == 6 and SEEDS[:6] == QUICK_SEEDS
