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
from simbench.campaign.ledger import Done
from simbench.case import Job
from simbench.cli import main
from simbench.stage import Stage, stage
from simbench.stress.ledger import NAME, Ledger, Outcome, key_of
from simbench.stress.table import cells, worst
from tests.simbench.campaign.support import keep_first, rows_in
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


TASK = (
    (1.0, "A"), Job(scenario="overtake-approach", system="car", seed=0, pipelines=("robust",)),
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
    assert len(rows_in(whole)) == 4 * 2
    stopped.mkdir()
    (stopped / NAME).write_bytes((whole / NAME).read_bytes())
    keep_first(stopped, 3)
    second = run(*WORDS, "--out", str(stopped))
    assert second.exit_code == 0 and "3 of 8 recordings are there already" in second.stderr
    assert (stopped / "stress.csv").read_bytes() == (whole / "stress.csv").read_bytes()
    third = run(*WORDS, "--out", str(stopped))
    assert "8 of 8 recordings are there already" in third.stderr and "none of them now" in (
        stopped / "stress.html"
    ).read_text(encoding="utf-8")


def test_a_ledger_of_another_test_is_refused(short: None, tmp_path: Path) -> None:
    with Ledger(tmp_path, {"scenario": "one"}):
        pass
    with pytest.raises(BadInput, match=r"another stress test \(other scenario\)"):
        Ledger(tmp_path, {"scenario": "two"})
    before = (tmp_path / NAME).read_bytes()
    refused = run(*WORDS, "--out", str(tmp_path))
    assert refused.exit_code == 2 and "another stress test" in refused.stderr
    assert (tmp_path / NAME).read_bytes() == before


@pytest.mark.parametrize("value", ["{broken", "[3]", '[{"point": [1]}]', "3"])
def test_a_row_that_is_no_outcome_costs_one_sentence(tmp_path: Path, value: str) -> None:
    with Ledger(tmp_path, {"a": 1}) as ledger:
        ledger.rows.add(Done(key=key_of(TASK), value=value), 0)
        with pytest.raises(BadInput, match="a row is no outcome"):
            ledger.outcomes(TASK, ledger.rows.get(key_of(TASK)))


def test_a_ledger_gives_back_what_was_put_in(tmp_path: Path) -> None:
    kept = (outcome(tpr=0.5, precision=None), outcome("oracle", tpr=1.0))
    with Ledger(tmp_path, {"a": 1}) as ledger:
        assert ledger.missing([TASK]) == 1
        ledger.add(TASK, kept)
    with Ledger(tmp_path, {"a": 1}) as again:
        assert again.missing([TASK]) == 0 and again.outcomes(TASK, again.rows.get(key_of(TASK))) == kept


def test_a_recording_whose_worker_died_is_a_failure_of_the_bench_in_all_its_pipelines(tmp_path: Path) -> None:
    with Ledger(tmp_path, {"a": 1}) as ledger:
        row = Done(key=key_of(TASK), value=None, failure="its worker died 3 times: signal 9", status="died")
        ledger.rows.add(row, 0)
        found = ledger.outcomes(TASK, ledger.rows.get(row.key))
    assert [(o.pipeline, o.status, o.why) for o in found] == [
        (name, "bench_error", row.failure) for name in ("robust", "oracle")
    ]
    assert not any(value is not None for o in found for value in o.values.values())


@pytest.mark.parametrize("word", ["localhost", "here", ""])
def test_a_cluster_that_is_no_address_costs_one_sentence(word: str, tmp_path: Path) -> None:
    done = run(*WORDS, "--cluster", word, "--out", str(tmp_path))
    assert done.exit_code == 2 and "allowed: tcp://HOST:PORT, local" in done.stderr


def test_a_pipeline_that_fails_is_a_run_without_success_and_exit_code_1(short: None, tmp_path: Path) -> None:
    words = list(WORDS)
    words[words.index("static_projection")] = named("Raises")[0]
    done = run(*words, "--out", str(tmp_path))
    assert done.exit_code == 1, done.output
    page = (tmp_path / "stress.html").read_text(encoding="utf-8")
    assert "8 of 16 runs have no score" in page
    entries = [json.loads(value) for _, value in rows_in(tmp_path).values()]
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
