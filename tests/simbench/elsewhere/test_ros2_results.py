"""Results of a ROS 2 stack: bags by rosbags, with another project's definitions, score as the numbers do."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
from click.testing import CliRunner, Result
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from fusion.messages import LidarScan
from scenarios.errors import BadInput
from simbench.case import Job
from simbench.cli import main
from simbench.elsewhere import ros2
from simbench.elsewhere.positions import Position, score_positions
from simbench.elsewhere.ros2 import read_detections3d
from simbench.formats.ros2 import cdr
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.bag import write_bag
from simbench.recording import Recording
from simbench.run import recording_of

JOB = Job(
    scenario="overtake-approach", system="car", seed=0, pipelines=(), changes=("systems.car.duration_s=0.6",)
)
RECORDED_ONCE = lru_cache(maxsize=2)(recording_of)
EPOCH_NS = 10**18  # the bench's 0 in a bag: 2001-09-09 01:46:40
ARRAY = "vision_msgs/msg/Detection3DArray"
VISION_MSGS = {
    # the layout of vision_msgs 4 as docs.ros.org tells it for Humble and Jazzy
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "Detection3D":
        "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox3D bbox\nstring id",
    "Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
    "Unknown": "float32[] secrets\nstring why",
}  # fmt: skip
Sent = tuple[str, Any]  # topic, and an array of rosbags or bytes


@pytest.fixture(autouse=True, scope="module")
def recorded_once() -> Iterator[None]:
    """The same job is recorded once."""
    with mock.patch("simbench.elsewhere.command.recording_of", RECORDED_ONCE):
        yield


def recording() -> Recording:
    return RECORDED_ONCE(JOB)[2].recording


@lru_cache(maxsize=1)
def store() -> Typestore:
    found = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in VISION_MSGS.items():
        found.register(get_types_from_msg(text, f"vision_msgs/msg/{name}"))
    return found


def header(t_ns: int, frame: str) -> Any:
    types = store().types
    stamp = types["builtin_interfaces/msg/Time"](sec=t_ns // 10**9, nanosec=t_ns % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def detection(
    xyz: tuple[float, float, float], *, t_ns: int = 0, frame: str = "", track: str = "",
    said: tuple[tuple[str, float], ...] = (),
) -> Any:  # fmt: skip
    types = store().types
    turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)

    def pose(*at: float) -> Any:
        point = types["geometry_msgs/msg/Point"](x=at[0], y=at[1], z=at[2])
        return types["geometry_msgs/msg/Pose"](position=point, orientation=turn)

    elsewhere = types["geometry_msgs/msg/PoseWithCovariance"](pose=pose(99, 98, 97), covariance=np.zeros(36))
    results = [
        types["vision_msgs/msg/ObjectHypothesisWithPose"](
            hypothesis=types["vision_msgs/msg/ObjectHypothesis"](class_id=name, score=score), pose=elsewhere
        )
        for name, score in said
    ]
    size = types["geometry_msgs/msg/Vector3"](x=4.0, y=2.0, z=1.5)
    box = types["vision_msgs/msg/BoundingBox3D"](center=pose(*xyz), size=size)
    return types["vision_msgs/msg/Detection3D"](
        header=header(t_ns, frame), results=results, bbox=box, id=track
    )


def array(t_ns: int, *detections: Any, frame: str = "ego") -> Any:
    return store().types[ARRAY](header=header(t_ns, frame), detections=list(detections))


def sweep_ns(number: int = 0) -> int:
    """An instant within a sweep, in a bag's time."""
    return EPOCH_NS + stamps()[number] + recording().truth.period_ns // 2


def stamps() -> list[int]:
    return [m.stamp_ns for m in recording().messages if isinstance(m, LidarScan)]


