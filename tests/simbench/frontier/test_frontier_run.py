"""A frontier as a user runs it: resumable, honest about failures, written as requirements."""

from __future__ import annotations

import csv
import html
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
import yaml
from click.testing import CliRunner, Result

from scenarios.seeding import stream
from simbench.case import Job
from simbench.cli import main
from simbench.stage import Stage, stage
from simbench.stress.axes import Point
from simbench.stress.ledger import Outcome
from tests.simbench.campaign.support import keep_first, rows_in
from tests.simbench.support import staged

OFFSET = "timing.trigger_offset_ms"


def run(out: Path, *words: str, pipeline: str = "robust") -> Result:
    whole = ("frontier", "overtake-approach", "--system", "car", "--pipeline", pipeline, "--jobs", "1")
    return CliRunner().invoke(main, [*whole, *words, "--out", str(out)], prog_name="simbench")


def bench(status: Callable[[float, int], str] = lambda *_: "ok") -> Any:
    """Instead of recordings: a run keeps its precision up to about 100 of whatever is varied."""

    def outcomes_of(task: tuple[Point, Job]) -> tuple[Outcome, ...]:
        (level,), job = task
        breaks = 100.0 + 10.0 * float(stream(job.seed, "breaks").normal())
        said = status(float(level), job.seed)
        values = {"precision": 0.95 + 0.0005 * (breaks - float(level)), "mae_m.smooth": 0.1}
        given: dict[str, float | None] = {name: v if said == "ok" else None for name, v in values.items()}
        return tuple(
            Outcome(
                point=task[0], seed=job.seed, pipeline=name, status=said, why=None, values=given, command="",
                seconds={"sensors": 1.0},
            )
            for name in (*job.pipelines, "oracle")
        )  # fmt: skip

    return mock.patch("simbench.stress.run.outcomes_of", outcomes_of)


def entries(out: Path) -> list[dict[str, Any]]:
    return yaml.safe_load((out / "requirements.yaml").read_text(encoding="utf-8"))["requirements"]


LIMITS = ("--limit", "precision>=0.95", "--limit", "mae_m<=0.3")


def test_a_requirement_names_its_number_interval_runs_and_scenarios(tmp_path: Path) -> None:
    with bench():
        done = run(tmp_path, "--along", f"{OFFSET}=0:150", *LIMITS, "--seeds", "0-29")
    assert done.exit_code == 0, done.output
    content = yaml.safe_load((tmp_path / "requirements.yaml").read_text(encoding="utf-8"))
    assert content["scenarios"] == ["overtake-approach"] and content["seeds"] == "0-29"
    together, precision, error = content["requirements"]
    low, high = together["interval_95"]
    assert low <= together["safe_to"] < together["best_estimate"] < high
    assert together["best_estimate"] == pytest.approx(100 - 1.28 * 10, abs=6)
    assert together["requirement"] == f"{OFFSET} <= {together['safe_to']:g} ms"
    assert together["limit"] == "precision>=0.95 and mae_m.smooth<=0.3" and together["runs"] == 30
    assert precision["safe_to"] == pytest.approx(together["safe_to"], abs=3), "but for the draws"
    assert error["safe_to"] == 150
    assert f"robust is safe to >= {together['safe_to']:g} ms (best estimate" in done.output
    assert "robust is safe to >= 150 ms (the whole range)" in done.output
    rows = list(csv.DictReader((tmp_path / "requirements.csv").open(encoding="utf-8")))
    assert [row["requirement"] for row in rows] == [entry["requirement"] for entry in entries(tmp_path)]
    page = (tmp_path / "frontier.html").read_text(encoding="utf-8")
    assert page.count('<svg class="plot"') == 3 and "<script" not in page
    assert together["said"] in html.unescape(page)


def test_a_number_is_rounded_to_the_safe_side(tmp_path: Path) -> None:
    with bench():
        run(tmp_path, "--along", f"{OFFSET}=0:150", *LIMITS[:2], "--seeds", "0-7", "--functional", "mean")
    (entry,) = entries(tmp_path)
    assert entry["safe_to"] == int(entry["safe_to"]) and entry["safe_to"] < entry["best_estimate"]


