"""`simbench explain` as a user runs it: which runs it makes, that only the causes differ, what it refuses."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from click.testing import CliRunner, Result

from scenarios.fault_set import FaultSet, parse_fault_arguments
from scenarios.faults import FAULTS
from scenarios.faults.spec import Severity
from scenarios.severity import SEVERITIES
from simbench.case import Job
from simbench.cli import main
from simbench.explain.answer import Answer, answer
from simbench.explain.attribution import Attribution
from simbench.explain.causes import Question, question_of_scenario, spelt_out
from simbench.explain.dividends import dividends, members, shapley
from simbench.explain.permutations import MIN_PAIRS
from simbench.explain.values import Measured, value_of
from simbench.stage import Stage, stage
from simbench.stress.ledger import NAME, Ledger, Outcome
from simbench.switches import SWITCHES, switched
from tests.simbench.campaign.support import keep_first, rows_in
from tests.simbench.cheats import named
from tests.simbench.support import staged


def cut(job: Job) -> Stage:
    at = stage(job)
    coarse = staged(
        job.system, job.seed, duration_s=0.6, columns=512, size_px=None
    )  # fmt: skip
    return replace(coarse, rig=switched(coarse.rig, job.off), faults=at.faults)


@pytest.fixture
def short() -> Iterator[None]:
    with mock.patch("simbench.run.stage", cut):
        yield


WORDS = (
    "explain", "overtake-approach", "--faults", "calibration.rotation_deg=3", "--faults",
    "reference.noise_cm=5", "--cause", "calibration.rotation_deg", "--cause", "reference.noise_cm",
    "--pipeline", "static_projection", "--seeds", "0-2", "--jobs", "1",
)  # fmt: skip


def run(*words: str) -> Result:
    return CliRunner().invoke(main, words, prog_name="simbench")


def asked(*faults: str, chosen: tuple[str, ...] = (), seeds: tuple[int, ...] = (0,)) -> Question:
    return question_of_scenario(
        "overtake-approach", system=None, pipelines=("static_projection",), faults=faults, changes=(),
        boxes=None, seeds=seeds, chosen=chosen,
    )  # fmt: skip


# -- causes -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("severity", SEVERITIES, ids=lambda s: f"{s.fault}-{s.profile}")
def test_a_set_spelt_out_is_the_same_set(severity: Severity) -> None:
    body = severity.profile or "car"
    own = FaultSet().override(parse_fault_arguments((f"{severity.fault}@3",), body))
    assert len(own) == 1
    assert own.override(parse_fault_arguments(spelt_out(own))) == own


def test_a_run_with_some_causes_names_these_faults_and_what_of_the_bench_is_off() -> None:
    question = asked("timing.trigger_offset_ms=50", "motion.vibration_deg=1")
    assert question.causes == ("motion.vibration_deg", "timing.trigger_offset_ms", *SWITCHES)
    job = question.job(0, ("timing.trigger_offset_ms", "bench.spin_phase"))
    assert job.faults[0] == "none" and len(job.faults) == 2
    assert job.faults[1].startswith("timing.trigger_offset_ms={")
    assert job.off == ("bench.rolling_scan", "bench.reference_rate")
    assert question.job(0, question.causes) == question.whole[0]


def test_what_is_not_chosen_as_a_cause_stays_on() -> None:
    question = asked(
        "timing.trigger_offset_ms=50", "motion.vibration_deg=1", chosen=("motion.vibration_deg",)
    )
    clean = question.job(0, ())
    assert question.causes == ("motion.vibration_deg",) and clean.off == ()
    assert [text.partition("=")[0] for text in clean.faults] == ["none", "timing.trigger_offset_ms"]


# -- the command --------------------------------------------------------------------------------------------


def rows(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "explain.csv").read_text(encoding="utf-8").splitlines()))


def test_an_explanation_names_the_cause_and_goes_on_where_it_stopped(short: None, tmp_path: Path) -> None:
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    done = run(*WORDS, "--out", str(whole))
    assert done.exit_code == 0, done.output
    page = (whole / "explain.html").read_text(encoding="utf-8")
    assert "All 4 sets of them were run, with the same 3 seeds each" in page and "<script" not in page
    found = {
        (row["metric"], row["causes"]): (float(row["mean"]), float(row["sd"]))
        for row in rows(whole)
        if row["kind"] == "dividend" and row["pipeline"] == "static_projection" and row["mean"]
    }
    assert found["precision", "calibration.rotation_deg"][0] > 0.05
    for name in ("reference.noise_cm", "calibration.rotation_deg + reference.noise_cm"):
        assert found["precision", name] == (0.0, 0.0)  # exactly: no draw of another moved
    noise = {
        row["kind"]: row["mean"]
        for row in rows(whole)
        if row["metric"] == "budget_lateral_m.reference_noise" and row["pipeline"] == "static_projection"
    }
    assert noise["budget clean"] != noise["budget whole"] != ""
    budget = [row for row in rows(whole) if row["kind"] == "budget whole" and row["mean"]]
    parts = [float(r["mean"]) for r in budget if r["metric"].startswith("budget_lateral_m.")]
    assert len(parts) == 2 * 9  # of the pipeline and the oracle
    assert sum(parts[:8]) == pytest.approx(parts[8], abs=1e-9)

    assert len(rows_in(whole)) == 4 * 3
    stopped.mkdir()
    (stopped / NAME).write_bytes((whole / NAME).read_bytes())
    keep_first(stopped, 5)
    again = run(*WORDS, "--out", str(stopped))
    assert again.exit_code == 0 and "5 of 12 recordings are there already" in again.stderr
    assert (stopped / "explain.csv").read_bytes() == (whole / "explain.csv").read_bytes()


def test_the_runs_in_a_folder_are_explained_as_they_were(short: None, tmp_path: Path) -> None:
    made = run(
        "run", "overtake-approach", "--system", "car", "--faults", "calibration.rotation_deg=3", "--off",
        "bench.spin_phase", "--pipeline", "static_projection", "--seeds", "2-3", "--images", "none", "--jobs",
        "1", "--out", str(tmp_path / "run"),
    )  # fmt: skip
    assert made.exit_code == 0, made.output
    cases = json.loads((tmp_path / "run" / "result.json").read_text(encoding="utf-8"))["cases"]
    for case in cases:
        assert case["off"] == ["bench.spin_phase"] and "--off bench.spin_phase" in case["command"]
    done = run("explain", str(tmp_path / "run"), "--jobs", "1", "--out", str(tmp_path / "why"))
    assert done.exit_code == 0, done.output
    rows = rows_in(tmp_path / "why")
    assert len(rows) == 2 * 8  # two seeds; rotation, rolling scan, reference rate
    outcomes = [json.loads(value)[0] for _, value in rows.values()]
    full = [o for o in outcomes if len(o["point"]) == 3]
    with_faults = [c for c in cases if c["fault_specs"] and c["pipeline"] == "static_projection"]
    rows_of_run = json.loads((tmp_path / "run" / "result.json").read_text(encoding="utf-8"))["rows"]
    for outcome, case in zip(full, with_faults, strict=True):
        (before,) = [
            r["value"] for r in rows_of_run
            if r["metric"] == "precision" and r["pipeline"] == "static_projection"
            and r["seed"] == case["seed"] and r["faults"] == case["faults"]
        ]  # fmt: skip
        assert outcome["values"]["precision"] == before


def test_a_pipeline_that_fails_is_told_and_exit_code_1(short: None, tmp_path: Path) -> None:
    words = list(WORDS)
    words[words.index("static_projection")] = named("Raises")[0]
    done = run(*words, "--seeds", "0-1", "--out", str(tmp_path))
    assert done.exit_code == 1, done.output
    assert "8 of 16 runs have no score" in (tmp_path / "explain.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--cause", "motion.vibration"), "unknown cause 'motion.vibration'"),
        (("--faults", "none", "--cause", "calibration.rotation_deg"), "unknown cause"),
        (("--system", "wearable", "--faults", "timing.trigger_offset=3"), "unknown fault"),
        (("--seeds", "3-1"), "not a range of seeds"),
        (("--pipeline", "no_such"), "no_such"),
    ],
)  # fmt: skip
def test_bad_input_costs_one_sentence(words: tuple[str, ...], sentence: str, tmp_path: Path) -> None:
    done = run("explain", "overtake-approach", *words, "--out", str(tmp_path / "out"))
    assert done.exit_code == 2 and sentence in done.stderr and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_recorded_data_and_folders_that_hold_no_run_are_refused(tmp_path: Path) -> None:
    assert "cannot be switched off" in run("explain", "kitti:/nowhere").stderr
    assert "no folder of a run" in run("explain", str(tmp_path)).stderr
    assert (
        "--off: unknown part of the bench 'bench.spin'"
        in run("run", "overtake-approach", "--off", "bench.spin", "--out", str(tmp_path)).stderr
    )


# -- what counts as a value; many causes ---------------------------------------------------------------------


def outcome(point: tuple[str, ...], seed: int, value: float | None, status: str = "ok") -> Outcome:
    metrics = ("precision", "mae_m.smooth", "gross_rate.smooth")
    return Outcome(
        point=point, seed=seed, pipeline="static_projection", status=status, why=None,
        values=dict.fromkeys(metrics, value), command="", seconds={},
    )  # fmt: skip


def test_a_failed_pipeline_has_the_worst_value_and_a_failed_recording_none() -> None:
    failed, spoiled = outcome((), 0, None, "pipeline_error"), outcome((), 0, 0.7, "receipt_mismatch")
    assert [value_of(failed, m) for m in ("precision", "gross_rate.smooth", "mae_m.smooth")] == [
        0.0,
        1.0,
        None,
    ]
    assert value_of(spoiled, "precision") is None and value_of(outcome((), 0, 0.7), "precision") == 0.7


def pretended(question: Question, folder: Path, losses: np.ndarray, noise: float) -> Measured:
    """A ledger that is full already: a loss by mask, and noise of every run."""
    ledger, rng = Ledger(folder, {}), np.random.default_rng(4)
    for mask, loss in enumerate(losses):
        point = members(mask, question.causes)
        for seed in question.seeds:
            values = outcome(point, seed, 0.9 - float(loss) + noise * rng.normal())
            ledger.add((point, question.job(seed, point)), (values, replace(values, pipeline="oracle")))
    return Measured(question, ledger)


def seven(seeds: int) -> Question:
    """Four faults and the bench's own three causes."""
    faults = tuple(name for name in FAULTS if name.startswith("lidar."))[:4]
    return replace(asked(seeds=tuple(range(seeds))), causes=(*faults, *SWITCHES))


