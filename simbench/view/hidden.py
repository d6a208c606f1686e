"""What no pipeline may see: the page's second block of data, apart from the first. The page draws nothing of
it while its truth is switched off."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Int16, Int64

from simbench.recording import Recording
from simbench.view.caps import MOST_BOXES, MOST_OBJECTS, short
from simbench.view.latest import NONE
from simbench.view.packed import FARTHEST_M, NOWHERE, YAW_STEPS, centimetres, packed
from simbench.view.placed import middle_ns, placed
from simbench.view.seen import Shown
from simbench.view.sweeps import Sweep

NOTHING, UNKNOWN = -1, -2  # a point on the ground; a point of which the truth says nothing


def hidden_block(recording: Recording, shown: Shown) -> dict[str, Any]:
    """The block. starts_ns, middles_ns: true times of each sweep; null: the truth holds nothing of the sweep.
    places: [sweeps objects 3], centimetres x and y in the ego frame and heading in 1e-4 rad, at that time.
    points: per shown point the row of its object."""
    truth = recording.truth
    objects = truth.objects[:MOST_OBJECTS]
    targets = {*truth.targets, *([] if truth.target_id is None else [truth.target_id])}
    scans = {(scan.sensor, scan.seq): scan for scan in truth.scans}
    rows = {info.object_id: row for row, info in enumerate(objects)}
    ids = np.array([info.object_id for info in objects], dtype=np.int64)
    starts, middles = list[int | None](), list[int | None]()
    points, places = list[Int16[np.ndarray, " n"]](), list[Int16[np.ndarray, "o 3"]]()
    for sweep in shown.sweeps:
        scan = scans.get((sweep.scan.sensor, sweep.scan.seq))
        known = scan is not None and len(scan.object_id) == len(sweep.scan.xyz_m)
        hit = scan.object_id[sweep.kept] if scan is not None and known else None
        points.append(_rows(hit, ids, len(sweep.kept)))
        fire_ns = scan.fire_ns if scan is not None and known else np.zeros(0, dtype=np.int64)
        middle = middle_ns(sweep.scan, fire_ns, truth.period_ns) if known else None
        there = None if middle is None else _places(recording, ids, middle)
        starts.append(_start_ns(sweep, fire_ns) if known else None)
        middles.append(None if there is None else middle)
        places.append(np.full((len(ids), 3), NOWHERE, dtype=np.int16) if there is None else there)
    return {
        "objects": [
            {
                "id": info.object_id, "name": short(info.name), "category": short(info.category),
                "size_m": np.round(np.nan_to_num(info.size_m, posinf=0.0, neginf=0.0), 3).tolist(),
                "target": info.object_id in targets,
            }
            for info in objects
        ],
        "left_out": len(truth.objects) - len(objects),
        "starts_ns": starts,
        "middles_ns": middles,
        "places": packed(np.concatenate(places)),
        "points": packed(np.concatenate(points)),
        "taken": _taken(recording, shown, rows),
    }  # fmt: skip


def _rows(
    object_id: np.ndarray | None, ids: Int64[np.ndarray, " objects"], count: int
) -> Int16[np.ndarray, " n"]:
    """Ids of objects as rows of the list of objects."""
    if object_id is None:
        return np.full(count, UNKNOWN, dtype=np.int16)
    if not len(ids):
        return np.where(object_id < 0, NOTHING, UNKNOWN).astype(np.int16)
    order = np.argsort(ids, kind="stable")
    at = np.minimum(np.searchsorted(ids[order], object_id), len(ids) - 1)
    found = order[at]
    rows = np.where(ids[found] == object_id, found, UNKNOWN)
    return np.where(object_id < 0, NOTHING, rows).astype(np.int16)


def _start_ns(sweep: Sweep, fire_ns: Int64[np.ndarray, " n"]) -> int:
    """What the stamp of the first firing would be on a true clock."""
    scan = sweep.scan
    if not len(fire_ns):
        return int(scan.stamp_ns)
    return int(np.median(fire_ns - scan.offset_ns))


def _places(
    recording: Recording, ids: Int64[np.ndarray, " objects"], t_ns: int
) -> Int16[np.ndarray, "objects 3"] | None:
    """Centre and heading of everything at a true time, as the page holds them; None: nobody knows."""
    at = placed(recording, ids.tolist(), t_ns)
    if at is None:
        return None
    yaw_rad = np.arctan2(at.rotation[:, 1, 0], at.rotation[:, 0, 0])
    near = (np.abs(at.centre_m) < FARTHEST_M).all(axis=1) & np.isfinite(yaw_rad)  # False for NaN
    places = np.full((len(ids), 3), NOWHERE, dtype=np.int16)
    places[near, :2] = centimetres(at.centre_m[near, :2])
    places[near, 2] = np.rint(yaw_rad[near] * YAW_STEPS)
    return places


def _taken(recording: Recording, shown: Shown, rows: dict[int, int]) -> dict[str, dict[str, Any]]:
    """Per shown image or detections, by place: when it was really taken, and the visible part of each true
    object in it: [row, x0, y0, x1, y1] in pixels."""
    truths = {(image.sensor, image.seq): image for image in recording.truth.images}
    places = {int(place) for of in (*shown.images, *shown.boxes) for place in of} - {NONE}
    found: dict[str, dict[str, Any]] = {}
    for place in sorted(places):
        message = recording.messages[place]
        image = truths.get((message.sensor, message.seq))
        if image is None:
            continue
        boxes = [
            [rows[box.object_id], *(round(float(v), 1) for v in box.visible_px)]
            for box in image.boxes
            if box.visible_px is not None and box.object_id in rows and np.isfinite(box.visible_px).all()
        ]
        found[str(place)] = {"capture_ns": int(image.capture_ns), "boxes": boxes[:MOST_BOXES]}
    return found
