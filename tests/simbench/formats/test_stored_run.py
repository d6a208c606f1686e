"""A recording that `generate` wrote is run as it was made: same outputs, same scores, same receipts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from simbench.cli import main
from simbench.formats.store import MANIFEST, MESSAGES

DRIVE = ("--system", "car", "--faults", "timing.trigger_offset_ms=50", "--set", "systems.car.duration_s=1")
NAME = "overtake-approach-car-0000"


def call(*words: str) -> Result:
    return CliRunner().invoke(main, list(words))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("stored")
    asked = ("generate", "overtake-approach", *DRIVE, "--seeds", "0", "--jobs", "1", "--out", str(out))
    assert call(*asked).exit_code == 0
    return out / NAME


def results(out: Path) -> dict[str, list[dict[str, object]]]:
    return json.loads((out / "result.json").read_text(encoding="utf-8"))


PIPELINES = ("--pipeline", "robust", "--pipeline", "static_projection")


def test_outputs_scores_and_receipts_are_those_of_the_drive_itself(recording: Path, tmp_path: Path) -> None:
    words = (*PIPELINES, "--jobs", "1", "--images", "none", "--out")
    direct = call("run", "overtake-approach", *DRIVE, "--alone", "--seeds", "0", *words, str(tmp_path / "a"))
    stored = call("run", str(recording), *words, str(tmp_path / "b"))
    assert direct.exit_code == stored.exit_code == 0, stored.output
    one, other = results(tmp_path / "a"), results(tmp_path / "b")
    for mine, theirs in zip(one["rows"], other["rows"], strict=True):
        for field in ("value", "sd"):
            value = mine.pop(field)
            assert theirs.pop(field) == (None if value is None else pytest.approx(value, rel=1e-6, abs=1e-6))
        assert mine == theirs
    assert len(one["cases"]) == 3
    for mine, theirs in zip(one["cases"], other["cases"], strict=True):
        for field in ("outputs_sha256", "receipts", "fault_specs", "faults", "shake", "boxes", "status"):
            assert mine[field] == theirs[field], field
    assert len(one["cases"][0]["receipts"]) > 3  # type: ignore[arg-type]
    page = (tmp_path / "b" / "report.html").read_text(encoding="utf-8")
    assert "Pipelines are told the calibration that the recording brings." in page


def test_the_command_that_is_printed_runs_the_recording_again(recording: Path, tmp_path: Path) -> None:
    words = ("--pipeline", "static_projection", "--images", "none", "--jobs", "1", "--out")
    assert call("run", str(recording), *words, str(tmp_path / "a")).exit_code == 0
    command = str(results(tmp_path / "a")["cases"][0]["command"]).split()[1:]
    assert call(*command, "--out", str(tmp_path / "b")).exit_code == 0
    assert results(tmp_path / "a")["rows"] == results(tmp_path / "b")["rows"]


def test_a_recording_that_was_cut_off_gives_no_number(recording: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut"
    cut.mkdir()
    for path in recording.iterdir():
        content = path.read_bytes()
        (cut / path.name).write_bytes(content[: len(content) // 2] if path.name == MESSAGES else content)
    done = call(
        "run", f"rec:{cut}", "--pipeline", "static_projection", "--jobs", "1", "--out", str(tmp_path / "o")
    )
    assert done.exit_code == 3
    assert "INCOMPLETE: messages.mcap: it is cut off after" in done.output and "line" not in done.output
    assert all(row["value"] is None for row in results(tmp_path / "o")["rows"])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--faults", "none"), "--faults is not for a recording"),
        (("--seeds", "3"), "--seeds is not for a recording"),
        (("--boxes", "labels"), "--boxes is not for a recording"),
        (("--set", "systems.car.duration_s=2"), "what was recorded has happened"),
        (("--system", "wearable"), "was recorded on the rig 'car'"),
    ],
)  # fmt: skip
def test_what_was_decided_when_it_was_made_cannot_be_asked_for(
    recording: Path, tmp_path: Path, words: tuple[str, ...], says: str
) -> None:
    done = call("run", str(recording), *words, "--out", str(tmp_path / "o"))
    assert done.exit_code == 2 and says in done.output
    assert not (tmp_path / "o").exists()


def test_a_folder_without_a_recording_is_told(tmp_path: Path) -> None:
    done = call("run", f"rec:{tmp_path}", "--out", str(tmp_path / "o"))
    assert done.exit_code == 2 and f"holds no {MANIFEST}" in done.output
