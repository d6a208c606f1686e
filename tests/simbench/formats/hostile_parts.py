"""A small valid recording, and the ways to change it on disk so that its checksums still are right."""

from __future__ import annotations

import hashlib
import json
import shutil
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

from fusion.messages import CameraImage, Detection, Detections, EgoMotion, LidarScan, Measurement
from simbench.faults.delivery import Sweep
from simbench.formats.container import LogWriter, read_log
from simbench.formats.store import MANIFEST, MESSAGES, TRUTH, Source, write_recording
from simbench.formats.stored_frames import ENCODING
from simbench.isolate.frames import DTYPES, HEAD, MAGIC
from simbench.recording import Recording
from simbench.truth import ScanTruth
from tests.simbench.support import recorded, staged

SIZE_PX, COLUMNS = (384, 256), 1800
SENSORS = ("lidar", "cam-front", "cam-front-left")
ESCAPE = "\x1b]0;owned\x07\x1b[2J\n\rcam"
SOURCE = Source(scenario="overtake-approach", system="car", seed=0, images="raycast")
FALSE_BOX = Detection(track_id=7, category="car", box_px=(3.0, 4.0, 20.0, 30.0), confidence=0.5)


@lru_cache(maxsize=1)
def good() -> Recording:
    """0.3 s of the car, small: the target's points and a fiftieth of the others, two cameras, pictures of one
    with a false box in every image, and every tenth message of the IMU. Its target is scored."""
    recording = recorded(staged(duration_s=0.3, columns=COLUMNS, size_px=SIZE_PX)).recording
    truth, messages, scans = recording.truth, list[Measurement](), dict[tuple[str, int], ScanTruth]()
    of_scans = {(one.sensor, one.seq): one for one in truth.scans}
    for message in recording.messages:
        if message.seq % 10 if isinstance(message, EgoMotion) else message.sensor not in SENSORS:
            continue
        if isinstance(message, LidarScan):
            both = Sweep(scan=message, truth=of_scans[message.sensor, message.seq])
            kept = (both.truth.object_id == truth.target_id) | (np.arange(len(message.xyz_m)) % 50 == 0)
            message, scans[message.sensor, message.seq] = both.keep(kept).scan, both.keep(kept).truth
        if isinstance(message, Detections):
            stamps = {name: getattr(message, name) for name in ("sensor", "seq", "stamp_ns", "arrival_ns")}
            if message.sensor == SENSORS[1]:
                rgb = np.full((SIZE_PX[1], SIZE_PX[0], 3), 20 + message.seq, dtype=np.uint8)
                messages.append(CameraImage(rgb=rgb, **stamps))
            message = replace(message, boxes=(*message.boxes, FALSE_BOX))
        messages.append(message)
    images = tuple(
        replace(image, detection_object_id=(*image.detection_object_id, -1))
        for image in truth.images
        if image.sensor in SENSORS
    )
    truth = replace(truth, images=images, scans=tuple(scans.values()))
    return replace(recording, messages=tuple(messages), truth=truth)


@lru_cache(maxsize=1)
def good_folder() -> Path:
    """It on disk; written once, not to be changed."""
    folder = Path(mkdtemp(prefix="hostile-")) / "good"
    write_recording(good(), folder, SOURCE)
    return folder


def copy(folder: Path) -> Path:
    """The valid recording in a folder of its own."""
    return Path(shutil.copytree(good_folder(), folder, dirs_exist_ok=True))


@dataclass
class Message:
    """One message as it lies in the file, without its hash."""

    topic: str
    log_ns: int
    publish_ns: int
    data: bytes

    @property
    def header(self) -> dict[str, Any]:
        size = HEAD.unpack_from(self.data)[1]
        return dict(json.loads(self.data[HEAD.size : HEAD.size + size]))

    @property
    def body(self) -> bytes:
        return self.data[HEAD.size + HEAD.unpack_from(self.data)[1] :]


