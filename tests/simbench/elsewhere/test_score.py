"""Results computed elsewhere: the messages go out, the results come back, the scores are those of a run."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from click.testing import CliRunner, Result

from fusion.messages import FusionOutput, Trajectory
from simbench.cli import main
from simbench.isolate.frames import Frame, read
from simbench.isolate.told import read_message, read_reset
from simbench.plugins import load_pipeline
from simbench.run import recording_of

TARGET = (
    "overtake-approach --system car --set systems.car.duration_s=1.0 --faults timing.trigger_offset_ms=50"
).split()


RECORDED_ONCE = lru_cache(maxsize=4)(recording_of)


@pytest.fixture(autouse=True, scope="module")
def recorded_once() -> Iterator[None]:
    """The same job is recorded once; that it is the same each time is asked of the bench elsewhere."""
    with mock.patch("simbench.elsewhere.command.recording_of", RECORDED_ONCE):
        yield


def score(*words: str) -> Result:
    return CliRunner().invoke(main, ["score", *TARGET, *words])


def frames(path: Path) -> list[Frame]:
    with path.open("rb") as stream:
        return list(iter(lambda: read(stream), None))  # type: ignore[arg-type]


def output_line(output: FusionOutput, stamp_ns: int) -> dict[str, Any]:
    return {
        "scan_sensor": output.scan_sensor,
        "scan_seq": output.scan_seq,
        "scan_stamp_ns": stamp_ns,
        "objects": [
            {
                "track_id": one.track_id, "category": one.category, "sensor": one.sensor,
                "stamp_ns": one.stamp_ns, "points": one.points.tolist(),
                "position_ego_m": one.position_ego_m.tolist(), "distance_m": one.distance_m,
                "azimuth_rad": one.azimuth_rad, "confidence": one.confidence,
            }
            for one in output.objects
        ],
    }  # fmt: skip


def trajectory_line(track: Trajectory) -> dict[str, Any]:
    return {
        "track_id": track.track_id,
        "stamp_ns": track.stamp_ns.tolist(),
        "position_ego_m": track.position_ego_m.tolist(),
        "inlier": track.inlier.tolist(),
    }


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What a user does: read the messages, run something of their own, write lines."""
    out = tmp_path_factory.mktemp("messages")
    done = score("--out", str(out))
    assert done.exit_code == 0, done.output
    told = frames(out / "messages.sbf")
    assert (told[0].kind, told[-1].kind) == ("reset", "finish")
    pipeline = load_pipeline("robust")()
    pipeline.reset(*read_reset(told[0]))
    found: list[dict[str, Any]] = [{"schema": "simbench-outputs/1"}]
    stamps: dict[object, int] = {}
    for frame in told[1:-1]:
        message = read_message(frame)
        if frame.kind == "lidar_scan":
            stamps[message.sensor, message.seq] = message.stamp_ns
        output = pipeline.update(message)
        if output is not None:
            found.append({"output": output_line(output, stamps[output.scan_sensor, output.scan_seq])})
    return [*found, *({"trajectory": trajectory_line(track)} for track in pipeline.trajectories())]


def write(path: Path, lines: list[Any]) -> Path:
    path.write_text("".join(f"{json.dumps(line)}\n" for line in lines), encoding="utf-8")
    return path


def test_scores_are_those_of_the_run(lines: list[dict[str, Any]], tmp_path: Path) -> None:
    assert sum(len(line["output"]["objects"]) for line in lines if "output" in line) > 5
    assert any("trajectory" in line for line in lines)
    results = write(tmp_path / "mine.jsonl", lines)
    done = score("--results", str(results), "--out", str(tmp_path / "a"), "--json")
    assert done.exit_code == 0, done.output
    words = [
        "run", *TARGET, "--alone", "--seeds", "0", "--images", "none", "--jobs", "1", "--pipeline", "robust",
        "--out", str(tmp_path / "b"),
    ]  # fmt: skip
    assert CliRunner().invoke(main, words).exit_code == 0
    ours, run = (json.loads((tmp_path / n / "result.json").read_text())["rows"] for n in "ab")
    assert {row["pipeline"] for row in ours} == {"mine.jsonl"}
    expected = [{**row, "pipeline": "mine.jsonl"} for row in run if row["pipeline"] == "robust"]
    assert ours == expected
    assert json.loads(done.stdout)["rows"] == ours
    assert any(row["value"] for row in ours if row["metric"] == "precision")


def test_the_table_names_every_metric(lines: list[dict[str, Any]], tmp_path: Path) -> None:
    done = score("--results", str(write(tmp_path / "a", lines[:1])), "--out", str(tmp_path / "out"))
    assert done.exit_code == 0, done.output
    assert "precision " in done.stdout and "mae_m.smooth" in done.stdout


