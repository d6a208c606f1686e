"""Recordings made into a data set: proved, resumed, verified; and what happens when something is wrong."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from scenarios.errors import BadInput
from simbench.case import Job
from simbench.formats.store import MANIFEST, MESSAGES
from simbench.generate import work
from simbench.generate.command import NAME, Request, generate_recordings
from simbench.generate.require import parse_requirement
from simbench.generate.split import part_of
from simbench.generate.verify import verified
from simbench.run import Made, recording_of

FIRST = "overtake-approach-car-0000"
SHORT = ("systems.car.duration_s=0.6",)


def ask(out: Path, seeds: tuple[int, ...] = (0, 1), workers: int = 1, **more: Any) -> int:
    usual = {"targets": ("overtake-approach",), "system": "car", "faults": ("timing.trigger_offset_ms=50",)}
    usual |= {"changes": SHORT}
    return generate_recordings(Request(seeds=seeds, workers=workers, out=out, **(usual | more)))


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("generate") / "set"
    assert ask(out) == 0
    return out


@pytest.fixture
def made(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "set"))


def rows(out: Path) -> list[dict[str, object]]:
    content = json.loads((out / NAME).read_text(encoding="utf-8"))
    return list(content["recordings"])


def test_every_recording_has_a_folder_that_is_whole(made: Path) -> None:
    assert [row["name"] for row in rows(made)] == [FIRST, "overtake-approach-car-0001"]
    for row in rows(made):
        assert row["status"] == "ok"
        sentence, whole = verified(made / str(row["name"]), rerun=False)
        assert whole and f"complete, {row['messages']} messages" in sentence
    assert {path.name for path in made.iterdir() if path.is_dir()} == {str(row["name"]) for row in rows(made)}


def test_two_workers_write_the_same_bytes_as_one(made: Path, tmp_path: Path) -> None:
    assert ask(tmp_path / "two", workers=2) == 0
    assert rows(tmp_path / "two") == rows(made)
    for row in rows(made):
        for path in (made / str(row["name"])).iterdir():
            assert path.read_bytes() == (tmp_path / "two" / str(row["name"]) / path.name).read_bytes()


def test_what_is_there_is_not_made_again_and_what_a_killed_worker_left_is_in_nobodys_way(made: Path) -> None:
    honest, seen = work.recording_of, list[int]()

    def counted(job: Job, *more: object) -> object:
        seen.append(job.seed)
        return honest(job, *more)

    (made / ".overtake-approach-car-0002").mkdir()
    (made / ".overtake-approach-car-0002" / MANIFEST).write_text("{}", encoding="utf-8")
    with mock.patch.object(work, "recording_of", counted):
        assert ask(made, seeds=(0, 1, 2)) == 0
    assert seen == [2]
    assert len(rows(made)) == 3 and not list(made.glob(".overtake*"))


def test_a_recording_that_was_made_and_is_gone_is_told(made: Path) -> None:
    shutil.rmtree(made / FIRST)
    with pytest.raises(BadInput, match="was made and is gone"):
        ask(made)


def test_an_error_that_did_not_take_effect_is_not_kept(tmp_path: Path) -> None:
    def lying(job: Job, *_: object) -> tuple[object, object, Made]:
        scenario, faults, made = recording_of(job)
        return scenario, faults, replace(made, receipts=tuple(map(spoil, made.receipts)))

    def spoil(receipt: object) -> object:
        return replace(receipt, status="mismatch")  # type: ignore[type-var]

    with mock.patch.object(work, "recording_of", lying):
        assert ask(tmp_path, seeds=(0,)) == 3
    (row,) = rows(tmp_path)
    assert row["status"] == "receipt_mismatch" and "timing.trigger_offset_ms" in str(row["why"])
    assert not (tmp_path / FIRST).exists()


def test_a_full_disk_is_said_before_anything_is_made(tmp_path: Path) -> None:
    little = SimpleNamespace(free=5_000_000)
    with (
        mock.patch("simbench.generate.disk.shutil.disk_usage", return_value=little),
        pytest.raises(BadInput, match=r"take about 0\.\d+ GB, and 0\.01 GB are free"),
    ):
        ask(tmp_path, seeds=tuple(range(20)))
    assert not [path for path in tmp_path.iterdir() if path.is_dir()]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {
                "targets": (
                    "overtake-approach",
                    "overtake-approach",
                )
            },
            "two recordings would be called",
        ),
        ({"targets": ("overtake-aproach",)}, "did you mean"),
        ({"faults": ("timing.trigger_offset_ms=nan",)}, "trigger_offset"),
    ],
)
def test_bad_input_costs_one_sentence_and_writes_nothing(
    tmp_path: Path, change: dict[str, object], says: str
) -> None:
    with pytest.raises(BadInput, match=says):
        ask(tmp_path / "set", **change)
    assert not (tmp_path / "set").exists()


def test_a_recording_that_was_cut_off_is_incomplete(made: Path) -> None:
    path = made / FIRST / MESSAGES
    path.write_bytes(path.read_bytes()[:-100])
    sentence, whole = verified(made / FIRST, rerun=False)
    assert not whole and "INCOMPLETE: messages.mcap: it is cut off after" in sentence


def test_made_again_it_is_the_same_or_the_first_difference_is_named(made: Path) -> None:
    sentence, whole = verified(made / FIRST, rerun=True)
    assert whole and "the same bytes when made again" in sentence
    path = made / FIRST / MANIFEST
    data = json.loads(path.read_text(encoding="utf-8"))
    data["source"]["seed"] = 5
    path.write_text(json.dumps(data), encoding="utf-8")
    sentence, whole = verified(made / FIRST, rerun=True)
    assert not whole and "not the same when it is made again: message" in sentence


def test_progress_says_size_and_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ask(tmp_path, seeds=(0,)) == 0
    told = re.escape(f"[1/1] {FIRST}: ok, ") + r"\d\.\d MB, .* s to make, .* s to write \(0\.0 min left\)"
    assert re.search(told, capsys.readouterr().err)


def test_drives_that_do_not_hold_what_is_required_are_counted_and_not_kept(tmp_path: Path) -> None:
    required = (parse_requirement("nearest_m<=27.9"),)
    vary = ("systems.car.actors.car.path.speed_mps={uniform: [9, 15]}",)
    assert ask(tmp_path, seeds=tuple(range(4)), required=required, changes=(*SHORT, *vary)) == 0
    kept = {row["name"]: row["status"] for row in rows(tmp_path)}
    assert set(kept.values()) == {"ok", "rejected"}, kept
    for row in rows(tmp_path):
        assert (tmp_path / str(row["name"])).is_dir() == (row["status"] == "ok")
        assert row["status"] == "ok" or "nearest_m<=27.9: 2" in str(row["why"])
    page = (tmp_path / "card.html").read_text(encoding="utf-8")
    assert "draws were made and not kept" in page and "nearest_m&lt;=27.9" in page


def test_other_formats_lie_beside_the_recording(tmp_path: Path) -> None:
    assert ask(tmp_path, seeds=(0,), formats=("mcap", "kitti", "pcd")) == 0
    for kind, suffix in (("mcap", ".mcap"), ("kitti", ".bin"), ("pcd", ".pcd")):
        assert list((tmp_path / kind / FIRST).rglob(f"*{suffix}")), kind
    assert (tmp_path / "mcap" / FIRST / f"{FIRST}.mcap").is_file()
    bag = (tmp_path / "mcap" / FIRST / "metadata.yaml").read_text(encoding="utf-8")
    assert f"{FIRST}.mcap" in bag and f".{FIRST}" not in bag
    (row,) = rows(tmp_path)
    files = [path for path in tmp_path.rglob("*") if path.is_file() and FIRST in str(path)]
    assert row["size_bytes"] == sum(path.stat().st_size for path in files)
    assert not [path for path in tmp_path.rglob(".*") if path.is_dir()]


def test_both_rigs_of_a_drive_are_in_the_same_part(tmp_path: Path) -> None:
    changes = ("systems.car.duration_s=0.3", "systems.wearable.duration_s=0.3")
    asked = {"system": None, "changes": changes, "faults": ("none",), "shares": (50.0, 25.0, 25.0)}
    assert ask(tmp_path, seeds=tuple(range(5)), **asked) == 0
    part = {(row["system"], row["seed"]): row["split"] for row in rows(tmp_path)}
    for seed in range(5):
        assert part["car", seed] == part["wearable", seed] == part_of("overtake-approach", seed, (50, 25, 25))
    assert len(set(part.values())) > 1


def test_a_recording_that_names_a_file_which_is_no_scenario_is_not_made_again(made: Path) -> None:
    path = made / FIRST / MANIFEST
    text = path.read_text(encoding="utf-8").replace('"overtake-approach"', '"/etc/passwd"')
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match="neither of the catalogue nor a YAML file") as told:
        verified(made / FIRST, rerun=True)
    assert "root:" not in str(told.value)
