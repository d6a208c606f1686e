"""A suite from file to verdict, as its users run it: short drives, small pipelines."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree

import pytest

from scenarios.errors import BadInput
from simbench.suite import command as suite_command
from simbench.suite import run as suite_run
from simbench.suite.command import Request, run_suite
from simbench.suite.compare import compare_runs, plan_runs, save_baseline
from simbench.suite.plan import recordings_of

SUITE = """\
name: gate
description: A short drive.
seeds: 0-5
pipelines: [static_projection]
metrics: [precision]
limits: {precision: ">= 0.1", recall: ">= 0.1"}
blocks:
  clean:
    scenarios: [overtake-approach]
    change: [systems.car.duration_s=0.6]
    tags: [clean]
  late:
    scenarios: [overtake-approach]
    faults: [timing.trigger_offset_ms=50]
    change: [systems.car.duration_s=0.6]
    seeds: 0-1
    tags: [timing]
"""
SPOILED = """\
from fusion.pipelines.static_projection import StaticProjection
from dataclasses import replace

class Spoiled(StaticProjection):
    def update(self, measurement):
        output = super().update(measurement)
        return output and replace(output, objects=tuple(map(self.spoil, output.objects)))
    def spoil(self, found):
        {body}
"""
FEWER = "return replace(found, points=found.points[: len(found.points) // 4])"
BOOM = "raise RuntimeError('boom')"


@pytest.fixture
def ask(tmp_path: Path) -> Callable[..., int]:
    """Run the suite in a folder of its own, in this process."""
    (tmp_path / "suite.yaml").write_text(SUITE, encoding="utf-8")

    def run(text: str | None = None, **asked: object) -> int:
        if text is not None:
            (tmp_path / "suite.yaml").write_text(text, encoding="utf-8")
        request = Request(target=str(tmp_path / "suite.yaml"), out=tmp_path / "out", workers=1)
        return run_suite(replace(request, **asked))  # type: ignore[arg-type]

    return run


def spoiled(folder: Path, body: str) -> str:
    (folder / "mine.py").write_text(SPOILED.replace("{body}", body), encoding="utf-8")
    return f"{folder}/mine.py:Spoiled"


def test_a_run_answers_and_writes_what_ci_reads(ask: Callable[..., int], tmp_path: Path) -> None:
    assert ask() == 0
    out = tmp_path / "out"
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert result["verdict"]["outcome"] == "PASS"
    assert len(result["cases"]) == 2 * 8  # the oracle's too
    assert {row["block"] for row in result["rows"]} == {"clean", "late"}
    groups = {(s["block"], s["faults"]) for s in result["summary"]}
    assert groups == {("clean", "none"), ("late", "timing.trigger_offset_ms=50")}
    root = ElementTree.parse(out / "junit.xml").getroot()
    assert (root.get("errors"), root.get("failures"), root.get("skipped")) == ("0", "0", "0")
    seeds = [p.get("value") for p in root.iter("property") if p.get("name") == "seed"]
    assert sorted(seeds) == sorted([*"012345", *"01"])
    assert "PASS" in (out / "summary.md").read_text(encoding="utf-8")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page and "http" not in page.replace("http-equiv", "")
    assert "lidar.fog_mor_m" in page  # what is not exercised


def test_the_same_code_passes_as_identical_and_less_of_it_is_a_regression(
    ask: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SUITE.replace("metrics: [precision]", "metrics: [recall]").replace(
        'recall: ">= 0.1"', 'tpr: ">= 0"'
    )
    assert ask(text) == 0
    baseline = tmp_path / "base.json"
    assert save_baseline(tmp_path / "out", baseline) == 0
    assert ask(against=baseline, words="clean") == 0
    assert compare_runs(tmp_path / "out", baseline, changed=False, out=None) == 0
    assert "identical" in capsys.readouterr().out
    mine = spoiled(tmp_path, FEWER)
    named = text.replace("[static_projection]", f'["{mine}"]')
    assert ask(named) == 0
    other = baseline.read_text(encoding="utf-8").replace("/static_projection", "/mine.py:Spoiled")
    baseline.write_text(other, encoding="utf-8")
    assert ask(against=baseline, words="clean", resume=True) == 1
    assert "REGRESSION: 1 REGRESSION" in capsys.readouterr().out
    assert compare_runs(tmp_path / "out", baseline, changed=False, out=tmp_path / "compared") == 1
    assert (tmp_path / "compared" / "junit.xml").is_file()


def test_a_crash_is_told_and_the_rest_goes_on(
    ask: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = spoiled(tmp_path, BOOM)
    text = SUITE.replace("[static_projection]", f'[static_projection, "{mine}"]')
    assert ask(text, tags="timing") == 1
    said = capsys.readouterr().out
    assert "2 of 2 runs did not end well; seed 0: pipeline_error, RuntimeError: boom" in said
    root = ElementTree.parse(tmp_path / "out" / "junit.xml").getroot()
    assert int(root.get("errors", "0")) >= 2
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    good = [c for c in result["cases"] if c["pipeline"] == "static_projection"]
    assert {case["status"] for case in good} == {"ok"}
    with pytest.raises(BadInput, match="was run in part"):
        save_baseline(tmp_path / "out", tmp_path / "base.json")


def test_a_case_that_was_meant_and_has_no_result_is_told_and_never_left_out(ask: Callable[..., int]) -> None:
    with (
        mock.patch.object(suite_command, "recordings_of", lambda cases: recordings_of(cases)[1:]),
        pytest.raises(RuntimeError, match="1 cases were meant and have no result"),
    ):
        ask(seeds=(0,))


def test_resume_repeats_nothing_and_lf_only_what_failed(ask: Callable[..., int], tmp_path: Path) -> None:
    made: list[tuple[str, int]] = []
    honest = suite_run.run_job

    def counted(job: object) -> object:
        made.append((job.faults, job.seed))  # type: ignore[attr-defined]
        return honest(job)  # type: ignore[arg-type]

    with mock.patch.object(suite_run, "run_job", counted):
        assert ask(seeds=(0,)) == 0
        assert ask(seeds=(0, 1), resume=True) == 0
        assert sorted(seed for _, seed in made) == [0, 0, 1, 1]
        made.clear()
        assert ask(SUITE.replace("seeds: 0-1", 'seeds: 0-1\n    limits: {tpr: ">= 1.0"}'), seeds=(0,)) == 1
        made.clear()
        assert ask(last_failed=True, seeds=(0,)) == 1
        assert made == [(("timing.trigger_offset_ms=50",), 0)]
        assert ask(SUITE, seeds=(0,), words="clean") == 0
        assert ask(last_failed=True, seeds=(0,)) == 5


@pytest.mark.parametrize("asked", [{"words": "nothing-like-it"}, {"words": "clean", "tags": "timing"}])
def test_nothing_selected_is_exit_5_and_no_pass(ask: Callable[..., int], asked: dict[str, str]) -> None:
    assert ask(**asked) == 5


def test_a_canary_that_is_not_seen_is_exit_3(ask: Callable[..., int]) -> None:
    later = "canary: 'motion.knock_deg={angle_deg: 1, at_s: 9}'"  # after the end: nothing to measure
    assert ask(SUITE.replace("seeds: 0-5", f"{later}\nseeds: 0")) == 3


def test_a_plan_says_how_many_runs(
    ask: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ask(words="clean") == 0
    capsys.readouterr()
    assert plan_runs(str(tmp_path / "suite.yaml"), "precision 0.02", (0.0, 0.04), tmp_path / "out", None) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("to tell PASS of precision at a margin of 0.02, if 0 is truly lost")
    assert lines[2].startswith("to tell REGRESSION of precision")
    assert " runs (SD " in lines[1] and "clean/overtake-approach/car/none/static_projection" in lines[1]
    with pytest.raises(BadInput, match="did you mean 'precision'"):
        plan_runs(str(tmp_path / "suite.yaml"), "precison 0.02", (0.0,), tmp_path / "out", None)
    with pytest.raises(BadInput, match="with a number above 0"):
        plan_runs(str(tmp_path / "suite.yaml"), "precision -1", (0.0,), tmp_path / "out", None)


def test_a_baseline_of_another_suite_is_refused_before_anything_runs(
    ask: Callable[..., int], tmp_path: Path
) -> None:
    assert ask(seeds=(0,), words="clean and not late") == 0
    values = (tmp_path / "out" / "values.json").read_text(encoding="utf-8")
    other = tmp_path / "other.json"
    other.write_text(values.replace('"suite": "gate"', '"suite": "others"'), encoding="utf-8")
    with pytest.raises(BadInput, match="is a baseline of the suite 'others', not of 'gate'"):
        ask(against=other)


def test_until_decided_stops_at_the_first_look_that_tells(
    ask: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(BadInput, match="needs a baseline to decide against"):
        ask(until_decided=True)
    assert ask(words="clean", seeds=(0,)) == 0
    with pytest.raises(BadInput, match=r"looks at 20, 40, 80 runs, and the baseline has 1"):
        ask(until_decided=True, against=tmp_path / "out" / "values.json", words="clean", out=tmp_path / "o2")