def test_images_are_in_the_messages_only_when_asked_for(tmp_path: Path) -> None:
    small = ("--set", "systems.car.duration_s=0.2", "--out", str(tmp_path))
    kinds = []
    for images in ("none", "raycast"):
        assert score(*small, "--images", images).exit_code == 0
        kinds.append([frame.kind for frame in frames(tmp_path / "messages.sbf")])
    assert "camera_image" in kinds[1]
    assert [kind for kind in kinds[1] if kind != "camera_image"] == kinds[0]


def edit(**changes: object) -> Callable[[list[Any]], list[Any]]:
    """The second line's output with other values."""
    return lambda lines: [lines[0], {"output": {**lines[1]["output"], **changes}}, *lines[2:]]


def edit_object(**changes: object) -> Callable[[list[Any]], list[Any]]:
    def change(lines: list[Any]) -> list[Any]:
        at = next(i for i, line in enumerate(lines) if line.get("output", {}).get("objects"))
        first, *rest = lines[at]["output"]["objects"]
        return [lines[0], {"output": {**lines[at]["output"], "objects": [{**first, **changes}, *rest]}}]

    return change


def edit_track(**changes: object) -> Callable[[list[Any]], list[Any]]:
    def change(lines: list[Any]) -> list[Any]:
        track = next(line["trajectory"] for line in lines if "trajectory" in line)
        return [lines[0], {"trajectory": {**track, **changes}}]

    return change


MALFORMED: dict[str, Callable[[list[Any]], list[Any]]] = {
    "line 1: the first line is no schema": lambda lines: lines[1:],
    "line 1: the first line is no schema (": lambda lines: [{"schema": "simbench-outputs/2"}],
    "line 2: it is no JSON object": lambda lines: [lines[0], 3],
    "line 2: a line must be one 'output' or one 'trajectory'": lambda lines: [lines[0], {"outputs": {}}],
    "line 2: scan_stamp_ns: field required": lambda lines: [
        lines[0], {"output": {k: v for k, v in lines[1]["output"].items() if k != "scan_stamp_ns"}}
    ],
    "line 2: extra: extra inputs are not permitted": edit(extra=1),
    "line 2: scan_seq: input should be a valid integer": edit(scan_seq="0"),
    "line 2: there is no scan 99 of 'lidar' in the recording": edit(scan_seq=99),
    "line 2: there is no scan 0 of 'roof' in the recording": edit(scan_seq=0, scan_sensor="roof"),
    "line 2: scan_stamp_ns is 17, but scan": edit(scan_stamp_ns=17),
    "line 3: Scan ('lidar', 0) got a second output": lambda lines: [lines[0], lines[1], lines[1]],
    "lies outside its sweep": edit_object(stamp_ns=10**15),
    "points must be indices in": edit_object(points=[10**9]),
    "points holds an index twice": edit_object(points=[1, 1]),
    "objects.0.position_ego_m.2: field required": edit_object(position_ego_m=[1.0, 2.0]),
    "objects.0.distance_m: input should be a finite number": edit_object(distance_m=float("nan")),
    "objects.0.track_id: input should be less than": edit_object(track_id=2**63),
    "line 2: stamp_ns, position_ego_m and inlier of a trajectory have different": edit_track(inlier=[]),
    "line 2: a stamp of the trajectory lies outside the recording's sweeps": lambda lines: edit_track(
        stamp_ns=[t + 10**12 for t in next(x["trajectory"] for x in lines if "trajectory" in x)["stamp_ns"]]
    )(lines),
    "line 3: Trajectory": lambda lines: edit_track()(lines) + edit_track()(lines)[1:],
}  # fmt: skip


@pytest.mark.parametrize("sentence", MALFORMED)
def test_a_malformed_file_is_one_sentence_with_its_line(
    lines: list[dict[str, Any]], tmp_path: Path, sentence: str
) -> None:
    results = write(tmp_path / "mine.jsonl", MALFORMED[sentence](lines))
    refused(score("--results", str(results), "--out", str(tmp_path / "out")), sentence, str(results))


def refused(done: Result, sentence: str, file: str) -> None:
    assert done.exit_code == 2, done.output
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"simbench: {file}") and sentence in line, line


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "line 1: the first line is no schema"),
        (b"\xff\xfe\x00", "it is no UTF-8 text"),
        (b"{", "line 1: it is no JSON"),
        (b'{"schema": "simbench-outputs/1"}\n\n{"output": ', "line 3: it is no JSON"),
        (b'{"schema": "simbench-outputs/1"}\n' + b"[" * 5000, "line 2: it is no JSON"),
    ],
)
def test_a_file_that_is_no_json_is_one_sentence(tmp_path: Path, content: bytes, sentence: str) -> None:
    results = tmp_path / "mine.jsonl"
    results.write_bytes(content)
    refused(score("--results", str(results), "--out", str(tmp_path / "out")), sentence, str(results))


def test_a_file_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    for path, says in ((tmp_path / "none", "no such file"), (tmp_path, "holds 0 MCAP files")):
        refused(score("--results", str(path), "--out", str(tmp_path / "out")), says, str(path))