def precision_of(found: Answer) -> Attribution:
    return next(a for a in found.attributions if a.metric == "precision" and a.pipeline != "oracle")


def test_of_seven_causes_few_sets_are_measured_and_the_largest_is_named(tmp_path: Path) -> None:
    question, mask = seven(8), np.arange(1 << 7)
    losses = 0.3 * (mask & 1) + 0.1 * (mask >> 1 & 1) + 0.2 * (mask & 12 == 12)
    measured = pretended(question, tmp_path, losses, noise=0.0005)
    found = answer(measured)
    a, b, c, d, *_ = question.causes
    told = precision_of(found)
    assert found.pairs == MIN_PAIRS and found.reached and len(measured.masks) < 128
    assert told.named[0].causes == (a,) and {e.causes for e in told.named} >= {(a,), (b,), (c, d)}
    phi = [e.summary.mean for e in told.shapley]
    assert phi == pytest.approx([0.3, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0], abs=0.005)


def test_causes_that_act_in_no_order_are_sampled_until_every_set_is_known(tmp_path: Path) -> None:
    losses = 0.2 * np.random.default_rng(9).normal(size=1 << 7)
    losses[[0, -1]] = 0.0, 0.5
    measured = pretended(seven(6), tmp_path, losses, noise=0.001)
    found = answer(measured)
    told = precision_of(found)
    assert found.pairs is None and len(measured.masks) == 128
    assert all(e.sampling_se is None for e in told.shapley)
    exact = shapley(dividends(losses[:, None]))[:, 0]
    assert [e.summary.mean for e in told.shapley] == pytest.approx(exact, abs=0.005)
