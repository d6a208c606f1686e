"""ROS 2 bags from an enemy: one sentence or a sound drive, in bounded memory and time."""

from __future__ import annotations

import struct
import time
import tracemalloc
import zlib
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType

from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan
from scenarios.errors import BadInput
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.bag import write_ros2
from simbench.formats.ros2.read import read_ros2
from simbench.formats.ros2.topics import TopicMap, default_map
from simbench.log import Log
from simbench.recording import Recording
from tests.simbench.formats.ros2_drives import drive
from tests.simbench.formats.ros2_foreign import (
    START,
    TREE,
    Written,
    boxes,
    cloud,
    imu,
    info,
    message,
    packed,
    stamped,
    write_bytes,
    xyz,
)
from tests.simbench.support import digest

FILES = settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@lru_cache(maxsize=1)
def small() -> tuple[Recording, bytes]:
    """A short drive, and the bytes of its bag."""
    import tempfile
    from dataclasses import replace

    kinds = (LidarScan, CameraImage, Detections, EgoMotion)
    messages = [m for kind in kinds for m in [m for m in drive().messages if isinstance(m, kind)][:2]]
    messages.sort(key=lambda m: m.arrival_ns)
    truth = replace(drive().truth, objects=(), target_id=None, scans=(), reference=None)
    recording = replace(drive(), messages=tuple(messages), truth=truth)
    with tempfile.TemporaryDirectory() as folder:
        write_ros2(recording, Path(folder) / "a.mcap")
        return recording, (Path(folder) / "a.mcap").read_bytes()


def outcome(path: Path, topics: TopicMap | None = None) -> Log | BadInput:
    try:
        return read_ros2(path, topics or default_map(path))
    except BadInput as error:
        assert "\n" not in str(error) and len(str(error)) < 1500
        return error


@FILES
@given(st.data())
def test_a_changed_file_is_refused_or_says_the_same(tmp_path: Path, data: st.DataObject) -> None:
    """Bits flipped, parts cut out, moved, doubled; its checksums tell. Metadata have none, but what they say
    fits the rest or not."""
    recording, whole = small()
    changed = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 3))):
        at, length = data.draw(st.integers(0, len(changed) - 1)), data.draw(st.integers(1, 300))
        match data.draw(st.sampled_from(["flip", "cut", "double", "end", "copy"])):
            case "flip":
                changed[at] ^= data.draw(st.integers(1, 255))
            case "cut":
                del changed[at : at + length]
            case "double":
                changed[at:at] = changed[at : at + length]
            case "end":
                del changed[max(at, 1) :]
            case _:
                to = data.draw(st.integers(0, len(changed)))
                changed[to : to + length] = changed[at : at + length]
    (tmp_path / "b.mcap").write_bytes(changed)
    found = outcome(tmp_path / "b.mcap")
    if isinstance(found, Log) and bytes(changed) != whole:
        assert _messages(found) == _messages(recording)


def _messages(drive: Log | Recording) -> list[str]:
    return [digest(m) for m in drive.messages]


def sound(log: Log) -> None:
    """Numbers are finite and as the types promise."""
    for m in log.messages:
        assert abs(m.stamp_ns) < 2**63 and abs(m.arrival_ns) < 2**63
        match m:
            case LidarScan():
                assert np.isfinite(m.xyz_m).all() and (np.diff(m.offset_ns) >= 0).all()
                assert m.offset_ns.min(initial=0) >= 0
                assert m.intensity.min(initial=0.0) >= 0.0 and m.intensity.max(initial=1.0) <= 1.0
            case CameraImage():
                camera = log.calibration.cameras[m.sensor]
                assert m.rgb.shape == (camera.height_px, camera.width_px, 3)
            case Detections():
                for box in m.boxes:
                    x0, y0, x1, y1 = box.box_px
                    assert np.isfinite(box.box_px).all() and x0 <= x1 and y0 <= y1
                    assert 0.0 <= box.confidence <= 1.0 and box.category in log.categories
            case EgoMotion():
                numbers = (m.velocity_mps, m.rate_radps, m.specific_force_mps2)
                assert np.isfinite(np.concatenate(numbers)).all()
    for camera in log.calibration.cameras.values():
        assert np.isfinite(camera.matrix).all() and camera.fx_px > 0
        assert np.isfinite(camera.distortion).all()


@lru_cache(maxsize=1)
def records() -> tuple[dict[str, str], list[tuple[str, str, int, int, bytes]]]:
    """Metadata and messages of the small bag: topic, type, log time, sequence, bytes."""
    import io

    reader = make_reader(io.BytesIO(small()[1]))
    about = next(m.metadata for m in reader.iter_metadata())
    told = [
        (c.topic, s.name, m.log_time, m.sequence, m.data)
        for s, c, m in reader.iter_messages(log_time_order=False)
        if s is not None
    ]
    return about, told