def packed(header: dict[str, Any] | bytes, body: bytes) -> bytes:
    """A frame of any header and body."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return HEAD.pack(MAGIC, len(text), len(body)) + text + body


@lru_cache(maxsize=2)
def _messages(name: str) -> tuple[Message, ...]:
    return tuple(
        Message(entry.topic, entry.log_ns, entry.publish_ns, entry.data)
        for entry in read_log(good_folder() / name, encoding=ENCODING)
    )


def messages(name: str) -> list[Message]:
    """Those of one of the two files."""
    return [replace(one) for one in _messages(name)]


def rewrite(folder: Path, name: str, items: list[Message], *, encoding: str = ENCODING) -> None:
    """Write one of the two files with right checksums, hashes and counts."""
    counts: Counter[str] = Counter()
    with LogWriter(folder / name, encoding=encoding, describe=lambda topic: (topic[:20], "")) as log:
        for one in items:
            log.add(
                one.topic, [one.data], log_ns=one.log_ns, publish_ns=one.publish_ns, seq=counts[one.topic]
            )
            counts[one.topic] += 1
        total = log.close()
    part = {"count": sum(counts.values()), "sha256": total, "topics": dict(counts)}
    change_manifest(folder, lambda data: data | {"messages" if name == MESSAGES else "truth": part})


def change_manifest(folder: Path, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    data = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    (folder / MANIFEST).write_text(json.dumps(change(data)), encoding="utf-8")


def file_of(kind: str) -> str:
    """Which file holds frames of a kind; `reset` is asked for as `told` or `true`."""
    return (
        TRUTH
        if kind.endswith("_truth") or kind in ("truth_about", "poses", "reference", "true")
        else MESSAGES
    )


def _is(one: Message, kind: str) -> bool:
    return bool(one.header["kind"] == ("reset" if kind in ("told", "true") else kind))


def find(items: list[Message], kind: str, nth: int = 0) -> int:
    """The place of the nth frame of a kind."""
    return [i for i, one in enumerate(items) if _is(one, kind)][nth]


def frame_changed(
    kind: str, change: Callable[[dict[str, Any], bytes], tuple[dict[str, Any] | bytes, bytes]], nth: int = 0
) -> Callable[[Path], Path]:
    """The recording with header and body of one frame changed."""

    def make(folder: Path) -> Path:
        name, items = file_of(kind), messages(file_of(kind))
        one = items[find(items, kind, nth)]
        one.data = packed(*change(one.header, one.body))
        rewrite(copy(folder), name, items)
        return folder

    return make


def field(kind: str, name: str, value: object, nth: int = 0) -> Callable[[Path], Path]:
    """The recording with one field of one frame set."""
    return frame_changed(kind, lambda header, body: (header | {name: value}, body), nth)


def numbers(
    kind: str, name: str, change: Callable[[np.ndarray], np.ndarray | None], nth: int = 0
) -> Callable[[Path], Path]:
    """The recording with one array of one frame changed: in place, or another one of any shape."""

    def changed(header: dict[str, Any], body: bytes) -> tuple[dict[str, Any], bytes]:
        pieces = []
        for spec, array in arrays_of(header, body):
            if spec["name"] == name:
                array = array.copy()
                new = change(array)
                array = array if new is None else new.astype(array.dtype)
                spec["shape"] = list(array.shape)
            pieces.append(array.tobytes())
        return header, b"".join(pieces)

    return frame_changed(kind, changed, nth)


def arrays_of(header: dict[str, Any], body: bytes) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """Every array's description and the array."""
    at = 0
    for spec in header["arrays"]:
        dtype, count = DTYPES[spec["dtype"]], int(np.prod(spec["shape"]))
        yield spec, np.frombuffer(body, dtype, count, at).reshape(spec["shape"])
        at += count * dtype.itemsize


# -- the bytes of an MCAP file ------------------------------------------------------------------------------

HEADER, CHUNK, INDEX, CHUNK_INDEX, DATA_END, FOOTER = 1, 6, 7, 8, 15, 2
_RECORD = struct.Struct("<BQ")


def records(raw: bytes) -> Iterator[tuple[int, int, int]]:
    """Code, begin and end of the content of every record outside of chunks."""
    at = 8
    while at + _RECORD.size <= len(raw) - 8:
        code, size = _RECORD.unpack_from(raw, at)
        yield code, at + _RECORD.size, at + _RECORD.size + size
        at += _RECORD.size + size


def place(raw: bytes, code: int, within: int) -> int:
    """Where byte `within` of the content of the first record of a code lies."""
    return next(begin for found, begin, _ in records(raw) if found == code) + within


def mcap(content: bytes) -> bytes:
    """A file of a header and whatever records."""
    return b"\x89MCAP0\r\n" + record(HEADER, struct.pack("<II", 0, 0)) + content


def record(code: int, content: bytes) -> bytes:
    return _RECORD.pack(code, len(content)) + content


def chunk(data: bytes, size: int, crc: int, compression: bytes) -> bytes:
    """A chunk that says what it likes."""
    head = struct.pack("<QQQI", 0, 0, size, crc) + struct.pack("<I", len(compression)) + compression
    return record(CHUNK, head + struct.pack("<Q", len(data)) + data)


def sha256(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()
