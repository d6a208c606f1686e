#!/usr/bin/env python3
"""A pipeline in no framework: the standard library and the protocol of docs/pipeline.md, nothing of simbench.

Run it by: simbench run overtake-approach --pipeline 'exec:python3 docs/external_pipeline.py' --images none

The nearest return within a metre of straight ahead is "the object" of the newest detection. It is no good
fusion, but it says everything that a pipeline can say.
"""

import json
import math
import struct
import sys

SIZES = {"u8": "B", "i16": "h", "i32": "i", "i64": "q", "f32": "f", "f64": "d"}


def read():
    """The next frame: its fields, and its arrays as flat tuples of numbers."""
    head = sys.stdin.buffer.read(12)
    if not head:
        return None, {}
    _, header, _ = struct.unpack("<4sII", head)
    fields = json.loads(sys.stdin.buffer.read(header))
    arrays = {}
    for spec in fields["arrays"]:
        code = f"<{math.prod(spec['shape'])}{SIZES[spec['dtype']]}"
        arrays[spec["name"]] = struct.unpack(code, sys.stdin.buffer.read(struct.calcsize(code)))
    return fields, arrays


def write(fields, **arrays):
    """A frame. An array is given as (dtype, shape, numbers)."""
    specs = [{"name": name, "dtype": a[0], "shape": a[1]} for name, a in arrays.items()]
    body = b"".join(struct.pack(f"<{len(a[2])}{SIZES[a[0]]}", *a[2]) for a in arrays.values())
    header = json.dumps({**fields, "arrays": specs}).encode()
    sys.stdout.buffer.write(struct.pack("<4sII", b"SBF1", len(header), len(body)) + header + body)
    sys.stdout.buffer.flush()


def answer(told, arrays, seen):
    """The answer to a lidar_scan."""
    xyz = arrays["xyz_m"]
    ahead = [i for i in range(len(xyz) // 3) if xyz[3 * i] > 0.0 and abs(xyz[3 * i + 1]) < 1.0]
    if not seen or not ahead:
        return {"kind": "nothing", "id": told["id"]}, {}
    nearest = min(ahead, key=lambda i: xyz[3 * i])
    x, y, z = xyz[3 * nearest : 3 * nearest + 3]
    fields = {"kind": "output", "id": told["id"], "scan_sensor": told["sensor"], "scan_seq": told["seq"]}
    fields |= {"category": [seen["category"]], "sensor": [seen["sensor"]]}
    return fields, {
        "track_id": ("i64", [1], [seen["track_id"]]),
        "stamp_ns": ("i64", [1], [told["stamp_ns"] + arrays["offset_ns"][nearest]]),
        "position_ego_m": ("f64", [1, 3], [x, y, z]),
        "distance_m": ("f64", [1], [math.hypot(x, y)]),
        "azimuth_rad": ("f64", [1], [math.atan2(y, x)]),
        "confidence": ("f64", [1], [1.0]),
        "count": ("i64", [1], [1]),
        "points": ("i64", [1], [nearest]),
    }


def main():
    seen = {}
    while True:
        told, arrays = read()
        if told is None:
            return
        kind, number = told["kind"], told["id"]
        if kind == "describe":
            write(
                {
                    "kind": "description",
                    "id": number,
                    "protocol": "simbench-pipeline/1",
                    "reads_images": False,
                }
            )
        elif kind == "reset":
            seen = {}
            write({"kind": "ready", "id": number})
        elif kind == "finish":
            none = ("i64", [0], [])
            write(
                {"kind": "trajectories", "id": number},
                track_id=none,
                count=none,
                stamp_ns=none,
                position_ego_m=("f64", [0, 3], []),
                inlier=("u8", [0], []),
            )
        elif kind == "lidar_scan":
            fields, found = answer(told, arrays, seen)
            write(fields, **found)
        else:
            if kind == "detections" and told["category"]:
                seen = {
                    "sensor": told["sensor"],
                    "category": told["category"][0],
                    "track_id": arrays["track_id"][0],
                }
            write({"kind": "nothing", "id": number})


main()
