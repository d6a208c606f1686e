"""How recordings from an enemy are made: see `hostile.py`."""

from __future__ import annotations

import json
import shutil
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np

from simbench.formats.png import encode
from simbench.formats.store import MANIFEST, MESSAGES, TRUTH
from tests.simbench.formats import hostile_parts as parts
from tests.simbench.formats.hostile_parts import CHUNK, frame_changed, numbers

Make = Callable[[Path], Path]


@dataclass(frozen=True, kw_only=True)
class Hostile:
    """make: writes the recording into a folder that is not there, and returns it. says: a part of the
    sentence; empty: any; None: what is read must be what was written, if it is not refused. cut: what came
    before may be read, as INCOMPLETE."""

    make: Make
    says: str | None
    cut: bool = False


def bad(make: Make, says: str | None, *, cut: bool = False) -> Hostile:
    return Hostile(make=make, says=says, cut=cut)


def cut(name: str, share: float) -> Make:
    """A file that ends too early."""

    def make(folder: Path) -> Path:
        path = parts.copy(folder) / name
        raw = path.read_bytes()
        path.write_bytes(raw[: len(raw) - 1 if share == 1.0 else int(share * len(raw))])
        return folder

    return make


def flipped(code: int, within: int, name: str = MESSAGES) -> Make:
    """One bit of the content of the first record of a code."""

    def make(folder: Path) -> Path:
        path = parts.copy(folder) / name
        raw = bytearray(path.read_bytes())
        raw[parts.place(raw, code, within) if code else within] ^= 4
        path.write_bytes(raw)
        return folder

    return make


def mcap(content: Callable[[], bytes], name: str = MESSAGES) -> Make:
    """Another file in place of one."""

    def make(folder: Path) -> Path:
        (parts.copy(folder) / name).write_bytes(content())
        return folder

    return make


def items(change: Callable[[list[parts.Message]], list[parts.Message]], name: str = MESSAGES) -> Make:
    """Other messages, with right checksums, hashes and counts."""

    def make(folder: Path) -> Path:
        parts.rewrite(parts.copy(folder), name, change(parts.messages(name)))
        return folder

    return make


def manifest(**changes: object) -> Make:
    """Another manifest."""

    def make(folder: Path) -> Path:
        parts.change_manifest(parts.copy(folder), lambda data: data | changes)
        return folder

    return make


def source(**changes: object) -> Make:
    """Another source in the manifest."""

    def make(folder: Path) -> Path:
        parts.change_manifest(
            parts.copy(folder), lambda data: data | {"source": data["source"] | changes}
        )  # fmt: skip
        return folder

    return make


def special(name: str, place: Callable[[Path], object]) -> Make:
    """Something that is no file in a file's place."""

    def make(folder: Path) -> Path:
        path = parts.copy(folder) / name
        path.unlink()
        place(path)
        return folder

    return make


def text(name: str, content: bytes) -> Make:
    return mcap(lambda: content, name)


def renamed(name: str) -> Make:
    """A sensor of another name, in its topic, too."""

    def change(found: list[parts.Message]) -> list[parts.Message]:
        one = found[parts.find(found, "lidar_scan")]
        one.topic, one.data = f"/{name}/lidar_scan", parts.packed(one.header | {"sensor": name}, one.body)
        return found

    return items(change)


def swapped(found: list[parts.Message]) -> list[parts.Message]:
    at = len(found) // 2
    while found[at].log_ns == found[at + 1].log_ns:
        at += 1
    found[at], found[at + 1] = found[at + 1], found[at]
    return found


def one_of_another(found: list[parts.Message]) -> list[parts.Message]:
    """A sweep with another's number, and other points."""
    first, second = (parts.find(found, "lidar_scan", nth) for nth in (0, 1))
    header = found[second].header | {"seq": found[first].header["seq"]}
    found[second].data = parts.packed(header, found[second].body)
    return found


def without(kind: str, nth: int) -> Callable[[list[parts.Message]], list[parts.Message]]:
    def change(found: list[parts.Message]) -> list[parts.Message]:
        del found[parts.find(found, kind, nth)]
        return found

    return change


def twice_posed(found: list[parts.Message]) -> list[parts.Message]:
    at = parts.find(found, "poses", 1)
    return [*found[:at], found[at], *found[at:]]


def untargeted(header: dict[str, Any], body: bytes) -> tuple[dict[str, Any], bytes]:
    return {name: value for name, value in header.items() if name != "target_id"}, body


