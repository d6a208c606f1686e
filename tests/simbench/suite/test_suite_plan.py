"""Suite files: those that come with the package, what they plan, and bad input."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenarios.errors import BadInput
from scenarios.suite import is_suite, list_suites, load_suite
from simbench.case import Job
from simbench.suite.coverage import as_lines, coverage
from simbench.suite.plan import groups_of, recordings_of

GOOD = """\
name: mine
description: Mine.
seeds: 0-2
pipelines: [robust, static_projection]
limits: {precision: ">= 0.5"}
margins: {mae_m: 0.2}
blocks:
  one:
    scenarios: [overtake-approach]
    systems: [car]
    faults: [none, own, [timing.trigger_offset_ms=50, motion.flex_deg=1]]
    change: [systems.car.duration_s=1]
    limits: {recall: ">= 0.4", latency_ms.p99: "<= 50"}
    tags: [fast]
"""


def write(folder: Path, text: str = GOOD) -> str:
    path = folder / "suite.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_suite_is_scenarios_times_faults_times_seeds_times_pipelines(tmp_path: Path) -> None:
    groups = groups_of(load_suite(write(tmp_path)))
    assert [group.name for group in groups] == [
        f"one/overtake-approach/car/{faults}/{pipeline}"
        for faults in ("none", "own", "timing.trigger_offset_ms=50+motion.flex_deg=1")
        for pipeline in ("robust", "static_projection")
    ]
    first, last = groups[0], groups[-1]
    assert first.job == Job(
        scenario="overtake-approach", system="car", seed=0, pipelines=("robust",), faults=("none",),
        changes=("systems.car.duration_s=1",),
    )  # fmt: skip
    assert last.job.faults == ("timing.trigger_offset_ms=50", "motion.flex_deg=1")
    assert [(limit.metric.name, limit.value) for limit in first.limits] == [
        ("precision", 0.5), ("recall", 0.4), ("latency_ms.p99", 50.0),
    ]  # fmt: skip
    assert {m.name: margin for m, margin in first.metrics} == {
        "precision": 0.05, "recall": 0.05, "coverage.smooth": 0.05, "mae_m.smooth": 0.2,
    }  # fmt: skip


def test_pipelines_of_one_drive_share_its_recording(tmp_path: Path) -> None:
    groups = groups_of(load_suite(write(tmp_path)))
    made = recordings_of([(group, seed) for group in groups for seed in group.seeds])
    assert len(made) == 3 * 3
    assert all(recording.job.pipelines == ("robust", "static_projection") for recording in made)
    assert {name for recording in made for name in recording.groups} == {group.name for group in groups}


def test_blocks_that_play_the_same_drive_both_get_their_cases(tmp_path: Path) -> None:
    block = GOOD[GOOD.index("  one:") :]
    groups = groups_of(load_suite(write(tmp_path, GOOD + block.replace("  one:", "  two:"))))
    made = recordings_of([(group, seed) for group in groups for seed in group.seeds])
    assert len(groups) == 12
    assert {name for recording in made for name in recording.groups} == {group.name for group in groups}


def test_a_slash_in_a_fault_parts_no_name(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("faults: {timing.trigger_offset_ms: 5}\n", encoding="utf-8")
    text = GOOD.replace("own,", f"{tmp_path}/mine.yaml, 'motion.trace={{file: a/b.csv}}',")
    names = [group.name for group in groups_of(load_suite(write(tmp_path, text)))]
    assert "one/overtake-approach/car/mine/robust" in names
    assert {name.count("/") for name in names} == {4}


def test_pipelines_and_seeds_may_be_replaced(tmp_path: Path) -> None:
    groups = groups_of(load_suite(write(tmp_path)), pipelines=("probabilistic",), seeds=(7,))
    assert {(group.pipeline, group.seeds, group.job.seed) for group in groups} == {("probabilistic", (7,), 7)}


def test_a_users_files_lie_beside_the_suite(tmp_path: Path) -> None:
    text = GOOD.replace("[robust, static_projection]", '["./mine.py:Mine"]')
    group = groups_of(load_suite(write(tmp_path, text)))[0]
    assert group.pipeline == f"{tmp_path}/mine.py:Mine"
    assert group.name == "one/overtake-approach/car/none/mine.py:Mine"


@pytest.mark.parametrize("name", list_suites())
def test_every_suite_of_the_package_limits_what_one_point_an_object_would_fail(name: str) -> None:
    groups = groups_of(load_suite(name))
    assert groups
    for group in groups:
        assert {"recall", "precision"} <= {limit.metric.name for limit in group.limits}, group.name


def test_the_suites_that_the_docs_promise_are_there() -> None:
    promised = {"smoke", "regression", "paper", "sync", "vibration", "calibration", "detector"}
    assert set(list_suites()) == promised


def test_a_target_with_blocks_is_a_suite(tmp_path: Path) -> None:
    assert is_suite("smoke")
    assert is_suite(write(tmp_path))
    assert not is_suite("overtake-approach")
    assert not is_suite(str(tmp_path / "none.yaml"))


def test_a_coverage_table_says_what_is_exercised_and_what_not(tmp_path: Path) -> None:
    found = coverage(groups_of(load_suite(write(tmp_path))))
    assert found.runs["overtake-approach", "motion.flex_deg"] == 3  # two pipelines, one drive
    assert found.runs["overtake-approach", "timing.trigger_offset_ms"] == 3
    assert "overtake-close" in found.missing_scenarios
    assert "lidar.fog_mor_m" in found.missing_faults
    lines = "\n".join(as_lines(found))
    assert "motion.flex_deg" in lines and "not exercised" in lines


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("precision:", "precison:", "unknown metric 'precison'"),
        ("precision:", "precison:", "did you mean 'precision'?"),
        ('">= 0.5"', '"<= 0.5"', "higher is better"),
        ('">= 0.5"', '"0.5"', "is METRIC>=NUMBER"),
        ("seeds: 0-2", "seeds: 2-0", "is not a range of seeds"),
        ("overtake-approach", "overtake-aproach", "did you mean 'overtake-approach'?"),
        ("[car]", "[bike]", "unknown value 'bike'"),
        ("timing.trigger_offset_ms=50", "timing.triger_offset_ms=50", "unknown fault"),
        ("none, own,", "none, none,", "stands here twice"),
        ("duration_s=1", "duration=1", "duration"),
        ("margins: {mae_m: 0.2}", "margins: {tpr: 0.2}", "is not among the suite's metrics"),
        ("margins: {mae_m: 0.2}", "margins: {mae_m: -1}", "must be > 0"),
        ("tags: [fast]", "tag: [fast]", "unknown key 'tag'"),
        ("name: mine\n", "", "'name' is missing"),
        ("blocks:", "block:", "unknown key 'block'"),
    ],
)
def test_a_malformed_suite_costs_one_sentence_with_its_line(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(BadInput) as caught:
        groups_of(load_suite(path))
    text = str(caught.value)
    assert words in text
    assert path in text and "line" in text
    assert "\n" not in text
