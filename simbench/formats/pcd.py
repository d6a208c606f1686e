"""Sweeps as PCD files (version 0.7, binary), which PCL, Open3D and CloudCompare read.

    SENSOR/000000.pcd         x y z [m], intensity as float32, t [ns since the stamp] as int32, ring as int16
    SENSOR/stamps.csv         seq, stamp_ns, arrival_ns: a PCD file has no time
    truth/SENSOR/000000.pcd   object_id, part_id as int32, true_range [m] as float64, point for point

Points stand in firing order, in the LiDAR's own frame, packed and little-endian. Files are read as if they
came from an enemy: nothing is believed that the file's size does not bear out.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64, Int16, Int32, Shaped

from fusion.geometry import readonly
from fusion.messages import LidarScan
from scenarios.errors import BadInput, show
from simbench.files import prepare_empty_folder, write_bytes, write_text
from simbench.recording import Recording
from simbench.truth import ScanTruth

POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("t", "<i4"), ("ring", "<i2")]
)
TRUTH = np.dtype([("object_id", "<i4"), ("part_id", "<i4"), ("true_range", "<f8")])
LETTER = {"f": "F", "i": "I", "u": "U"}  # numpy's kinds of numbers as PCD calls them
IDENTITY = "0 0 0 1 0 0 0"
ENTRIES = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
MOST_HEADER_BYTES = 4096
MOST_BYTES = 256_000_000  # of points: ten million
SENSOR = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,99}")  # what may become the name of a folder


@dataclass(frozen=True, kw_only=True, eq=False)
class PcdScan:
    """The points of a sweep: `LidarScan` without what a PCD file does not hold."""

    xyz_m: Float32[np.ndarray, "n 3"]
    intensity: Float32[np.ndarray, " n"]
    offset_ns: Int32[np.ndarray, " n"]
    ring: Int16[np.ndarray, " n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PcdTruth:
    """What the points of a sweep hit: `ScanTruth` without what a PCD file does not hold."""

    object_id: Int32[np.ndarray, " n"]
    part_id: Int32[np.ndarray, " n"]
    true_range_m: Float64[np.ndarray, " n"]


# -- writing ----------------------------------------------------------------------------------------------


def write_pcd(scan: LidarScan, path: Path) -> None:
    """Write the points of a sweep. BadInput: the place cannot be written."""
    points = np.empty(len(scan.xyz_m), dtype=POINT)
    points["x"], points["y"], points["z"] = scan.xyz_m.T
    points["intensity"], points["t"], points["ring"] = scan.intensity, scan.offset_ns, scan.ring
    _write(points, path)


def write_truth_pcd(truth: ScanTruth, path: Path) -> None:
    """Write what the points of a sweep hit. BadInput as above."""
    points = np.empty(len(truth.object_id), dtype=TRUTH)
    points["object_id"], points["part_id"] = truth.object_id, truth.part_id
    points["true_range"] = truth.true_range_m
    _write(points, path)


def write_pcd_folder(recording: Recording, folder: Path) -> int:
    """Write every sweep and its truth; the number of sweeps. BadInput: there is something in the folder, the
    recording has no sweep, or a LiDAR has a name that is none for a folder."""
    scans = {(m.sensor, m.seq): m for m in reversed(recording.messages) if isinstance(m, LidarScan)}
    truths = {(t.sensor, t.seq): t for t in recording.truth.scans}
    sensors = sorted({sensor for sensor, _ in scans})
    if not sensors:
        raise BadInput("the recording has no sweep of a LiDAR")
    for sensor in sensors:
        if SENSOR.fullmatch(sensor) is None or sensor == "truth":
            raise BadInput(f"{show(sensor)} cannot be the name of a LiDAR's folder")
    prepare_empty_folder(folder)
    for sensor in sensors:
        (folder / sensor).mkdir()
        (folder / "truth" / sensor).mkdir(parents=True)
        stamps = ["seq,stamp_ns,arrival_ns\n"]
        for key in sorted(key for key in scans if key[0] == sensor):
            name = f"{sensor}/{key[1]:06d}.pcd"
            write_pcd(scans[key], folder / name)
            write_truth_pcd(truths[key], folder / "truth" / name)
            stamps.append(f"{key[1]},{scans[key].stamp_ns},{scans[key].arrival_ns}\n")
        write_text(folder / sensor / "stamps.csv", "".join(stamps))
    return len(scans)


def _write(points: Shaped[np.ndarray, " n"], path: Path) -> None:
    fields = [points.dtype[name] for name in points.dtype.names or ()]
    header = {
        "VERSION": "0.7",
        "FIELDS": " ".join(points.dtype.names or ()),
        "SIZE": " ".join(str(field.itemsize) for field in fields),
        "TYPE": " ".join(LETTER[field.kind] for field in fields),
        "COUNT": " ".join("1" for _ in fields),
        "WIDTH": str(len(points)),
        "HEIGHT": "1",
        "VIEWPOINT": IDENTITY,
        "POINTS": str(len(points)),
        "DATA": "binary",
    }
    text = "# .PCD v0.7 - Point Cloud Data file format\n"
    text += "".join(f"{entry} {header[entry]}\n" for entry in ENTRIES)
    write_bytes(path, text.encode("ascii") + points.tobytes())


# -- reading ----------------------------------------------------------------------------------------------


def read_pcd(path: Path) -> PcdScan:
    """The points of a file as `write_pcd` makes it. BadInput: there is none, or it is another."""
    points = _read(path, POINT)
    xyz_m = np.stack([points["x"], points["y"], points["z"]], axis=1)
    return PcdScan(
        xyz_m=readonly(xyz_m, np.float32),
        intensity=readonly(points["intensity"], np.float32),
        offset_ns=readonly(points["t"], np.int32),
        ring=readonly(points["ring"], np.int16),
    )


def read_truth_pcd(path: Path) -> PcdTruth:
    """The truth of a file as `write_truth_pcd` makes it. BadInput as above."""
    points = _read(path, TRUTH)
    return PcdTruth(
        object_id=readonly(points["object_id"], np.int32),
        part_id=readonly(points["part_id"], np.int32),
        true_range_m=readonly(points["true_range"], np.float64),
    )


def _read(path: Path, wanted: np.dtype[np.void]) -> Shaped[np.ndarray, " n"]:
    name = str(path)
    try:
        if not path.is_file():
            raise BadInput("not a file" if path.exists() else "no such file", file=name)
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size  # `read` makes room for all that it is asked for
            raw = file.read(min(size, MOST_HEADER_BYTES + MOST_BYTES + 1))
    except (OSError, ValueError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=name) from None
    header, start = _header(raw, name)
    _check(header, wanted, name)
    count, there = _whole(header, "POINTS", name), len(raw) - start
    if there > MOST_BYTES:
        raise BadInput(f"holds more than {MOST_BYTES // 1_000_000} MB of points", file=name)
    if count * wanted.itemsize != there:
        raise BadInput(
            f"claims {count} points, {count * wanted.itemsize} bytes, and holds {there} bytes of them",
            file=name,
        )
    return np.frombuffer(raw, dtype=wanted, offset=start)


def _header(raw: bytes, name: str) -> tuple[dict[str, str], int]:
    """The entries of the header, each once, and where the points begin."""
    found: dict[str, str] = {}
    at = 0
    for number in range(1, len(ENTRIES) + 20):  # with some lines of comment
        end = raw.find(b"\n", at, MOST_HEADER_BYTES)
        if end < 0:
            break
        line, at = raw[at:end], end + 1
        try:
            entry, _, value = line.decode("ascii").strip().partition(" ")
        except UnicodeDecodeError:
            raise BadInput("is no PCD header", file=name, line=number) from None
        if entry.startswith("#") or not entry:
            continue
        if entry not in ENTRIES or entry in found:
            what = "comes twice" if entry in found else "is no entry of a PCD header"
            raise BadInput(f"{show(entry)} {what}", file=name, line=number)
        found[entry] = value.strip()
        if entry == "DATA":
            missing = [entry for entry in ENTRIES if entry not in found]
            if missing:
                raise BadInput(f"the header has no {missing[0]}", file=name)
            return found, at
    raise BadInput("has no whole PCD header, which ends with a line DATA", file=name)


def _check(header: Mapping[str, str], wanted: np.dtype[np.void], name: str) -> None:
    """BadInput: the header is not that of points of this type."""
    fields = [wanted[field] for field in wanted.names or ()]
    must = {
        "VERSION": ("0.7", ".7"),
        "DATA": ("binary",),
        "FIELDS": (" ".join(wanted.names or ()),),
        "SIZE": (" ".join(str(field.itemsize) for field in fields),),
        "TYPE": (" ".join(LETTER[field.kind] for field in fields),),
        "COUNT": (" ".join("1" for _ in fields),),
        "VIEWPOINT": (IDENTITY,),
    }
    for entry, allowed in must.items():
        if header[entry] not in allowed:
            raise BadInput(f"is {show(header[entry])}", file=name, field=entry, allowed=allowed[0])
    width, height, count = (_whole(header, entry, name) for entry in ("WIDTH", "HEIGHT", "POINTS"))
    if width * height != count:
        raise BadInput(f"WIDTH {width} times HEIGHT {height} is not POINTS {count}", file=name)


def _whole(header: Mapping[str, str], entry: str, name: str) -> int:
    if re.fullmatch(r"[0-9]{1,12}", header[entry]) is None:
        raise BadInput(f"must be a whole number, is {show(header[entry])}", file=name, field=entry)
    return int(header[entry])
