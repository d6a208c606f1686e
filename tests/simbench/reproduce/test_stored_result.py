"""What the documents say is what the stored reproduction found, and what the bench still measures."""

from __future__ import annotations

from pathlib import Path

import pytest

from simbench.reproduce.answer import Answer, read_answer
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD
from simbench.reproduce.findings import as_markdown
from simbench.reproduce.levels import LEVELS, NONE_FAULTS
from simbench.reproduce.plan import FULL, asks, board_asks, drives
from simbench.run import run_job

DOCS = Path(__file__).parents[3] / "docs"
COMMAND = "simbench reproduce shen2023"
AGAIN = f"run `{COMMAND}` again, and store its result.json and findings.md in docs"


@pytest.fixture(scope="module")
def stored() -> Answer:
    file = DOCS / "shen2023" / "result.json"
    return read_answer(file.read_text(), str(file))


def test_the_stored_result_is_of_the_whole_and_nothing_failed(stored: Answer) -> None:
    assert stored.size == FULL and stored.failures == ()
    assert stored.runs == drives(asks(FULL)) + len(board_asks(FULL)), AGAIN
    named = {fit.system: [(level.name, level.bound) for level in fit.levels] for fit in stored.fits}
    assert named == {s: [(one.name, one.bound) for one in levels] for s, levels in LEVELS.items()}, AGAIN


def test_the_findings_are_made_of_the_stored_result(stored: Answer) -> None:
    assert (DOCS / "findings.md").read_text() == as_markdown(stored, COMMAND), AGAIN


def test_what_the_readme_says_of_the_paper_stands_in_the_findings() -> None:
    readme = (DOCS.parent / "README.md").read_text()
    section = readme.split("## The paper, reproduced\n")[1].split("\n## ")[0]
    said = " ".join(section.split())
    assert f"the paper's experiment {drives(asks(FULL)):,} times" in said
    told = " ".join((DOCS / "findings.md").read_text().split()).split(" * ")
    quoted = [one for line in said.split(" * ")[1:] for one in [line.split(" ## ")[0].strip()]]
    assert len(quoted) >= 3
    for line in quoted:
        assert any(line == one.split(" ## ")[0].strip() for one in told), line


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: cell.name)
def test_a_run_of_the_stored_tables_gives_the_same_again(stored: Answer, cell: object) -> None:
    """The first seed without errors. Other processors and libraries differ in the last digits."""
    where = next(one for one in CELLS if one is cell)
    table = next(one for one in stored.conditions[0].cells if one.cell == where.name)
    names = (BASELINE, GROUND, METHOD)
    for case in run_job(where.job(0, NONE_FAULTS, names)).cases:
        if case.pipeline in names:
            values = {row.metric: row.value for row in case.rows}
            assert values["tpr"] == pytest.approx(table.pipelines[case.pipeline].points[0], abs=1e-6), AGAIN
            first = table.mae_gnss_m[case.pipeline].points[0]
            assert values["mae_m.smooth.gnss"] == pytest.approx(first, abs=1e-6), AGAIN
