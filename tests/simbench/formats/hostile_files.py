"""Results, clouds and folders of KITTI from an enemy: what a file holds, and what must be said of it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.simbench.formats import mini_kitti
from tests.simbench.formats.hostile_makes import png_bomb
from tests.simbench.formats.hostile_parts import ESCAPE

HEADER = b"stamp_ns,x_m,y_m,z_m,track\n"
SCHEMA = b'{"schema": "simbench-outputs/1"}\n'
STAMP = b"100344380"


def line(**changes: bytes) -> bytes:
    """A trajectory of one sample, some of it set to any text."""
    one = {
        "track_id": b"1", "stamp_ns": b"[" + STAMP + b"]", "position_ego_m": b"[[1, 2, 3]]",
        "inlier": b"[true]",
    } | changes  # fmt: skip
    inside = b", ".join(b'"' + name.encode() + b'": ' + value for name, value in one.items())
    return SCHEMA + b'{"trajectory": {' + inside + b"}}\n"


CSV: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", "no column stamp_ns"),
    "bom": (b"\xef\xbb\xbf" + HEADER, "unknown column"),
    "utf-16": ("stamp_ns,x_m,y_m,z_m\n".encode("utf-16"), "no UTF-8"),
    "nul": (b"stamp_ns,x_m\0,y_m,z_m\n", "unknown column|no CSV"),
    "quote-never-closed": (HEADER + b'0,"' + b"1,\n" * 100_000, "no CSV"),
    "columns-by-the-million": (b"," * 10_000_000 + b"\n", "longer than"),
    "values-by-the-million": (HEADER + b"1," * 10_000_000 + b"\n", "longer than"),
    "lines-by-the-million": (HEADER + b"\n" * 300_000 + b"x,1,1,1,\n", "no whole number"),
    "column-of-escapes": (ESCAPE.encode().replace(b"\n\r", b"") + b"," + HEADER, "unknown column"),
    "track-of-escapes": (HEADER + b"-1,1,1,1," + b"\x1b[2J\n", "lies in no sweep"),
    "stamp-1e308": (HEADER + b"1e308,1,1,1,\n", "no whole number"),
    "stamp-of-19-nines": (HEADER + b"9" * 19 + b",1,1,1,\n", "no whole number"),
    "stamp-of-two-signs": (HEADER + b"--5,1,1,1,\n", "no whole number"),
    "stamp-in-other-digits": (HEADER + "\u0665,1,1,1,\n".encode(), "no whole number"),
    "stamp-at-the-end-of-time": (HEADER + b"4611686018427387903,1,1,1,\n", "lies in no sweep"),
    "stamp-before-all-time": (HEADER + b"-4611686018427387903,1,1,1,\n", "lies in no sweep"),
    "position-1e308": (HEADER + STAMP + b",1e308,1e308,0,a\n", "too far away"),
    "position-1e999": (HEADER + STAMP + b",1e999,1,0,a\n", "no finite number"),
    "position-nan": (HEADER + STAMP + b",nan,1,0,a\n", "no finite number"),
    "position-of-100-kb": (HEADER + STAMP + b"," + b"9" * 60_000 + b",1,0,a\n", "no finite number"),
    "confidence-1e308": (b"stamp_ns,x_m,y_m,z_m,confidence\n" + STAMP + b",1,1,1,1e308\n", "confidence"),
    "formula": (HEADER + STAMP + b",=cmd|' /C calc'!A0,1,1,a\n", "no finite number"),
}  # fmt: skip

JSONL: dict[str, tuple[bytes, str]] = {
    "bom": (b"\xef\xbb\xbf" + SCHEMA, "no JSON"),
    "utf-16": (SCHEMA.decode().encode("utf-16"), "no UTF-8"),
    "nested": (SCHEMA + b'{"output": ' + b"[" * 10**6 + b"]" * 10**6 + b"}", "no JSON"),
    "nested-less": (SCHEMA + b'{"output": ' + b"[" * 900 + b"]" * 900 + b"}", ""),
    "line-of-20-mb": (SCHEMA + b'{"output": "' + b"x" * 20_000_000 + b'"}', "longer than"),
    "lines-by-the-million": (SCHEMA + b"\n" * 300_000 + b"3\n", "no JSON object"),
    "stamp-of-5000-digits": (line(stamp_ns=b"[" + b"9" * 5000 + b"]"), "no JSON"),
    "stamp-of-65-bits": (line(stamp_ns=b"[18446744073709551616]"), "less than"),
    "stamp-at-the-end-of-time": (line(stamp_ns=b"[9223372036854775807]"), "outside the recording"),
    "stamp-before-all-time": (line(stamp_ns=b"[-9223372036854775808]"), "outside the recording"),
    "position-1e308": (line(position_ego_m=b"[[1e308, 1e308, 0]]"), "less than or equal"),
    "position-nan": (line(position_ego_m=b"[[NaN, 0, 0]]"), "finite|number"),
    "position-1e999": (line(position_ego_m=b"[[1e999, 0, 0]]"), "finite|less"),
    "key-of-escapes": (SCHEMA + b'{"\\u001b[2J": 1}', "one 'output' or one 'trajectory'"),
    "unknown-key-of-escapes": (line(**{"\\u001b[2J" * 900: b"1"}), "not permitted"),
    "half-a-character": (line(track_id=b'"\\ud800"'), "invalid JSON"),
    "sensor-of-escapes": (
        SCHEMA + b'{"output": {"scan_sensor": "\\u001b[2J", "scan_seq": 0, "scan_stamp_ns": 0, '
        b'"objects": []}}',
        "no scan 0 of",
    ),
    "schema-twice": (SCHEMA + SCHEMA, "one 'output' or one 'trajectory'"),
}  # fmt: skip


def pcd(points: int, data: bytes, **changes: str) -> bytes:
    """A PCD file as ours, but for some entries."""
    entries = {
        "VERSION": "0.7", "FIELDS": "x y z intensity t ring", "SIZE": "4 4 4 4 4 2", "TYPE": "F F F F I I",
        "COUNT": "1 1 1 1 1 1", "WIDTH": str(points), "HEIGHT": "1", "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": str(points), "DATA": "binary",
    } | changes  # fmt: skip
    return "".join(f"{name} {value}\n" for name, value in entries.items()).encode() + data


PCD: dict[str, tuple[bytes, str]] = {
    "points-by-the-exabyte": (pcd(2**62, b""), "whole number"),
    "points-by-the-billion": (pcd(10**10, b""), "and holds 0 bytes"),
    "points-that-overflow": (pcd(2**32, b"", WIDTH="65536", HEIGHT="65536"), "and holds 0 bytes"),
    "width-of-escapes": (pcd(0, b"", WIDTH="\x1b[2J"), "whole number"),
    "fields-of-escapes": (pcd(0, b"", FIELDS="x\x1b[2J"), "FIELDS"),
    "compressed": (pcd(1, bytes(22), DATA="binary_compressed"), "binary_compressed"),
    "bytes-left-over": (pcd(1, bytes(23)), "holds 23 bytes"),
    "header-without-end": (b"#" * 10**6, "no whole PCD header"),
}  # fmt: skip


def _in_place(name: str, place: Callable[[Path], object]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        mini_kitti.write_object(folder, dict(enumerate(mini_kitti.drive(1))))
        (path,) = folder.rglob(name)
        path.unlink()
        place(path)
        return folder

    return make


def _points(value: float) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(np.full((50, 4), [value, 1.0, 1.0, 0.5], dtype="<f4").tobytes())


KITTI: dict[str, tuple[Callable[[Path], Path], str]] = {
    "fifo-as-sweep": (_in_place("*.bin", os.mkfifo), "not a file"),
    "dev-zero-as-sweep": (_in_place("*.bin", lambda p: p.symlink_to("/dev/zero")), "leaves the folder"),
    "folder-as-image": (_in_place("*.png", os.mkdir), "not a file"),
    "circle-as-sweep": (_in_place("*.bin", lambda p: p.symlink_to(p.name)), "cannot be read|no such file"),
    "points-1e30-m-away": (_in_place("*.bin", _points(1e30)), "too far away"),
    "image-bomb": (_in_place("*.png", lambda p: p.write_bytes(png_bomb())), "pixels|image"),
}  # fmt: skip
