"""Valid recordings with a frame changed and every checksum made right again: what is read is what was
written, or it is refused in one sentence; and what is read can be scored and shown.

    SIMBENCH_MUTATE=5000 pytest tests/simbench/formats/test_hostile_mutated.py
"""

from __future__ import annotations

import json
import os
import resource
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenarios.errors import BadInput
from simbench.formats.store import MANIFEST, MESSAGES, TRUTH, Stored, read_recording
from simbench.formats.store import _messages as told_frames
from simbench.formats.truth_frames import _about, _image, _scan
from simbench.isolate.frames import DTYPES, pack
from simbench.plugins import load_pipeline
from simbench.run import drive
from simbench.score.contract import ContractError
from simbench.score.objects import score_objects, score_oracles
from simbench.view.page import page_of
from tests.simbench.formats.hostile_parts import (
    Message,
    arrays_of,
    copy,
    good_folder,
    messages,
    packed,
    rewrite,
)

EXAMPLES = int(os.environ.get("SIMBENCH_MUTATE", "30"))
MUTATED = settings(
    max_examples=EXAMPLES, deadline=None, derandomize="SIMBENCH_MUTATE" not in os.environ,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip
OUTCOMES: Counter[str] = Counter()
KINDS = {
    MESSAGES: ("reset", "lidar_scan", "camera_png", "detections", "ego_motion"),
    TRUTH: ("truth_about", "reset", "poses", "reference", "scan_truth", "image_truth"),
}
WHOLE = (0, 1, -1, 2, 3, 7, -(2**31), 2**31, 2**53, 2**62, 2**63 - 1, -(2**63), 2**63, 10**30, 10**8)
FLOATS = (0.0, -0.0, 1.0, -1.0, 1e-300, 1e5, 1e7, 1e30, 1e308, float("inf"), -float("inf"), float("nan"))
TEXTS = (
    "",
    "lidar",
    "cam-front",
    "ego",
    "object 1",
    "../..",
    "\x1b[2J",
    "x" * 300,
    "\ud800",
    "car",
    "é",
    "None",
)
scalars = st.one_of(
    st.sampled_from(WHOLE), st.sampled_from(FLOATS[:9]), st.sampled_from(TEXTS), st.none(), st.booleans(),
    st.just([]), st.just({}), st.lists(st.sampled_from(TEXTS), max_size=4),
)  # fmt: skip


def changed_header(data: st.DataObject, header: dict[str, Any]) -> dict[str, Any]:
    """One field of a header, an array's description, or one field more or less."""
    name = data.draw(st.sampled_from([*header, "more"]))
    if name == "arrays":
        at = data.draw(st.integers(0, len(header["arrays"]) - 1))
        spec = header["arrays"][at]
        what = data.draw(st.sampled_from(["dtype", "shape", "name", "gone"]))
        if what == "gone":
            return header | {"arrays": [s for i, s in enumerate(header["arrays"]) if i != at]}
        value = {
            "dtype": st.sampled_from(list(DTYPES)), "name": st.sampled_from(["seq", spec["name"], "x"]),
            "shape": st.lists(st.integers(0, 9), max_size=4),
        }[what]  # fmt: skip
        return header | {
            "arrays": [s | {what: data.draw(value)} if i == at else s for i, s in enumerate(header["arrays"])]
        }
    if name in header and data.draw(st.booleans()):
        return {key: value for key, value in header.items() if key != name}
    return header | {name: data.draw(scalars)}


def changed_body(data: st.DataObject, header: dict[str, Any], body: bytes) -> tuple[dict[str, Any], bytes]:
    """Some numbers of one array, or its rows."""
    pairs = list(arrays_of(header, body))
    at = data.draw(st.integers(0, len(pairs) - 1))
    spec, array = pairs[at]
    array = array.copy()
    if data.draw(st.integers(0, 3)) == 0 and array.ndim:
        rows = data.draw(st.lists(st.integers(0, max(len(array) - 1, 0)), max_size=4))
        array = array[rows] if len(array) else array
        spec["shape"] = list(array.shape)
    elif array.size:
        numbers = FLOATS if array.dtype.kind == "f" else tuple(
            v for v in WHOLE if np.iinfo(array.dtype).min <= v <= np.iinfo(array.dtype).max
        )  # fmt: skip
        for _ in range(data.draw(st.integers(1, 3))):
            flat = array.reshape(-1)
            where = data.draw(st.integers(0, array.size - 1))
            with np.errstate(over="ignore"):
                flat[where] = data.draw(st.sampled_from(numbers))
    pairs[at] = (spec, array)
    return header, b"".join(one.tobytes() for _, one in pairs)


@MUTATED
@given(st.data())
def test_a_frame_of_anything_is_refused_or_read_as_it_is(tmp_path_factory: Any, data: st.DataObject) -> None:
    folder = _folder(tmp_path_factory)
    name = data.draw(st.sampled_from([MESSAGES, TRUTH]))
    items = messages(name)
    kind = data.draw(st.sampled_from(KINDS[name]))
    at = data.draw(st.sampled_from([i for i, one in enumerate(items) if one.header["kind"] == kind]))
    header, body = items[at].header, items[at].body
    match data.draw(st.sampled_from(["header", "numbers", "bytes", "order"])):
        case "header":
            header = changed_header(data, header)
        case "numbers":
            header, body = changed_body(data, header, body)
        case "bytes" if body:
            raw = bytearray(body)
            for _ in range(data.draw(st.integers(1, 4))):
                raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
            body = bytes(raw)
        case _:
            other = data.draw(st.integers(0, len(items) - 1))
            act = data.draw(st.sampled_from(["swap", "double", "drop"]))
            if act == "swap":
                items[at], items[other] = items[other], items[at]
            elif act == "double":
                items.insert(other, items[at])
            else:
                del items[other]
    if len(items) == len(messages(name)) and kind == items[at].header["kind"]:
        items[at].data = packed(header, body)
    rewrite(folder, name, items)
    outcome(folder, {MESSAGES: messages(MESSAGES), TRUTH: messages(TRUTH)} | {name: items})


@MUTATED
@given(st.data())
def test_a_manifest_of_anything_is_refused_or_changes_nothing(
    tmp_path_factory: Any, data: st.DataObject
) -> None:
    folder = _folder(tmp_path_factory)
    content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    tree = content
    while True:
        key = data.draw(st.sampled_from(list(tree)))
        if isinstance(tree[key], dict) and tree[key] and data.draw(st.booleans()):
            tree = tree[key]
            continue
        break
    if data.draw(st.booleans()):
        tree[key] = data.draw(scalars)
    else:
        del tree[key]
    (folder / MANIFEST).write_text(json.dumps(content), encoding="utf-8")
    outcome(folder, {MESSAGES: messages(MESSAGES), TRUTH: messages(TRUTH)})


def _folder(factory: Any) -> Path:
    folder = Path(factory.getbasetemp()) / "mutated"
    return copy(folder)


def outcome(folder: Path, items: dict[str, list[Any]]) -> None:
    """Refused in one sentence, or equal to what lies in the files, and then good for scores and a page."""
    try:
        stored = read_recording(folder)
    except BadInput as error:
        assert str(error).isprintable() and len(str(error)) < 2500
        OUTCOMES["refused"] += 1
        return
    OUTCOMES[stored.status] += 1
    as_written(stored, items)
    used(stored)


def as_written(stored: Stored, items: dict[str, list[Any]]) -> None:
    """Every message that was read, packed again, holds the arrays that lie in the file."""
    read = [frame for _, _, _, frame in told_frames(stored.recording)]
    assert len(read) == len(items[MESSAGES])
    for frame, one in zip(read, items[MESSAGES], strict=True):
        if frame.kind != "camera_png":  # which is encoded anew
            assert same(pack(frame), one)
    truth, kinds = stored.recording.truth, ("truth_about", "scan_truth", "image_truth")
    parts = [_about(truth), *map(_scan, truth.scans), *map(_image, truth.images)]
    again = sorted(map(pack, parts), key=_key)
    there = sorted((one.data for one in items[TRUTH] if one.header["kind"] in kinds), key=_key)
    assert len(again) == len(there)
    for found, data in zip(again, there, strict=True):
        assert same(found, Message("", 0, 0, data))


def _key(data: bytes) -> tuple[str, str, int]:
    header = Message("", 0, 0, data).header
    return header["kind"], str(header.get("sensor")), int(header.get("seq", 0))


def same(data: bytes, one: Any) -> bool:
    """Equal but for the order of keys in the header."""
    found = Message("", 0, 0, data)
    if found.header != one.header:
        return False
    return all(
        np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
        for (_, a), (_, b) in zip(
            arrays_of(found.header, found.body), arrays_of(one.header, one.body), strict=True
        )
    )


def peak_kb() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@pytest.fixture(scope="module", autouse=True)
def peak_before_kb() -> int:
    """Of this process, before the first recording of this file was read."""
    return peak_kb()


def used(stored: Stored) -> None:
    """What passes as a recording can be shown, driven and scored, whatever was changed in it."""
    try:
        page_of(stored)
    except BadInput as error:
        assert "no LiDAR sweep" in str(error)
    if stored.missing:
        return
    recording = stored.recording
    driven = drive(
        load_pipeline("static_projection")(), recording.calibration, recording.categories, recording.messages
    )  # fmt: skip
    try:
        score_objects(recording, driven.outputs, driven.trajectories)
    except ContractError as error:
        OUTCOMES[f"contract: {str(error)[:40]}"] += 1
    if recording.truth.target_id is not None:
        score_oracles(recording)


def test_what_was_not_changed_is_read(tmp_path: Path, peak_before_kb: int) -> None:
    """And all of the above took little memory beyond what this process had taken before."""
    outcome(copy(tmp_path / "good"), {MESSAGES: messages(MESSAGES), TRUTH: messages(TRUTH)})
    assert OUTCOMES["COMPLETE"] >= 1 and read_recording(good_folder()).status == "COMPLETE"
    assert peak_kb() - peak_before_kb < 1_000_000
    print(dict(OUTCOMES))