def bag(folder: Path, *sent: Sent) -> Path:
    """A bag by rosbags' own writer and serializer."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics: dict[str, Any] = {}
        for log_ns, (topic, content) in enumerate(sent):
            kind = ARRAY if isinstance(content, bytes) else content.__msgtype__
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store())
            data = content if isinstance(content, bytes) else store().serialize_cdr(content, kind)
            writer.write(topics[topic], log_ns, data)
    return folder


def as_bytes(message: Any) -> bytes:
    return bytes(store().serialize_cdr(message, ARRAY))


def said() -> list[Position]:
    """The target, badly, in every sweep; something false in the first; something without a name."""
    truth = recording().truth
    times = np.array(stamps()) + truth.period_ns // 2
    target = truth.target_centre_ego_m(times)
    errors = np.random.default_rng(3).normal(0.0, 0.3, target.shape)
    given = [
        Position(where="", stamp_ns=int(t), position_ego_m=tuple(place.tolist()), track="a",
                 category="rider", confidence=0.25 + 0.5 / (i + 1))
        for i, (t, place) in enumerate(zip(times, target + errors, strict=True))
    ]  # fmt: skip
    other = replace(given[0], track=None, position_ego_m=(-40.0, 1 / 3, 0.1), category="", confidence=1.0)
    return [*given, other]


def told(position: Position, *, own_stamp: bool) -> Any:
    """A detection that says a position; likeliest is not first."""
    sure = ((position.category, position.confidence), ("tree", 0.0)) if position.category else ()
    t_ns = position.stamp_ns + EPOCH_NS if own_stamp else 0
    return detection(
        position.position_ego_m, t_ns=t_ns, track=position.track or "",
        said=(("pole", 0.125), *sure) if sure else (),
    )  # fmt: skip


def arrays(positions: list[Position], *, own_stamp: bool) -> list[Sent]:
    """One array for each; its own stamp is another where the detection has one."""
    shift = 12_345_678_912 if own_stamp else 0
    return [("/found", array(p.stamp_ns + EPOCH_NS + shift, told(p, own_stamp=own_stamp))) for p in positions]


def score(results: Path, out: Path) -> Result:
    words = ["score", JOB.scenario, "--set", JOB.changes[0], "--results", str(results), "--out", str(out)]
    return CliRunner().invoke(main, words)


@pytest.mark.parametrize("own_stamp", [True, False])
def test_the_scores_are_those_of_the_same_numbers(tmp_path: Path, own_stamp: bool) -> None:
    found = read_detections3d(bag(tmp_path / "bag", *arrays(said(), own_stamp=own_stamp)), recording())
    assert [replace(p, where="") for p in found] == said()
    ours, theirs = (score_positions(recording(), p, "x") for p in (found, said()))
    assert [row.metric for row in ours.rows] == [row.metric for row in theirs.rows]
    for one, other in zip(ours.rows, theirs.rows, strict=True):
        assert one.value == pytest.approx(other.value, abs=1e-12), one.metric
    assert ours["mae_m.raw"].value and ours["false_objects_per_frame"].value


@pytest.mark.parametrize("what", ["folder", "file"])
def test_the_command_gives_the_same_scores_for_a_bag_and_for_its_file(tmp_path: Path, what: str) -> None:
    folder = bag(tmp_path / "bag", *arrays(said(), own_stamp=True))
    results = folder if what == "folder" else folder / "bag.mcap"
    done = score(results, tmp_path / "out")
    assert done.exit_code == 0, done.output
    rows = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["rows"]
    assert {row["pipeline"] for row in rows} == {results.name}
    expected = {row.metric: row.value for row in score_positions(recording(), said(), "x").rows}
    assert {row["metric"] for row in rows} == set(expected)
    for row in rows:
        assert row["value"] == pytest.approx(expected[row["metric"]], abs=1e-12), row["metric"]


@pytest.mark.parametrize("since_1970", [False, True])
def test_a_stack_that_copies_the_stamps_of_our_bag_is_on_our_clock(tmp_path: Path, since_1970: bool) -> None:
    """Also where a recording's own times count from 1970: nothing is added to them then."""
    given, shift = recording(), 1_317_000_000_000_000_000 if since_1970 else 0
    messages = tuple(
        replace(m, stamp_ns=m.stamp_ns + shift, arrival_ns=m.arrival_ns + shift) for m in given.messages
    )
    truth = replace(given.truth, scans=(), reference=None) if since_1970 else given.truth
    played = replace(given, messages=messages, truth=truth)
    write_bag(played, tmp_path / "drive")
    answers: list[Sent] = []
    with AnyReader([tmp_path / "drive"], default_typestore=store()) as reader:
        points = [c for c in reader.connections if c.topic == "/lidar/points"]
        for connection, _, data in reader.messages(points):
            stamp = reader.deserialize(data, connection.msgtype).header.stamp
            answers.append(("/found", array(stamp.sec * 10**9 + stamp.nanosec, detection((1.0, 2.0, 3.0)))))
    found = read_detections3d(bag(tmp_path / "bag", *answers), played)
    assert [p.stamp_ns for p in found] == [t + shift for t in stamps()] and len(found) == 6


