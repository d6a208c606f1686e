"""A ROS 2 bag is run as the drive that it was written from, without its truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from simbench.case import Job
from simbench.cli import main
from simbench.formats.ros2.bag import write_bag
from simbench.run import Made, driven, recording_of

JOB = Job(
    scenario="overtake-approach", system="car", seed=0, pipelines=(), changes=("systems.car.duration_s=1",)
)


@pytest.fixture(scope="module")
def made() -> Made:
    return recording_of(JOB)[2]


@pytest.fixture(scope="module")
def bag(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags") / "drive"
    write_bag(made.recording, folder)
    return folder


def run(*words: str) -> Result:
    return CliRunner().invoke(main, ["run", *words])


def result(out: Path) -> dict[str, Any]:
    return dict(json.loads((out / "result.json").read_text(encoding="utf-8")))


def test_answers_are_those_to_the_drive_itself(made: Made, bag: Path, tmp_path: Path) -> None:
    from simbench.results import outputs_hash

    done = run(f"mcap:{bag}", "--pipeline", "static_projection", "--out", str(tmp_path / "o"))
    assert done.exit_code == 0, done.output
    (case,) = result(tmp_path / "o")["cases"]
    direct = driven("static_projection", made.recording.log)
    assert case["outputs_sha256"] == outputs_hash(direct)  # type: ignore[arg-type]
    assert case["truth"] is False and "No truth is known of this drive" in done.output


def test_no_score_that_needs_truth_is_given(bag: Path, tmp_path: Path) -> None:
    assert run(f"mcap:{bag}", "--pipeline", "robust", "--out", str(tmp_path / "o")).exit_code == 0
    names = {row["metric"] for row in result(tmp_path / "o")["rows"]}
    assert "box_offset_px" in names and not names & {"tpr", "precision", "recall", "mae_m.raw"}


def test_a_pipeline_that_fails_is_told_and_the_others_go_on(bag: Path, tmp_path: Path) -> None:
    bad = "class Bad:\n    def reset(self, c, k): 1 / 0\n    def update(self, m): ...\n"
    bad += "    def trajectories(self): return ()\n"
    (tmp_path / "bad.py").write_text(bad, encoding="utf-8")
    words = ("--pipeline", f"{tmp_path / 'bad.py'}:Bad", "--pipeline", "static_projection")
    done = run(f"mcap:{bag}", *words, "--out", str(tmp_path / "o"))
    assert done.exit_code == 1
    statuses = [case["status"] for case in result(tmp_path / "o")["cases"]]
    assert statuses == ["pipeline_error", "ok"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--faults", "none"), "--faults is not for a ROS 2 bag"),
        (("--seeds", "3"), "--seeds is not for a ROS 2 bag"),
        (("--set", "road.width_m=3"), "--set is not for a ROS 2 bag"),
        (("--topics", "none.yaml"), "none.yaml"),
    ],
)
def test_what_is_for_other_drives_is_refused(
    bag: Path, tmp_path: Path, words: tuple[str, ...], says: str
) -> None:
    done = run(f"mcap:{bag}", *words, "--out", str(tmp_path / "o"))
    assert done.exit_code == 2 and says in done.output
    assert not (tmp_path / "o").exists()


def test_what_is_no_bag_is_told(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(b"PK\x03\x04")
    for target in (tmp_path / "x.mcap", tmp_path / "gone.mcap", tmp_path):
        done = run(f"mcap:{target}", "--out", str(tmp_path / "o"))
        assert done.exit_code == 2
    done = run("mcap:a", "overtake-approach", "--out", str(tmp_path / "o"))
    assert done.exit_code == 2 and "one ROS 2 bag at a time" in done.output
    done = run("overtake-approach", "--topics", "x.yaml", "--out", str(tmp_path / "o"))
    assert done.exit_code == 2 and "--topics is for a ROS 2 bag" in done.output
