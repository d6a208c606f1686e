"""`result.json` and what lies beside it: complete, repeatable to the byte, and no number without a reason."""

from __future__ import annotations

import copy
import csv
import io
import json
import math
import shlex
from dataclasses import replace
from pathlib import Path
from unittest import mock

import pytest
from click.testing import CliRunner

from scenarios.load import load_scenario
from simbench.campaign.jobs import run_jobs
from simbench.case import Job, JobResult
from simbench.result_file import document
from simbench.results import record_of, reproduce, write
from simbench.score.metrics import METRICS
from simbench.stage import Stage, stage
from tests.simbench import cheats
from tests.simbench.support import staged

FAULTS = ("timing.trigger_offset_ms={offset_ms: 50, jitter_ms: 5}", "detector.edge_error=0.03")


def shortened(job: Job) -> Stage:
    at = stage(job)
    coarse = staged(
        job.system, job.seed, scenario=job.scenario, duration_s=0.8, columns=128, size_px=(320, 200),
        background=True,
    )  # fmt: skip
    return replace(coarse, faults=at.faults)


def results(seeds: tuple[int, ...] = (0, 3)) -> tuple[JobResult, ...]:
    jobs = [
        Job(
            scenario="overtake-recede",
            system=system,
            seed=seed,
            pipelines=("probabilistic", *cheats.named("ReturnsNaN")),
            faults=FAULTS,
        )
        for system in ("car", "wearable")
        for seed in seeds
    ]
    with mock.patch("simbench.run.stage", shortened):
        return run_jobs(jobs, 1)


@pytest.fixture(scope="module")
def found() -> tuple[JobResult, ...]:
    return results()


@pytest.fixture(scope="module")
def content(found: tuple[JobResult, ...]) -> dict[str, list[dict[str, object]]]:
    return document(map(record_of, found), {"python": "test"})


def test_the_same_seeds_give_the_same_bytes_but_for_timings(found: tuple[JobResult, ...]) -> None:
    texts = []
    for run in ([r for r in found if r.job.seed == 3], results((3,))):
        whole = copy.deepcopy(document(map(record_of, run), {}))
        assert whole.pop("timings")
        texts.append(json.dumps(whole, allow_nan=False))
    assert texts[0] == texts[1]


def test_every_case_has_one_row_per_metric(content: dict[str, list[dict[str, object]]]) -> None:
    assert content["schema"] == "simbench-result/1"
    keys = ("scenario", "system", "pipeline", "seed", "faults", "calibration")
    cases = {tuple(case[k] for k in keys) for case in content["cases"]}
    assert len(cases) == len(content["cases"]) == 12
    rows = [(*(row[k] for k in keys), row["metric"]) for row in content["rows"]]
    assert len(rows) == len(set(rows)) == 12 * len(METRICS)
    assert {row[:-1] for row in rows} == cases


def test_a_row_has_a_finite_value_or_a_reason(content: dict[str, list[dict[str, object]]]) -> None:
    better = {metric.name: metric.better for metric in METRICS}
    for row in content["rows"]:
        assert isinstance(row["seed"], int) and isinstance(row["n"], int)
        assert row["better"] == better[row["metric"]] and row["unit"]  # type: ignore[index]
        if row["value"] is None:
            assert row["why"]
        else:
            assert isinstance(row["value"], float) and math.isfinite(row["value"]) and "why" not in row


def test_a_case_that_failed_says_why_in_every_row(content: dict[str, list[dict[str, object]]]) -> None:
    (name,) = cheats.named("ReturnsNaN")
    for case in content["cases"]:
        assert (case["status"] == "ok") == (case["pipeline"] != name)
        assert bool(case["why"]) == (case["pipeline"] == name)
    assert all("pipeline_error" in row["why"] for row in content["rows"] if row["pipeline"] == name)  # type: ignore[operator]


def test_receipts_and_faults_stand_in_every_case(content: dict[str, list[dict[str, object]]]) -> None:
    for case in content["cases"]:
        assert set(case["fault_specs"]) == {"timing.trigger_offset_ms", "detector.edge_error"}  # type: ignore[call-overload]
        assert {r["fault"] for r in case["receipts"]} == set(case["fault_specs"])  # type: ignore[attr-defined, call-overload]
        assert {"requested", "realised", "measured", "status"} <= set(case["receipts"][0])  # type: ignore[index]
    digests = {(c["system"], c["seed"]): c["scenario_sha256"] for c in content["cases"]}
    assert len(set(digests.values())) == 2  # per seed: both systems are of one scenario