def test_other_topics_are_left_alone_whatever_they_are(tmp_path: Path) -> None:
    noise = store().types["vision_msgs/msg/Unknown"](secrets=np.ones(3, np.float32), why="none")
    sent = [("/noise", noise), *arrays(said(), own_stamp=True), ("/noise", noise)]
    found = read_detections3d(bag(tmp_path / "bag", *sent), recording())
    assert [replace(p, where="") for p in found] == said()
    assert found[1].where == "/found, message 1, detection 0 of 1000000000.150000000 s"


def test_class_and_confidence_are_of_the_likeliest_hypothesis(tmp_path: Path) -> None:
    choices = [(("car", 0.2), ("rider", 0.7), ("tree", 0.1)), (("a", 0.5), ("b", 0.5)), (), (("car", 0.0),)]
    content = array(sweep_ns(), *(detection((1.0, 0.0, 0.0), said=one) for one in choices))
    found = read_detections3d(bag(tmp_path / "bag", ("/found", content)), recording())
    assert [(p.category, p.confidence) for p in found] == [
        ("rider", 0.7),
        ("a", 0.5),
        ("", 1.0),
        ("car", 0.0),
    ]
    assert {p.position_ego_m for p in found} == {(1.0, 0.0, 0.0)} and {p.track for p in found} == {None}


def test_arrays_without_detections_are_results_that_found_nothing(tmp_path: Path) -> None:
    done = score(bag(tmp_path / "bag", ("/found", array(sweep_ns()))), tmp_path / "out")
    assert done.exit_code == 0, done.output
    rows = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["rows"]
    assert {row["metric"]: row["value"] for row in rows}["coverage.raw"] == 0.0


def refused(results: Path, out: Path, says: str) -> None:
    done = score(results, out)
    assert done.exit_code == 2, done.output
    (line,) = done.output.strip().splitlines()
    assert line.startswith("simbench: ") and says in line, line
    assert not (out / "result.json").exists()


