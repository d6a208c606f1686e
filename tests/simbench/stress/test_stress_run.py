"""Stress tests as a user runs them: resumable, the same however they are run, honest about what failed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest import mock

import pytest
from click.testing import CliRunner, Result

from scenarios.errors import BadInput
from simbench.case import Job
from simbench.cli import main
from simbench.stage import Stage, stage
from simbench.stress.ledger import NAME, Ledger, Outcome
from simbench.stress.table import cells, worst
from tests.simbench.cheats import named
from tests.simbench.support import staged


def cut(job: Job) -> Stage:
    at = stage(job)
    coarse = staged(
        job.system, job.seed, scenario=job.scenario, duration_s=0.6, columns=128, size_px=(160, 100),
        background=True,
    )  # fmt: skip
    return replace(coarse, faults=at.faults)


@pytest.fixture
def short() -> Iterator[None]:
    with mock.patch("simbench.run.stage", cut):
        yield


WORDS = (
    "stress", "overtake-approach", "--vary", "timing.trigger_offset_ms=0:100:2", "--vary",
    "detector.edge_error=0,0.1", "--pipeline", "static_projection", "--seeds", "0-1", "--jobs", "1",
)  # fmt: skip


def run(*words: str) -> Result:
    return CliRunner().invoke(main, words, prog_name="simbench")


def outcome(pipeline: str = "robust", seed: int = 0, status: str = "ok", **values: float | None) -> Outcome:
    return Outcome(
        point=(1.0, "A"), seed=seed, pipeline=pipeline, status=status, why=None, values=values,
        command="again", seconds={"sensors": 1.0},
    )  # fmt: skip


def test_a_stress_test_that_was_stopped_goes_on_to_the_same_table(short: None, tmp_path: Path) -> None:
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    first = run(*WORDS, "--out", str(whole))
    assert first.exit_code == 0, first.output
    page = (whole / "stress.html").read_text(encoding="utf-8")
    assert "4 points of a grid, 2 seeds each" in page and "<script" not in page
    assert page.count('<svg class="plot"') == 6
    lines = (whole / NAME).read_text(encoding="utf-8").splitlines(keepends=True)
    assert len(lines) == 1 + 4 * 2
    stopped.mkdir()
    (stopped / NAME).write_text("".join(lines[:4]) + lines[4][:50], encoding="utf-8")
    second = run(*WORDS, "--out", str(stopped))
    assert second.exit_code == 0 and "3 of 8 recordings are there already" in second.stderr
    assert (stopped / "stress.csv").read_bytes() == (whole / "stress.csv").read_bytes()
    third = run(*WORDS, "--out", str(stopped))
    assert "8 of 8 recordings are there already" in third.stderr and "none of them now" in (
        stopped / "stress.html"
    ).read_text(encoding="utf-8")


def test_a_ledger_of_another_test_is_refused(short: None, tmp_path: Path) -> None:
    Ledger(tmp_path, {"scenario": "one"})
    with pytest.raises(BadInput, match="another stress test"):
        Ledger(tmp_path, {"scenario": "two"})
    before = (tmp_path / NAME).read_bytes()
    refused = run(*WORDS, "--out", str(tmp_path))
    assert refused.exit_code == 2 and "another stress test" in refused.stderr
    assert (tmp_path / NAME).read_bytes() == before


@pytest.mark.parametrize("line", ["{broken", "[]", "3", "[3]", '[{"point": [1]}]'])
def test_a_broken_line_of_a_ledger_costs_one_sentence(tmp_path: Path, line: str) -> None:
    Ledger(tmp_path, {"a": 1})
    with (tmp_path / NAME).open("a", encoding="utf-8") as file:
        file.write(line + "\n")
    with pytest.raises(BadInput, match="line 2: is no outcome"):
        Ledger(tmp_path, {"a": 1})


def test_a_ledger_gives_back_what_was_put_in(tmp_path: Path) -> None:
    kept = (outcome(tpr=0.5, precision=None), outcome("oracle", tpr=1.0))
    Ledger(tmp_path, {"a": 1}).add(kept)
    assert Ledger(tmp_path, {"a": 1}).done == {((1.0, "A"), 0): kept}


def test_a_pipeline_that_fails_is_a_run_without_success_and_exit_code_1(short: None, tmp_path: Path) -> None:
    words = list(WORDS)
    words[words.index("static_projection")] = named("Raises")[0]
    done = run(*words, "--out", str(tmp_path))
    assert done.exit_code == 1, done.output
    page = (tmp_path / "stress.html").read_text(encoding="utf-8")
    assert "8 of 16 runs have no score" in page
    entries = [json.loads(line) for line in (tmp_path / NAME).read_text().splitlines()[1:]]
    assert {e["status"] for entry in entries for e in entry} == {"pipeline_error", "ok"}


def test_the_worst_runs_are_those_that_failed_then_the_least_precise() -> None:
    good, poor = outcome(precision=0.9, seed=1), outcome(precision=0.2, seed=2)
    crashed = outcome(status="pipeline_error", precision=None, seed=3)
    assert worst([good, poor, crashed], "robust", 2) == (crashed, poor)


def test_points_are_combined_over_seeds_and_failures_counted() -> None:
    runs = [outcome(seed=i, tpr=0.1 * i) for i in range(6)] + [outcome(seed=6, status="timeout", tpr=None)]
    (cell,) = cells(runs, ("tpr",))
    assert cell.summary.mean == pytest.approx(0.25) and cell.summary.n == 6
    assert (cell.summary.missing, cell.failed) == (1, 1) and cell.summary.ci95 is not None


def test_the_worst_runs_are_shown_with_their_pictures(tmp_path: Path) -> None:
    done = run(
        "stress", "overtake-approach", "--vary", "timing.trigger_offset_ms=0,100", "--pipeline",
        "static_projection", "--seeds", "0", "--jobs", "1", "--set", "systems.car.duration_s=0.3", "--out",
        str(tmp_path),
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    page = (tmp_path / "stress.html").read_text(encoding="utf-8")
    assert page.count("<figure>") == page.count("data:image/jpeg") == 2
    assert page.index("Worst runs") < page.index("raw box, seed 0") and "points right" in page