def rewrite(path: Path, about: dict[str, str], told: list[tuple[str, str, int, int, bytes]]) -> None:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="ros2")
        writer.add_metadata("simbench", about)
        channels: dict[str, int] = {}
        for topic, kind, log_ns, sequence, data in told:
            if topic not in channels:
                schema = writer.register_schema(kind, "ros2msg", ros.schema_text(kind).encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], log_ns, data, log_ns, sequence)
        writer.finish()


@FILES
@given(st.data())
def test_a_changed_message_with_right_checksums_is_refused_or_sound(
    tmp_path: Path, data: st.DataObject
) -> None:
    about, told = records()
    told = list(told)
    for _ in range(data.draw(st.integers(1, 4))):
        which = data.draw(st.integers(0, len(told) - 1))
        topic, kind, log_ns, sequence, content = told[which]
        changed = bytearray(content)
        end = max(len(changed) - 1, 0)
        at = data.draw(st.integers(0, end) | st.integers(0, min(120, end)))
        match data.draw(st.sampled_from(["flip", "word", "cut", "grow", "time"])):
            case "flip":
                changed[at : at + 1] = bytes([data.draw(st.integers(0, 255))])
            case "word":
                word = data.draw(st.sampled_from([0, 1, 2**31 - 1, 2**32 - 1, 0x7F800000, 0x7FF80000]))
                changed[at : at + 4] = struct.pack("<I", word)
            case "cut":
                del changed[at:]
            case "grow":
                changed += bytes(data.draw(st.integers(1, 40)))
            case _:
                log_ns = data.draw(st.integers(0, 2**64 - 1))
        told[which] = (topic, kind, log_ns, sequence, bytes(changed))
    rewrite(tmp_path / "b.mcap", about, told)
    found = outcome(tmp_path / "b.mcap")
    if isinstance(found, Log):
        sound(found)


SAID = ["categories", "lidars", "cameras", "imus", "placed", "topics", "epoch_s", "schema"]
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


@FILES
@given(key=st.sampled_from(SAID), value=JSON)
def test_metadata_of_any_content_are_refused_or_lead_to_a_sound_drive(
    tmp_path: Path, key: str, value: Any
) -> None:
    import json

    about, told = records()
    rewrite(tmp_path / "b.mcap", {**about, key: json.dumps(value)}, told)
    found = outcome(tmp_path / "b.mcap")
    if isinstance(found, Log):
        sound(found)


def test_the_small_bag_is_read_at_all(tmp_path: Path) -> None:
    """Else the tests above would be content with anything."""
    about, told = records()
    rewrite(tmp_path / "b.mcap", about, told)
    found = outcome(tmp_path / "b.mcap")
    assert isinstance(found, Log) and _messages(found) == _messages(small()[0])
    sound(found)
    assert {topic.split("/")[-1] for topic, *_ in told} >= {"points", "compressed", "detections", "imu"}


# -- little memory, little time -----------------------------------------------------------------------------


def topics() -> TopicMap:
    return TopicMap.model_validate({
        "ego_frame": "base_link",
        "lidars": {"top": {"points": "/os/points"}},
        "cameras": {"front": {"info": "/info", "image": "/i", "detections": "/d"}},
        "imus": {"imu": {"imu": "/imu", "velocity": "/v"}},
    })  # fmt: skip


def chunked(data: bytes, size: int, crc: int, compression: bytes) -> bytes:
    body = struct.pack("<QQQI", 0, 0, size, crc) + struct.pack("<I", len(compression)) + compression
    body += struct.pack("<Q", len(data)) + data
    return b"\x06" + struct.pack("<Q", len(body)) + body


def lying(kind: str, topic: str, head: bytes, count: int, tail: int = 40) -> Written:
    """A message whose list says that it has `count` values."""
    return (topic, kind, START, b"\x00\x01\x00\x00" + head + struct.pack("<I", count) + bytes(tail))


HEADER = struct.pack("<iII", 1, 0, 1) + bytes(4)  # a stamp, an empty frame, a gap


@pytest.mark.parametrize(
    "sent",
    [
        lying(ros.CLOUD, "/os/points", HEADER + struct.pack("<II", 1, 1), 2**32 - 1),
        lying(ros.DETECTIONS, "/d", HEADER, 2**32 - 1),
        lying(ros.TF, "/tf_static", b"", 2**31),
        lying(ros.COMPRESSED_IMAGE, "/i", HEADER + struct.pack("<I", 1) + bytes(4), 2**32 - 1),
        lying(ros.CAMERA_INFO, "/info", HEADER + struct.pack("<III", 9, 9, 1) + bytes(4), 2**29),
    ],
)
def test_a_list_that_says_it_is_endless_costs_nothing(tmp_path: Path, sent: Written) -> None:
    path = write_bytes(tmp_path / "a.mcap", [sent])
    tracemalloc.start()
    begun = time.perf_counter()
    try:
        found = outcome(path, topics())
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert isinstance(found, BadInput) and "message 0: '" in str(found)
    assert "values, but the message ends before" in str(found)
    assert peak < 4e6 and time.perf_counter() - begun < 1.0