HERE = (1.0, 2.0, 3.0)
REFUSED: dict[str, Any] = {
    "/found, message 0: its frame is 'lidar', but results are wanted in 'ego'":
        lambda t: array(t, detection(HERE), frame="lidar"),
    "/found, message 0: detection 1: its frame is 'map', but results are wanted in 'ego'":
        lambda t: array(t, detection(HERE), detection(HERE, frame="map")),
    "/found, message 0: detection 0: its position is not finite": lambda t: array(
        t, detection((1.0, float("nan"), 0.0))
    ),
    "/found, message 0: detection 0: its position is not finite, or beyond": lambda t: array(
        t, detection((1.0, 0.0, float("-inf")))
    ),
    "/found, message 0: detection 0: a box has a score of 1.5, not 0 to 1": lambda t: array(
        t, detection(HERE, said=(("car", 1.5),))
    ),
    "/found, message 0: detection 0: a box has a score of nan, not 0 to 1": lambda t: array(
        t, detection(HERE, said=(("car", 0.9), ("tree", float("nan"))))
    ),
    "/found, message 0: detection 0: a box has a score of -0.1, not 0 to 1": lambda t: array(
        t, detection(HERE, said=(("car", 0.9), ("tree", -0.1)))
    ),
    "/found, message 0: detection 0: neither it nor its array has a stamp":
        lambda _: array(0, detection(HERE)),
    "/found, message 0: detection 0: its id has 201 characters, more than 200": lambda t: array(
        t, detection(HERE, track="x" * 201)
    ),
    "/found, message 0: detection 0: its class_id has 201 characters": lambda t: array(
        t, detection(HERE, said=(("x" * 201, 0.5),))
    ),
    "/found, message 0, detection 0 of 1753000000.000000000 s: its stamp 753000000000000000 ns lies in no":
        lambda t: array(1_753_000_000 * 10**9, detection(HERE)),
    "/found, message 0, detection 1 of 1000000000.050000001 s: track 'a' has two positions in one sweep":
        lambda t: array(t, detection(HERE, track="a"), detection(HERE, track="a", t_ns=t + 1)),
    "/found, message 0: it ends before its end":
        lambda t: as_bytes(array(t, detection(HERE, track="abcdefgh")))[:-5],
    "/found, message 0: 'detections' says it has 4294967295 values, but the message ends before":
        lambda t: as_bytes(array(t))[:-4] + b"\xff" * 4,
    "/found, message 0: 3 bytes are no message": lambda t: b"abc",
    "/found, message 0: its stamp is no time": lambda t: b"\0\1\0\0" + b"\xff" * 8 + bytes(8),
}  # fmt: skip


@pytest.mark.parametrize("says", REFUSED)
def test_what_cannot_be_is_one_sentence_and_no_result(tmp_path: Path, says: str) -> None:
    content = REFUSED[says](sweep_ns())
    refused(bag(tmp_path / "bag", ("/found", content)), tmp_path / "out", f"bag.mcap: {says}")


def test_the_message_that_is_wrong_is_named_by_its_number(tmp_path: Path) -> None:
    good, bad = array(sweep_ns(), detection(HERE)), array(sweep_ns(1), detection(HERE), frame="cam")
    sent = [("/found", good), ("/found", bad), ("/found", good)]
    refused(bag(tmp_path / "bag", *sent), tmp_path / "out", "/found, message 1: its frame is 'cam'")


def test_several_topics_of_results_are_named(tmp_path: Path) -> None:
    """Before anything is said of what they hold."""
    sent = [("/b", array(1, frame="x")), ("/a", array(2))]
    says = f"bag.mcap: 2 topics are {ARRAY}: /a, /b (allowed: one of them)."
    refused(bag(tmp_path / "bag", *sent), tmp_path / "out", says)


def test_a_file_without_results_is_told_what_it_holds(tmp_path: Path) -> None:
    noise = store().types["vision_msgs/msg/Unknown"](secrets=np.ones(3, np.float32), why="none")
    says = f"there is no message of type {ARRAY} (allowed: one topic of it; there are: "
    refused(bag(tmp_path / "a", ("/n", noise)), tmp_path / "out", says + "/n (vision_msgs/msg/Unknown)).")
    refused(bag(tmp_path / "b"), tmp_path / "out", says + "none).")


def test_what_is_no_bag_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "text.MCAP").write_text("x" * 99, encoding="utf-8")
    refused(tmp_path / "text.MCAP", tmp_path / "out", "text.MCAP: is no MCAP file")
    refused(tmp_path / "none.mcap", tmp_path / "out", "none.mcap: no such file")
    (tmp_path / "empty").mkdir()
    refused(tmp_path / "empty", tmp_path / "out", "empty: holds 0 MCAP files")
    whole = bag(tmp_path / "bag", *arrays(said(), own_stamp=True)) / "bag.mcap"
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:-60])
    refused(tmp_path / "cut.mcap", tmp_path / "out", "cut.mcap: is ")