def test_the_same_command_goes_on_where_it_stopped_and_other_limits_use_the_same_recordings(
    tmp_path: Path,
) -> None:
    words = ("--along", f"{OFFSET}=0:150", "--seeds", "0-5")
    with bench():
        run(tmp_path, *words, *LIMITS)
        first = {name: (tmp_path / name).read_bytes() for name in ("requirements.yaml", "requirements.csv")}
        rows = rows_in(tmp_path / OFFSET)
        keep_first(tmp_path / OFFSET, 29)
        again = run(tmp_path, *words, *LIMITS)
        assert "29 of 60 recordings are there already" in again.stderr
        assert first == {name: (tmp_path / name).read_bytes() for name in first}
        assert rows_in(tmp_path / OFFSET) == rows
        other = run(tmp_path, *words, "--limit", "precision>=0.97")
    assert "60 of 60 recordings are there already" in other.stderr


def test_a_run_that_failed_does_not_meet_the_limit(tmp_path: Path) -> None:
    def crashes(level: float, seed: int) -> str:
        return "pipeline_error" if level > 40 and seed < 10 else "ok"

    with bench(crashes):
        done = run(tmp_path, "--along", f"{OFFSET}=0:150", *LIMITS, "--seeds", "0-19")
    assert done.exit_code == 1
    assert entries(tmp_path)[0]["best_estimate"] == pytest.approx(40, abs=12)
    with bench(lambda *_: "bench_error"):
        broken = run(tmp_path / "b", "--along", f"{OFFSET}=0:150", *LIMITS, "--seeds", "0-5")
    assert broken.exit_code == 3 and "robust breaks it at 0 ms already" in broken.output
    assert entries(tmp_path / "b")[0]["requirement"] is None


def test_few_runs_illustrate_and_every_axis_is_a_requirement_of_its_own(tmp_path: Path) -> None:
    words = ("--along", f"{OFFSET}=0:150", "--along", "motion.flex_deg=0:2", *LIMITS[:2])
    with bench():
        done = run(tmp_path, *words, "--seeds", "0-3")
    assert done.output.count("n = 4 runs: illustration") == 2 and "no bound" in done.output
    offset, flex = entries(tmp_path)
    assert (offset["axis"], offset["unit"]) == (OFFSET, "ms") and offset["safe_to"] is None
    assert (flex["axis"], flex["unit"]) == ("motion.flex_deg", "deg RMS") and flex["best_estimate"] is None


def test_twenty_runs_without_a_failure_say_what_they_show(tmp_path: Path) -> None:
    with bench():
        done = run(tmp_path, "--along", "motion.flex_deg=0:2", *LIMITS[:2], "--seeds", "0-19")
    assert "20 runs without a failure show a share of 0.86; 0.9 takes 29" in done.output
    assert "not shown safe anywhere (not broken up to 2 deg RMS)" in done.output


def test_by_default_there_are_as_many_runs_as_a_share_of_nine_in_ten_takes(tmp_path: Path) -> None:
    with bench():
        done = run(tmp_path, "--along", "motion.flex_deg=0:2", *LIMITS[:2])
    (entry,) = entries(tmp_path)
    assert entry["runs"] == 40 >= 29 and entry["safe_to"] == 2.0, done.output
    assert "without a failure show a share" not in done.output
    document = (Path(__file__).parents[3] / "docs" / "frontier.md").read_text(encoding="utf-8")
    assert "| `--seeds 0-39` (default) |" in document


def test_a_logistic_curve_is_of_shares(tmp_path: Path) -> None:
    words = ("--along", f"{OFFSET}=0:150", *LIMITS[:2], "--assume-monotone")
    refused = run(tmp_path, *words, "--functional", "mean")
    assert refused.exit_code == 2 and "for shares" in refused.stderr
    with bench():
        run(tmp_path, *words)
    (entry,) = entries(tmp_path)
    assert entry["safe_to"] < entry["best_estimate"] and "logistic" in entry["holds_for"]


@pytest.fixture
def short() -> Iterator[None]:
    def cut(job: Job) -> Stage:
        coarse = staged(
            job.system, job.seed, scenario=job.scenario, duration_s=0.6, columns=128, size_px=(160, 100),
            background=True,
        )  # fmt: skip
        return replace(coarse, faults=stage(job).faults)

    with mock.patch("simbench.run.stage", cut):
        yield


def test_real_recordings_are_searched(short: None, tmp_path: Path) -> None:
    words = ("--along", f"{OFFSET}=0:400", "--limit", "precision>=0.3", "--seeds", "0")
    done = run(tmp_path, *words, pipeline="static_projection")
    assert done.exit_code == 0, done.output
    assert 10 <= len(rows_in(tmp_path / OFFSET)) <= 16 and "static_projection" in done.output