def test_a_time_beyond_63_bits_is_refused(tmp_path: Path) -> None:
    sent: Written = ("/os/points", ros.CLOUD, 2**63, cloud(**xyz()))
    found = outcome(write_bytes(tmp_path / "a.mcap", [TREE, sent]), topics())
    assert isinstance(found, BadInput) and "its log time is 9223372036854775808 ns" in str(found)


def test_a_message_of_millions_of_frames_is_refused_by_its_size(tmp_path: Path) -> None:
    """5 MB of transforms would take a minute to take apart."""
    data = b"\x00\x01\x00\x00" + struct.pack("<I", 50_000) + bytes(5_000_000)
    found = outcome(write_bytes(tmp_path / "a.mcap", [("/tf_static", ros.TF, START, data)]), topics())
    assert isinstance(found, BadInput) and "it has 5000008 bytes, more than 4194304" in str(found)


@pytest.mark.parametrize("compression", [b"zstd", b"lz4"])
def test_bombs_stay_packed(tmp_path: Path, compression: bytes) -> None:
    """A chunk that says 1,000 bytes and holds 64 MB; one that says 64 GB; one of millions of empty records;
    and twenty of them that hold one large record each."""
    import lz4.frame

    size_of = 32 * 2**20
    packing = {b"zstd": zstandard.compress, b"lz4": lz4.frame.compress}[compression]
    zeros, one = bytes(size_of), b"\x7f" + struct.pack("<Q", size_of - 9) + bytes(size_of - 9)
    begin = b"\x89MCAP0\r\n\x01" + struct.pack("<Q", 8) + bytes(8)
    for size, times, content, says in (
        (1000, 1, zeros, "the checksum of a chunk is wrong"),
        (2**36, 1, zeros, "are allowed"),
        (size_of, 1, zeros, "more messages than a file of its size can hold"),
        (size_of, 20, one, "unpacks to more than 1000 times" if compression == b"zstd" else "is cut off"),
    ):
        chunks = times * chunked(packing(content), size, zlib.crc32(content), compression)
        (tmp_path / "b.mcap").write_bytes(begin + chunks)
        tracemalloc.start()
        try:
            found = outcome(tmp_path / "b.mcap", topics())
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        assert isinstance(found, BadInput)
        with pytest.raises(BadInput, match=says):
            raise found
        assert peak < (2e6 if size != size_of else 4 * size)


@pytest.mark.parametrize("options", [{"compression": c} for c in CompressionType] + [{"use_chunking": False}])
def test_every_packing_of_others_is_read(tmp_path: Path, options: dict[str, Any]) -> None:
    """lz4, zstd, not packed, not in chunks."""
    sent: list[Written] = [
        TREE, ("/os/points", ros.CLOUD, START, cloud(**xyz())), ("/info", ros.CAMERA_INFO, START, info()),
        ("/i", ros.COMPRESSED_IMAGE, START, packed(".png")), ("/d", ros.DETECTIONS, START, boxes(START)),
        ("/v", ros.TWIST, START, message(ros.TWIST, header=stamped(START, "base_link"))),
        ("/imu", ros.IMU, START, imu()),
    ]  # fmt: skip
    found = outcome(write_bytes(tmp_path / "a.mcap", sent, **options), topics())
    assert isinstance(found, Log) and len(found.messages) == 4
    sound(found)


@FILES
@given(st.text(alphabet="abMSG:/_ =#[]<>0159\n", max_size=120) | st.text(max_size=60))
def test_a_schema_of_any_text_is_refused_or_the_same(text: str) -> None:
    for name in (ros.TF, ros.CLOUD):
        try:
            assert not ros.same_layout(name, text)
        except ros.DefinitionError as error:
            assert "\n" not in str(error)


def test_a_definition_that_holds_itself_or_grows_without_end_is_refused() -> None:
    rule = "=" * 80
    circle = f"a/A x\n{rule}\nMSG: a/A\na/A x\n"
    doubling = "a/L0 x\n" + "".join(f"{rule}\nMSG: a/L{i}\n" + f"a/L{i + 1} x\n" * 50 for i in range(9))
    begun = time.perf_counter()
    for text in (circle, doubling + f"{rule}\nMSG: a/L9\nuint8 x\n", "x" * 200_000):
        with pytest.raises(ros.DefinitionError):
            ros.same_layout(ros.TF, text)
    assert time.perf_counter() - begun < 1.0
