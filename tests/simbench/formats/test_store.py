"""A recording on disk comes back equal, and what is missing of it or was changed is said."""

from __future__ import annotations

import dataclasses
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fusion.messages import LidarScan
from scenarios.errors import BadInput
from simbench.case import Job
from simbench.formats.store import (
    MANIFEST,
    MESSAGES,
    TRUTH,
    Source,
    first_difference,
    read_recording,
    write_recording,
)
from simbench.recording import Recording
from simbench.run import Made, recording_of, run_case

SOURCE = Source(scenario="overtake-approach", system="car", seed=0)
CLOSE = {"abs": 1e-6, "rel": 1e-6}


@pytest.fixture(scope="module")
def made() -> Made:
    job = Job(
        scenario="overtake-approach", system="car", seed=0, pipelines=(), faults=("demo",),
        changes=("systems.car.duration_s=1.5",),
    )  # fmt: skip
    return recording_of(job)[2]


@pytest.fixture(scope="module")
def original(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("store") / "rec"
    write_recording(made.recording, folder, SOURCE)
    return folder


@pytest.fixture
def stored(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "rec"))


def equal(one: object, other: object) -> bool:
    """Values of all fields, arrays bit by bit."""
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and one.dtype == other.dtype and np.array_equal(one, other)
    if dataclasses.is_dataclass(one) and not isinstance(one, type):
        return type(one) is type(other) and all(
            equal(getattr(one, f.name), getattr(other, f.name)) for f in dataclasses.fields(one)
        )
    if isinstance(one, tuple):
        return isinstance(other, tuple) and len(one) == len(other) and all(map(equal, one, other))
    return one == other


def test_messages_and_truth_come_back_bit_by_bit(made: Made, stored: Path) -> None:
    read = read_recording(stored)
    assert (read.status, read.missing, read.manifest.complete) == ("COMPLETE", (), True)
    was, now = made.recording, read.recording
    assert len(was.messages) == len(now.messages)
    assert first_difference(was, replace(now, truth=was.truth)) is None
    for name in ("objects", "target_id", "scans", "images", "reference", "period_ns", "targets"):
        mine, theirs = getattr(was.truth, name), getattr(now.truth, name)
        if name == "images":
            key = lambda image: (image.sensor, image.seq)  # noqa: E731
            mine, theirs = tuple(sorted(mine, key=key)), tuple(sorted(theirs, key=key))
        assert equal(mine, theirs), name


def test_scores_are_those_of_the_original(made: Made, stored: Path) -> None:
    again = Made(recording=read_recording(stored).recording, receipts=(), shake="")
    for pipeline in ("robust", "static_projection"):
        was, now = run_case(pipeline, made), run_case(pipeline, again)
        assert was.status == now.status == "ok"
        for one, other in zip(was.rows, now.rows, strict=True):
            assert (one.value is None) == (other.value is None)
            if one.value is not None:
                assert other.value == pytest.approx(one.value, **CLOSE), one.metric


def poses(recording: Recording, t_ns: np.ndarray) -> list[np.ndarray]:
    of = recording.truth.poses
    found = [of.ego(t_ns), of.sensor("lidar", t_ns), of.sensor("cam-back", t_ns)]
    found += [of.object_centre(info.object_id, t_ns) for info in recording.truth.objects]
    return [part for pose in found for part in pose]


def test_poses_between_the_samples_are_the_true_ones(made: Made, stored: Path) -> None:
    """The body shakes by a degree, up to 20 Hz: 10 m away 1e-5 rad are a tenth of a millimetre."""
    t_ns = np.random.Generator(np.random.PCG64(1)).integers(0, 1_500_000_000, 300)
    for was, now in zip(
        poses(made.recording, t_ns), poses(read_recording(stored).recording, t_ns), strict=True
    ):
        assert np.abs(was - now).max() < 1e-5


def test_a_place_that_holds_a_recording_is_not_written_over(made: Made, stored: Path) -> None:
    with pytest.raises(BadInput, match="holds a recording already"):
        write_recording(made.recording, stored, SOURCE)


def test_the_first_message_that_differs_is_named(made: Made) -> None:
    was = made.recording
    scan = next(m for m in was.messages if isinstance(m, LidarScan) and m.seq == 3)
    moved = replace(scan, intensity=scan.intensity + np.float32(1e-7))
    now = replace(was, messages=tuple(moved if m is scan else m for m in was.messages))
    where = first_difference(was, now)
    assert where is not None and where.endswith(f"/lidar/lidar_scan at {scan.arrival_ns} ns")
    assert first_difference(was, replace(was, messages=was.messages[:-1])) is not None


@pytest.mark.parametrize("name", [MESSAGES, TRUTH])
def test_a_recording_that_is_cut_off_is_incomplete_and_says_where(stored: Path, name: str) -> None:
    content = (stored / name).read_bytes()
    (stored / name).write_bytes(content[: int(0.7 * len(content))])
    read = read_recording(stored)
    assert read.status == "INCOMPLETE"
    assert len(read.missing) == 1 and f"{name}: it is cut off after" in read.missing[0]


def test_a_recording_whose_writer_was_killed_is_incomplete(stored: Path) -> None:
    data = json.loads((stored / MANIFEST).read_text(encoding="utf-8"))
    data |= {"complete": False, "messages": None, "truth": None}
    (stored / MANIFEST).write_text(json.dumps(data), encoding="utf-8")
    assert read_recording(stored).missing == ("recording.json: writing was not completed",)


def test_a_file_of_another_recording_is_refused(stored: Path) -> None:
    data = json.loads((stored / MANIFEST).read_text(encoding="utf-8"))
    data["truth"]["sha256"] = "0" * 64
    (stored / MANIFEST).write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(BadInput, match="its hash is another"):
        read_recording(stored)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "no JSON that can be read"),
        ('{"schema": "simbench-recording/9"}', "its schema is 'simbench-recording/9'"),
        ('{"schema": "simbench-recording/1", "complete": 3}', "complete"),
        ("[" * 100_000, "no JSON that can be read"),
    ],
)
def test_a_bad_manifest_is_told_in_one_sentence(stored: Path, text: str, says: str) -> None:
    (stored / MANIFEST).write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=says) as told:
        read_recording(stored)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"garbage", "is no MCAP file"), (b"", "cut off before"), (b"\x89MCAP0\r\n", "cut off before")],
)
def test_messages_that_are_none_are_called_what_they_are(stored: Path, content: bytes, says: str) -> None:
    (stored / MESSAGES).write_bytes(content)
    with pytest.raises(BadInput, match=says):
        read_recording(stored)


def test_truth_among_the_messages_is_refused(stored: Path) -> None:
    """A file put in the other's place: the truth is no message, and hashes differ."""
    shutil.copy(stored / TRUTH, stored / MESSAGES)
    with pytest.raises(BadInput):
        read_recording(stored)