def test_a_summary_stands_for_every_group_and_metric(content: dict[str, list[dict[str, object]]]) -> None:
    assert len(content["summary"]) == 2 * 3 * len(METRICS)
    for item in content["summary"]:
        assert item.get("ci95") is None  # two runs are an illustration


def test_rows_of_a_found_calibration_can_be_told_from_those_of_the_true_one(
    found: tuple[JobResult, ...], tmp_path: Path
) -> None:
    other = replace(found[0], job=replace(found[0].job, calibration="found:my.yaml", found_in="my.yaml"))
    content = document(map(record_of, (found[0], other)), {})
    for part in ("rows", "cases", "timings", "summary"):
        told = [item["calibration"] for item in content[part]]
        assert told == ["true"] * (len(told) // 2) + ["found"] * (len(told) // 2) and told
    assert all("--calibration found:my.yaml" in c["command"] for c in content["cases"][3:])
    assert all(item["n"] <= 1 for item in content["summary"])  # never averaged over both
    write((found[0], other), tmp_path, {})
    for table in ("pairs", "frames"):
        rows = csv.DictReader(io.StringIO((tmp_path / f"{table}.csv").read_text(encoding="utf-8")))
        assert {row["calibration"] for row in rows} == {"true", "found"}


def test_timings_are_rows_of_the_same_shape(content: dict[str, list[dict[str, object]]]) -> None:
    names = {row["metric"] for row in content["timings"]}
    assert {"latency_ms.p50", "latency_ms.p99", "latency_ms.ground.p50", "latency_ms.smooth.p50"} <= names
    for row in content["timings"]:
        assert row["unit"] == "ms" and row["better"] == "lower"
        assert isinstance(row["value"], float) and row["value"] >= 0.0


def test_the_files_hold_the_same_as_the_document(found: tuple[JobResult, ...], tmp_path: Path) -> None:
    write(found, tmp_path, {"python": "test"})
    content = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert content == document(map(record_of, found), {"python": "test"})
    for table, metric in (("pairs", "tpr"), ("frames", "coverage.raw")):
        rows = list(csv.DictReader(io.StringIO((tmp_path / f"{table}.csv").read_text(encoding="utf-8"))))
        counted = sum(
            row["n"] for row in content["rows"] if row["metric"] == metric and row["value"] is not None
        )
        assert len(rows) == counted
    for result in found:
        path = tmp_path / f"scenario-{result.scenario.name}-{result.job.seed}.yaml"
        assert load_scenario(str(path)).resolve(99) == result.scenario
    assert not list(tmp_path.glob(".*"))


def words(command: str) -> list[str]:
    program, *rest = shlex.split(command)
    assert program == "simbench"
    return rest


def test_the_command_of_a_case_makes_the_same_job(content: dict[str, list[dict[str, object]]]) -> None:
    from simbench.cli import main

    planned: list[Job] = []
    with mock.patch("simbench.commands.run.execute", lambda jobs, *_: planned.extend(jobs)):
        for case in content["cases"]:
            done = CliRunner().invoke(main, words(str(case["command"])))
            assert done.exit_code == 0, done.output
            (job,) = planned
            assert (job.system, job.seed, job.faults) == (case["system"], case["seed"], FAULTS)
            assert case["pipeline"] in (*job.pipelines, "oracle")
            planned.clear()


def test_a_command_survives_spaces_and_quotes() -> None:
    job = Job(
        scenario="my lot/it's.yaml", system="car", seed=7, pipelines=(), size_px=(320, 200),
        faults=("timing.trigger_offset_ms={offset_ms: 5}",), images="gl",
    )  # fmt: skip
    assert words(reproduce(job, ["my file.py:Mine"])) == [
        "run", "my lot/it's.yaml", "--system", "car", "--pipeline", "my file.py:Mine", "--seeds", "7",
        "--faults", "timing.trigger_offset_ms={offset_ms: 5}", "--alone", "--size", "320x200",
        "--images", "gl",
    ]  # fmt: skip


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    from scenarios.errors import BadInput
    from simbench.files import prepare_folder, write_text

    (tmp_path / "file").write_text("", encoding="utf-8")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(BadInput, match="cannot write to"):
            prepare_folder(place)
    with pytest.raises(BadInput, match="cannot write"):
        write_text(tmp_path / "nowhere" / "result.json", "{}")
    write_text(tmp_path / "kept", "old")
    (tmp_path / "folder").mkdir()
    with pytest.raises(BadInput):
        write_text(tmp_path / "folder", "new")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder", "kept"]
