"""A PointCloud2 of anybody's driver as the points of a `LidarScan`.

What is no return is no point: points with a number that is not finite, and those at the sensor's very centre
(how drivers write a miss), are left out and counted. Points are put in the order of their firing. Where
points were fired before the message's stamp, the stamp becomes the first firing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int16, Int32

from simbench.formats.ros2.cdr import Message, MessageError
from simbench.formats.ros2.topics import LidarTopics, PointTime

MOST_POINTS = 10_000_000
LONGEST_NS = 2**31 - 1  # of a sweep, from its stamp
MOST_NS = 4e18  # what 64 bits can say, and a stamp more
NO_RING, UNKNOWN_RING, MOST_RING = -1, 65535, 32767
DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}  # sensor_msgs/PointField
NS = {"s": 1e9, "us": 1e3, "ns": 1.0}


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloud:
    """The points as they will stand in a scan. stamp_ns: of the first firing. misses: points that were left
    out. cut: intensities above 1 or below 0, which were cut."""

    stamp_ns: int
    xyz_m: Float32[np.ndarray, "n 3"]
    intensity: Float32[np.ndarray, " n"]
    offset_ns: Int32[np.ndarray, " n"]
    ring: Int16[np.ndarray, " n"]
    misses: int
    cut: int


def cloud_of(message: Message, stamp_ns: int, topics: LidarTopics) -> Cloud:
    """The points of a message. MessageError: its layout is impossible, or a field is not there."""
    points = _points(message)
    with np.errstate(all="ignore"):  # what is no float32 becomes infinite, and is left out
        columns = [_column(points, name).astype(np.float32) for name in ("x", "y", "z")]
    xyz_m = np.stack(columns, axis=1)
    given = _column(points, topics.time.field) if topics.time else None
    kept = np.isfinite(xyz_m).all(axis=1) & (xyz_m != 0.0).any(axis=1)
    if given is not None:
        kept &= np.isfinite(given)
    intensity: np.ndarray = np.zeros(len(points), dtype=np.float32)
    if topics.intensity is not None:
        intensity = _column(points, topics.intensity.field) / np.float32(topics.intensity.full)
        kept &= np.isfinite(intensity)
    ring = _rings(points, topics.ring)
    offset_ns = np.zeros(int(kept.sum()), dtype=np.int64)
    if given is not None and topics.time is not None:
        offset_ns = _offsets(given[kept], topics.time, stamp_ns)
    early_ns = min(int(offset_ns.min(initial=0)), 0)
    offset_ns = offset_ns - early_ns
    span_ns = int(offset_ns.max(initial=0))
    if span_ns > LONGEST_NS or early_ns < -LONGEST_NS:
        span_ns = max(span_ns, -early_ns)
        raise MessageError(
            f"its points' times lie {span_ns * 1e-9:.3g} s from its stamp, more than 2 s: is the unit right?"
        )
    order = np.flatnonzero(kept)
    if (np.diff(offset_ns) < 0).any():
        by_time = np.argsort(offset_ns, kind="stable")
        order, offset_ns = order[by_time], offset_ns[by_time]
    bright = intensity[order]
    return Cloud(
        stamp_ns=stamp_ns + early_ns,
        xyz_m=xyz_m[order],
        intensity=np.clip(bright, 0.0, 1.0).astype(np.float32),
        offset_ns=offset_ns.astype(np.int32),
        ring=ring[order],
        misses=len(points) - len(order),
        cut=int(((bright < 0.0) | (bright > 1.0)).sum()),
    )


def _points(message: Message) -> np.ndarray:
    """All points as rows of a structured array; nothing is made before the sizes are checked."""
    height, width, step, row_step = (message[key] for key in ("height", "width", "point_step", "row_step"))
    data = message["data"]
    count = height * width
    if count > MOST_POINTS:
        raise MessageError(f"{height} x {width} points are more than {MOST_POINTS}")
    dtype = _dtype(message)
    if count == 0:
        return np.zeros(0, dtype=dtype)
    if row_step < width * step or height * row_step != len(data):
        raise MessageError(
            f"{height} x {width} points of {step} bytes do not fit {len(data)} bytes in rows of {row_step}"
        )
    rows = np.frombuffer(data, dtype=np.uint8).reshape(height, row_step)[:, : width * step]
    return np.ascontiguousarray(rows).view(dtype).reshape(count)


def _dtype(message: Message) -> np.dtype[np.void]:
    step, fields = message["point_step"], message["fields"]
    order = ">" if message["is_bigendian"] else "<"
    if not 0 < step <= 65536 or len(fields) > 256:
        raise MessageError(f"a point of {step} bytes with {len(fields)} fields")
    formats: dict[str, tuple[str, int]] = {}
    for field in fields:
        name, code = field["name"], DATATYPES.get(field["datatype"])
        shown = repr(name[:40])
        if code is None:
            raise MessageError(f"its field {shown} has the unknown datatype {field['datatype']}")
        size = int(code[1]) * field["count"]
        if field["offset"] + size > step:
            raise MessageError(f"its field {shown} reaches beyond a point of {step} bytes")
        if name in formats:
            raise MessageError(f"it has two fields {shown}")
        if name and field["count"] == 1:
            formats[name] = (order + code, field["offset"])
    return np.dtype({
        "names": list(formats), "formats": [code for code, _ in formats.values()],
        "offsets": [at for _, at in formats.values()], "itemsize": step,
    })  # fmt: skip


def _column(points: np.ndarray, name: str) -> np.ndarray:
    known = points.dtype.names or ()
    if name not in known:
        raise MessageError(f"it has no field '{name}' of one number (there are: {', '.join(known)[:200]})")
    return np.asarray(points[name])


def _rings(points: np.ndarray, field: str | None) -> Int16[np.ndarray, " n"]:
    if field is None:
        return np.full(len(points), NO_RING, dtype=np.int16)
    ring = _column(points, field)
    if ring.dtype.kind == "f" and not (np.isfinite(ring).all() and (ring == np.floor(ring)).all()):
        raise MessageError("a ring is no whole number")
    with np.errstate(all="ignore"):  # a float beyond 64 bits becomes negative
        wide = ring.astype(np.int64)
    wide[wide == UNKNOWN_RING] = NO_RING
    if len(wide) and not NO_RING <= wide.min() <= wide.max() <= MOST_RING:
        raise MessageError(f"its rings are {wide.min()} to {wide.max()}, not 0 to {MOST_RING}")
    return wide.astype(np.int16)


def _offsets(given: np.ndarray, time: PointTime, stamp_ns: int) -> np.ndarray:
    """Firing times [n] from the stamp, in whole nanoseconds; integers stay exact."""
    factor = NS[time.unit]
    base_ns = stamp_ns if time.counts_from == "1970" else 0
    if len(given) and float(np.abs(given.astype(np.float64)).max()) * factor > MOST_NS:
        raise MessageError("its points' times are no times")
    if given.dtype.kind == "f":
        return np.round((given.astype(np.float64) - base_ns / factor) * factor).astype(np.int64)
    return given.astype(np.int64) * int(factor) - base_ns
