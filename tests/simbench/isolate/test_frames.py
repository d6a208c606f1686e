"""Frames: every message comes back bit by bit, and nothing that is malformed passes."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fusion.camera import PinholeCamera
from fusion.geometry import Transform, rotation_rpy
from fusion.messages import (
    Calibration,
    CameraImage,
    CategorySize,
    Detection,
    Detections,
    EgoMotion,
    FusionOutput,
    LidarScan,
    LocalizedObject,
    Trajectory,
)
from simbench.isolate.answers import output_frame, read_output, read_trajectories, trajectories_frame
from simbench.isolate.frames import (
    HEAD,
    LONGEST_BODY,
    Frame,
    FrameError,
    check_sizes,
    pack,
    read,
    sizes,
    unpack,
)
from simbench.isolate.told import message_frame, read_message, read_reset, reset_frame
from tests.simbench.support import digest

WORDS = st.text(max_size=20)
INT64 = st.integers(-(2**63) + 1, 2**63 - 1)
FLOATS = st.floats(allow_nan=False)  # NaN: apart, below, since it differs from itself
HEADS = {"sensor": WORDS, "seq": INT64, "stamp_ns": INT64, "arrival_ns": INT64}


def through(frame: Frame) -> Frame:
    """Over the wire: as bytes and back."""
    found = read(io.BytesIO(pack(frame)))
    assert found is not None
    return found


def arrays(dtype: type, *shape: int) -> st.SearchStrategy[np.ndarray]:
    return hnp.arrays(dtype, shape)


@st.composite
def scans(draw: st.DrawFn) -> LidarScan:
    n = draw(st.integers(0, 5))
    return LidarScan(
        xyz_m=draw(arrays(np.float32, n, 3)), intensity=draw(arrays(np.float32, n)),
        offset_ns=draw(arrays(np.int32, n)), ring=draw(arrays(np.int16, n)),
        **{name: draw(values) for name, values in HEADS.items()},
    )  # fmt: skip


BOXES = st.builds(
    Detection, track_id=INT64, category=WORDS, box_px=st.tuples(*[st.floats()] * 4), confidence=st.floats()
)
MESSAGES = st.one_of(
    scans(),
    st.builds(CameraImage, rgb=st.tuples(st.integers(0, 3), st.integers(0, 3)).flatmap(
        lambda size: arrays(np.uint8, *size, 3)), **HEADS),
    st.builds(Detections, boxes=st.lists(BOXES, max_size=3).map(tuple), **HEADS),
    st.builds(EgoMotion, velocity_mps=arrays(np.float64, 3), rate_radps=arrays(np.float64, 3),
              specific_force_mps2=arrays(np.float64, 3), **HEADS),
)  # fmt: skip


@given(MESSAGES)
def test_every_message_comes_back_bit_by_bit(message: Any) -> None:
    assert digest(read_message(through(message_frame(message)))) == digest(message)


POSES = st.builds(
    lambda angles, at: Transform(rotation=rotation_rpy(*angles), translation_m=np.array(at)),
    st.tuples(*[st.floats(-4.0, 4.0)] * 3),
    st.tuples(*[st.floats(-1e6, 1e6)] * 3),
)
LENSES = st.builds(
    PinholeCamera, fx_px=FLOATS, fy_px=FLOATS, cx_px=FLOATS, cy_px=FLOATS, width_px=INT64, height_px=INT64,
    distortion=st.tuples(*[FLOATS] * 5),
)  # fmt: skip
SIZES = st.builds(CategorySize, mean_m=st.tuples(*[FLOATS] * 3), spread=FLOATS)


@given(
    st.dictionaries(WORDS, st.tuples(POSES, st.none() | LENSES), max_size=4), st.dictionaries(WORDS, SIZES)
)
def test_calibration_and_categories_come_back_in_their_order(
    sensors: Mapping[str, tuple[Transform, PinholeCamera | None]], sizes: Mapping[str, CategorySize]
) -> None:
    poses = {name: pose for name, (pose, _) in sensors.items()}
    cameras = {name: lens for name, (_, lens) in sensors.items() if lens is not None}
    told = Calibration(T_ego_sensor=poses, cameras=cameras)
    calibration, categories = read_reset(through(reset_frame(told, sizes)))
    assert digest(calibration, categories) == digest(told, dict(sizes))


OBJECTS = st.builds(
    LocalizedObject, track_id=INT64, category=WORDS, sensor=WORDS, stamp_ns=INT64,
    points=hnp.arrays(np.int64, st.integers(0, 4)), position_ego_m=arrays(np.float64, 3),
    distance_m=st.floats(), azimuth_rad=st.floats(), confidence=st.floats(),
)  # fmt: skip
OUTPUTS = st.builds(
    FusionOutput, scan_sensor=WORDS, scan_seq=INT64, objects=st.lists(OBJECTS, max_size=3).map(tuple)
)


@given(OUTPUTS)
def test_every_output_comes_back_bit_by_bit(output: FusionOutput) -> None:
    assert digest(read_output(through(output_frame(output)))) == digest(output)


@st.composite
def tracks(draw: st.DrawFn) -> Trajectory:
    n = draw(st.integers(0, 4))
    return Trajectory(
        track_id=draw(INT64), stamp_ns=draw(arrays(np.int64, n)),
        position_ego_m=draw(arrays(np.float64, n, 3)), inlier=draw(arrays(bool, n)),
    )  # fmt: skip


@given(st.lists(tracks(), max_size=3), st.dictionaries(WORDS, st.lists(st.integers(0, 2**62)).map(tuple)))
def test_trajectories_and_steps_come_back_bit_by_bit(
    found: list[Trajectory], steps: Mapping[str, tuple[int, ...]]
) -> None:
    back, times = read_trajectories(through(trajectories_frame(found, steps)))
    assert digest(back, times) == digest(tuple(found), dict(steps))


# -- malformed bytes --------------------------------------------------------------------------------------


def raw(header: object, body: bytes = b"") -> bytes:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return HEAD.pack(b"SBF1", len(text), len(body)) + text + body


def spec(**changes: object) -> dict[str, object]:
    return {"kind": "k", "arrays": [{"name": "a", "dtype": "f64", "shape": [2], **changes}]}


TWO = np.zeros(2).tobytes()
MALFORMED = {
    "the stream ends within a head, after 5 bytes": raw({"kind": "k"})[:5],
    "the stream ends within a frame": raw({"kind": "k"})[:-1],
    "no frame begins with b'HTTP/1.1 200'": b"HTTP/1.1 200 OK and so on",
    "a header of 4294967295 bytes is too long": HEAD.pack(b"SBF1", 2**32 - 1, 0),
    "a body of 4294967295 bytes is too long": HEAD.pack(b"SBF1", 2, 2**32 - 1),
    "a frame's header is no JSON object": raw([1]),
    "a frame's header is no JSON: 'utf-8'": raw(b"\xff\xfe"),
    "a frame's header is no JSON: Exceeds": raw(b'{"kind": ' + b"9" * 9999 + b"}"),
    "a frame's header names a field twice": raw(b'{"kind": "a", "kind": "b"}'),
    "a frame's header holds NaN": raw(b'{"kind": "a", "x": NaN}'),
    "has no text 'kind'": raw({"kind": 3}),
    "'arrays' of a 'k' is no list": raw({"kind": "k", "arrays": {}}),
    "is no list of at most 64": raw({"kind": "k", "arrays": [{}] * 65}),
    "must have exactly name, dtype and shape": raw({"kind": "k", "arrays": [{"name": "a"}]}),
    "has no text as its name": raw(spec(name=3), TWO),
    "'a' of a 'k' has no dtype of u8, ": raw(spec(dtype="object"), TWO),
    "has no shape: a list": raw(spec(shape=[1, 1, 1, 2]), TWO),
    "has shape [4294967295, 4294967295], but its body ends before": raw(spec(shape=[2**32 - 1] * 2), TWO),
    "has shape [2], but its body ends before": raw(spec(), TWO[:-1]),
    "the body of a 'k' has 17 bytes, but its arrays have 16": raw(spec(), TWO + b"x"),
    "has two arrays 'a'": raw({"kind": "k", "arrays": spec()["arrays"] * 2}, TWO * 2),  # type: ignore[operator]
}


@pytest.mark.parametrize("sentence", MALFORMED)
def test_malformed_bytes_are_one_sentence(sentence: str) -> None:
    with pytest.raises(FrameError) as caught:
        read(io.BytesIO(MALFORMED[sentence]))
    assert sentence in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("shape", [[-1], [True], [1.0], ["2"], [2**32], None, "2"], ids=repr)
def test_a_shape_is_a_list_of_counts(shape: object) -> None:
    with pytest.raises(FrameError, match="has no shape"):
        read(io.BytesIO(raw(spec(shape=shape), TWO)))


def test_a_stream_may_end_between_frames() -> None:
    stream = io.BytesIO(raw({"kind": "a"}) + raw({"kind": "b"}))
    kinds = [frame.kind for frame in iter(lambda: read(stream), None) if frame is not None]
    assert kinds == ["a", "b"]


@given(st.binary(max_size=60))
def test_bytes_of_any_kind_are_a_frame_or_a_sentence(data: bytes) -> None:
    for text in (data, HEAD.pack(b"SBF1", len(data), 0) + data):
        try:
            read(io.BytesIO(text))
        except FrameError as error:
            assert "\n" not in str(error)


@given(MESSAGES, st.data())
@settings(max_examples=200)
def test_a_frame_with_one_changed_byte_is_a_message_or_a_sentence(message: Any, data: st.DataObject) -> None:
    text = bytearray(pack(message_frame(message)))
    text[data.draw(st.integers(0, len(text) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        header, body = sizes(bytes(text[: HEAD.size]))
        read_message(unpack(bytes(text[12 : 12 + header]), bytes(text[12 + header : 12 + header + body])))
    except FrameError as error:
        assert str(error)


def test_what_is_too_large_is_refused_by_whoever_writes_it() -> None:
    with pytest.raises(FrameError, match="is too long"):
        check_sizes(0, LONGEST_BODY + 1)
    check_sizes(0, LONGEST_BODY)


# -- well-formed frames that say what they may not --------------------------------------------------------


def changed(frame: Frame, fields: Mapping[str, Any], numbers: Mapping[str, Any], without: str = "") -> Frame:
    return Frame(
        kind=frame.kind,
        fields={k: v for k, v in {**frame.fields, **fields}.items() if k != without},
        arrays={k: v for k, v in {**frame.arrays, **numbers}.items() if k != without},
    )


ONE = output_frame(
    FusionOutput(
        scan_sensor="top",
        scan_seq=3,
        objects=(
            LocalizedObject(
                track_id=1, category="car", sensor="front", stamp_ns=5, points=np.arange(2),
                position_ego_m=np.zeros(3), distance_m=1.0, azimuth_rad=0.0, confidence=1.0,
            ),
        ),
    )
)  # fmt: skip
WRONG: list[tuple[str, dict[str, Any], dict[str, Any], str]] = [
    ("there is no field 'scan_seq'", {}, {}, "scan_seq"),
    ("there is no array 'points'", {}, {}, "points"),
    ("'scan_seq' is no integer of 64 bits", {"scan_seq": True}, {}, ""),
    ("'scan_seq' is no integer of 64 bits", {"scan_seq": 2**63}, {}, ""),
    ("'scan_sensor' is no text", {"scan_sensor": None}, {}, ""),
    ("'category' is no list", {"category": "car"}, {}, ""),
    ("'sensor' has 2 rows, not 1", {"sensor": ["a", "b"]}, {}, ""),
    ("'track_id' holds float64, not i64", {}, {"track_id": np.zeros(1)}, ""),
    ("'track_id' has 2 rows, not 1", {}, {"track_id": np.zeros(2, np.int64)}, ""),
    ("'position_ego_m' has shape [1, 4], not [n 3]", {}, {"position_ego_m": np.zeros((1, 4))}, ""),
    ("'distance_m' has shape [1, 1], not [n]", {}, {"distance_m": np.zeros((1, 1))}, ""),
    ("'points' has 2 rows, not 3", {}, {"count": np.array([3])}, ""),
    ("'points' has 2 rows, not 9223372036854775807", {}, {"count": np.array([2**63 - 1])}, ""),
    ("'count' holds a negative number", {}, {"count": np.array([-1])}, ""),
    ("it has 'extra', which is not known", {"extra": 1}, {}, ""),
    ("it has 'extra', which is not known", {}, {"extra": np.zeros(1)}, ""),
]


@pytest.mark.parametrize(("sentence", "fields", "numbers", "without"), WRONG, ids=lambda v: str(v)[:40])
def test_an_output_that_is_wrong_is_one_sentence(
    sentence: str, fields: dict[str, Any], numbers: dict[str, Any], without: str
) -> None:
    with pytest.raises(FrameError) as caught:
        read_output(through(changed(ONE, fields, numbers, without)))
    assert str(caught.value) == f"a 'output' is malformed: {sentence}" or sentence in str(caught.value)


def test_trajectories_that_are_wrong_are_one_sentence() -> None:
    track = Trajectory(
        track_id=1, stamp_ns=np.arange(2), position_ego_m=np.zeros((2, 3)), inlier=np.ones(2, bool)
    )
    good = trajectories_frame([track], {"a": (1,)})
    for sentence, fields, numbers in (
        ("neither 0 nor 1", {}, {"inlier": np.array([1, 2], np.uint8)}),
        ("'stamp_ns' has 2 rows, not 3", {}, {"count": np.array([3])}),
        ("'step_ns' is no object", {"step_ns": 3}, {}),
        ("no list of nanoseconds", {"step_ns": {"a": [-1]}}, {}),
        ("no list of nanoseconds", {"step_ns": {"a": [True]}}, {}),
    ):
        with pytest.raises(FrameError, match=sentence.replace("[", r"\[")):
            read_trajectories(through(changed(good, fields, numbers)))


def test_a_calibration_that_is_none_is_one_sentence() -> None:
    pose = Transform.identity()
    good = reset_frame(Calibration(T_ego_sensor={"lidar": pose}, cameras={}), {})
    for sentence, fields, numbers in (
        ("not orthonormal", {}, {"rotation": np.full((1, 3, 3), math.nan)}),
        ("its protocol is 'x', not simbench-pipeline/1", {"protocol": "x"}, {}),
        ("has intrinsics but no T_ego_sensor", {"cameras": ["a"]}, {
            "intrinsics_px": np.ones((1, 4)), "distortion": np.ones((1, 5)),
            "size_px": np.ones((1, 2), np.int64),
        }),
    ):  # fmt: skip
        with pytest.raises(FrameError, match=sentence):
            read_reset(through(changed(good, fields, numbers)))


def test_what_no_frame_can_carry_is_refused() -> None:
    with pytest.raises(FrameError, match="holds complex128, which no frame can carry"):
        pack(Frame(kind="k", arrays={"a": np.zeros(1, complex)}))
    with pytest.raises(FrameError, match="cannot be written as JSON"):
        pack(Frame(kind="k", fields={"a": math.nan}))
    with pytest.raises(FrameError, match="a 'k' is no message"):
        read_message(Frame(kind="k"))