def written(path: Path, text: str, data: bytes, encoding: str = "cdr") -> Path:
    """One message under a schema of any text."""
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2")
        schema = writer.register_schema(ARRAY, "ros2msg", text.encode())
        writer.add_message(writer.register_channel("/found", encoding, schema), 1, data, 1)
        writer.finish()
    return path


def test_another_version_and_another_encoding_are_refused(tmp_path: Path) -> None:
    """vision_msgs 3 had a cloud and a flag in a detection."""
    ours, data = ros.schema_text(ARRAY), as_bytes(array(sweep_ns(), detection(HERE)))
    assert len(read_detections3d(written(tmp_path / "a.mcap", ours, data), recording())) == 1
    old = ours.replace("string id\n", "bool is_tracking\nstring tracking_id\n")
    says = f"/found, message 0: this {ARRAY} is defined in another way"
    refused(written(tmp_path / "b.mcap", old, data), tmp_path / "out", says)
    says = "/found, message 0: it is encoded as 'json', not as cdr"
    refused(written(tmp_path / "c.mcap", ours, data, "json"), tmp_path / "out", says)


def test_more_than_is_allowed_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = bag(tmp_path / "bag", *arrays(said(), own_stamp=True))
    for limit, value, says in (
        ("MOST_POSITIONS", 6, "holds more than 6 detections"),
        ("MOST_BYTES", 2**10, "MB of results"),
        ("MOST_SMALL_BYTES", 99, "/found, message 0: it has [0-9]+ bytes, more than 99"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(ros2, limit, value)
            with pytest.raises(BadInput, match=says):
                read_detections3d(found, recording())
    assert len(read_detections3d(found, recording())) == 7


def test_the_definitions_are_those_of_the_other_project() -> None:
    text, _ = store().generate_msgdef(ARRAY, ros_version=2)
    assert ros.same_layout(ARRAY, text) and ros.same_layout(ARRAY, ros.schema_text(ARRAY))
    assert not ros.same_layout(ARRAY, text.replace("string id", "uint32 id"))


NUMBERS = st.floats(width=64)
WORDS = st.text(alphabet="abcä/_ ", max_size=9)
DETECTION = st.tuples(
    st.tuples(NUMBERS, NUMBERS, NUMBERS), st.integers(0, 2**61), WORDS, WORDS,
    st.lists(st.tuples(WORDS, NUMBERS), max_size=3),
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.lists(DETECTION, max_size=3))
def test_the_codec_writes_what_rosbags_writes_and_reads_it_back(given: list[Any]) -> None:
    content = array(
        7, *(detection(p, t_ns=t, frame=f, track=i, said=tuple(s)) for p, t, f, i, s in given)
    )  # fmt: skip
    data = as_bytes(content)
    read = cdr.decode(ARRAY, data)
    assert cdr.encode(ARRAY, read) == data
    for ours, (place, t_ns, frame, track, results) in zip(read["detections"], given, strict=True):
        assert list(ours["bbox"]["center"]["position"].values()) == pytest.approx(list(place), nan_ok=True)
        assert ours["header"]["stamp"] == {"sec": t_ns // 10**9, "nanosec": t_ns % 10**9}
        assert (ours["header"]["frame_id"], ours["id"]) == (frame, track)
        assert [one["hypothesis"]["class_id"] for one in ours["results"]] == [name for name, _ in results]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_changed_bytes_are_refused_or_are_sound_positions(tmp_path: Path, data: st.DataObject) -> None:
    whole = as_bytes(array(sweep_ns(), detection(HERE, track="a", said=(("car", 0.5),))))
    changed = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 3))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
    path = written(tmp_path / "a.mcap", ros.schema_text(ARRAY), bytes(changed))
    try:
        found = read_detections3d(path, recording())
    except BadInput as error:
        assert "\n" not in str(error) and "/found, message 0: " in str(error)
    else:
        for one in found:
            assert np.isfinite(one.position_ego_m).all() and 0.0 <= one.confidence <= 1.0