def unhashed(folder: Path) -> Path:
    """A changed sweep with a right CRC and hash of its own, of which the manifest knows nothing."""
    numbers("lidar_scan", "xyz_m", put((0, 0), 3.0))(folder)
    shutil.copy(parts.good_folder() / MANIFEST, folder / MANIFEST)
    return folder


def rehashed_crc(folder: Path) -> Path:
    """A byte of a message changed, its chunk's CRC made right again: only the message's own hash tells."""
    path = parts.copy(folder) / MESSAGES
    raw = path.read_bytes()
    _, begin, end = next(one for one in parts.records(raw) if one[0] == CHUNK)
    (named,) = struct.unpack_from("<I", raw, begin + 28)
    data = bytearray(lz4.frame.decompress(raw[begin + 40 + named : end]))
    data[len(data) // 2] ^= 1
    size = struct.pack("<QI", len(data), zlib.crc32(data))
    packed = lz4.frame.compress(bytes(data))
    inside = raw[begin : begin + 16] + size + struct.pack("<I", 3) + b"lz4"
    body = parts.record(CHUNK, inside + struct.pack("<Q", len(packed)) + packed)
    path.write_bytes(raw[: begin - 9] + body + raw[end:])
    return folder


def unknown_channel() -> bytes:
    message = parts.record(5, struct.pack("<HIQQ", 77, 0, 0, 0) + b"x" * 40)
    return parts.mcap(parts.chunk(message, len(message), zlib.crc32(message), b""))


def put(at: object, value: float) -> Callable[[np.ndarray], None]:
    def change(array: np.ndarray) -> None:
        array[at] = value

    return change


def nested(header: dict[str, Any], body: bytes) -> tuple[bytes, bytes]:
    return b'{"kind": "lidar_scan", "x": ' + b"[" * 10**6 + b"]" * 10**6 + b"}", body


def huge_array(header: dict[str, Any], body: bytes) -> tuple[dict[str, Any], bytes]:
    return header | {"arrays": [{"name": "xyz_m", "dtype": "f64", "shape": [2**32 - 1] * 3}]}, body


def specs(**change: object) -> Callable[[dict[str, Any], bytes], tuple[dict[str, Any], bytes]]:
    """The first array described otherwise."""

    def changed(header: dict[str, Any], body: bytes) -> tuple[dict[str, Any], bytes]:
        first, *others = header["arrays"]
        return header | {"arrays": [first | change, *others]}, body

    return changed


def raw_header(old: bytes, new: bytes) -> Make:
    return frame_changed("lidar_scan", lambda h, b: (json.dumps(h).encode().replace(old, new, 1), b))


def png_bomb() -> bytes:
    """9,000 x 9,000 pixels, 243 MB, in 80 kB."""
    rows = zlib.compress(bytes(9000 * 9001), 9)
    made = b"\x89PNG\r\n\x1a\n"
    for kind, content in (
        (b"IHDR", struct.pack(">IIBBBBB", 9000, 9000, 8, 0, 0, 0, 0)), (b"IDAT", rows), (b"IEND", b""),
    ):  # fmt: skip
        made += struct.pack(">I", len(content)) + kind + content
        made += struct.pack(">I", zlib.crc32(kind + content))
    return made


def png(change: Callable[[], bytes]) -> Make:
    return numbers("camera_png", "png", lambda _: np.frombuffer(change(), np.uint8))


def claims(png: np.ndarray) -> None:
    png[16:24] = np.frombuffer(struct.pack(">II", 2**31 - 1, 2**31 - 1), np.uint8)


def many_boxes(header: dict[str, Any], body: bytes) -> tuple[dict[str, Any], bytes]:
    n = 200_000
    shapes = [("track_id", "i64", [n]), ("box_px", "f64", [n, 4]), ("confidence", "f64", [n])]
    arrays = [{"name": name, "dtype": dtype, "shape": shape} for name, dtype, shape in shapes]
    return header | {"category": ["a"] * n, "arrays": arrays}, bytes(48 * n)


def noise(width: int, height: int) -> bytes:
    return encode(np.arange(width * height * 3, dtype=np.uint8).reshape(height, width, 3))


def more(folder: Path) -> Path:
    parts.change_manifest(
        parts.copy(folder), lambda data: data | {"messages": data["messages"] | {"count": 10**9}}
    )
    return folder


def truth_as_messages(folder: Path) -> Path:
    parts.rewrite(parts.copy(folder), MESSAGES, [*parts.messages(MESSAGES)[:1], *parts.messages(TRUTH)])
    return folder
