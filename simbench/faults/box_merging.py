"""detector.merged_percent: two objects side by side are found as one.

Pairs of true boxes, nearest first, a box in one pair at most; one draw per pair of objects, camera and frame.
The box around both is the larger one's object, id, category and confidence. Receipt: pairs of which one box
is left that reaches around both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion.messages import BoxPx
from scenarios.faults.detector import Merged
from scenarios.seeding import stream
from simbench.faults.delivery import Delivery, Shot
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.labelled import (
    Labelled,
    frames_in,
    judge_share,
    keeps_boxes,
    labelled,
    object_names,
    pairs_of_shots,
    relabelled,
    spares,
)
from simbench.faults.receipt import Receipt
from simbench.faults.struck import struck

NOTE = "one box around both in place of two"


def act(spec: Merged, delivery: Delivery, site: Site) -> Acted:
    names, shots, seen, merged = object_names(site), dict(delivery.shots), 0, 0
    for camera in struck(spec, site.rig):
        frames = frames_in(shots[camera])
        draws: dict[tuple[str, str], np.ndarray] = {}
        result = []
        for shot in shots[camera]:
            boxes = labelled(shot)
            gone: set[int] = set()
            for a, b in _pairs(boxes, spec.near_fraction):
                first, second = sorted((names[boxes[a][1]], names[boxes[b][1]]))
                if (first, second) not in draws:
                    rng = stream(site.seed, "fault", spec.name, camera, first, second)
                    draws[first, second] = rng.random(frames)
                seen += 1
                if draws[first, second][shot.detections.seq] < 0.01 * spec.percent:
                    merged += 1
                    large, small = (a, b) if _area(boxes[a]) >= _area(boxes[b]) else (b, a)
                    around = _around(boxes[a][0].box_px, boxes[b][0].box_px)
                    boxes[large] = (replace(boxes[large][0], box_px=around), boxes[large][1])
                    gone.add(small)
            result.append(relabelled(shot, [item for k, item in enumerate(boxes) if k not in gone]))
        shots[camera] = tuple(result)
    realised = {"percent": 100.0 * merged / max(seen, 1)}
    return Acted(delivery=replace(delivery, shots=shots), realised=realised)


def _pairs(boxes: list[Labelled], near: float) -> list[tuple[int, int]]:
    """Rows of the boxes that are near enough to be found as one; ties by object."""
    found = []
    for a in range(len(boxes)):
        for b in range(a + 1, len(boxes)):
            (p, i), (q, j) = boxes[a], boxes[b]
            gap = _gap(p.box_px, q.box_px)
            if i >= 0 and j >= 0 and i != j and gap <= near * min(_width(p.box_px), _width(q.box_px)):
                found.append((gap, min(i, j), max(i, j), a, b))
    free, result = set(range(len(boxes))), []
    for *_, a, b in sorted(found):
        if a in free and b in free:
            free -= {a, b}
            result.append((a, b))
    return result


def _gap(p: BoxPx, q: BoxPx) -> float:
    """Between two boxes along the axis on which they are farther apart; negative where they overlap."""
    return max(p[0] - q[2], q[0] - p[2], p[1] - q[3], q[1] - p[3])


def _width(p: BoxPx) -> float:
    return p[2] - p[0]


def _area(item: Labelled) -> float:
    x0, y0, x1, y1 = item[0].box_px
    return (x1 - x0) * (y1 - y0)


def _around(p: BoxPx, q: BoxPx) -> BoxPx:
    return (min(p[0], q[0]), min(p[1], q[1]), max(p[2], q[2]), max(p[3], q[3]))


# -- receipts -----------------------------------------------------------------------------------------------


def receipts(spec: Merged, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Share of the pairs that one box fills, which is the larger one's object and goes on under its id."""
    pairs = joined = spoiled = 0
    for was, now in pairs_of_shots(step, struck(spec, site.rig)):
        old, after = labelled(was), labelled(now)
        by_key = {(b.track_id, i): np.array(b.box_px) for b, i in after}
        joins: set[int] = set()
        for k, m in _near_rows(was, spec.near_fraction):
            pairs += 1
            box = np.array([old[k][0].box_px, old[m][0].box_px])
            hull = np.concatenate([box[:, :2].min(axis=0), box[:, 2:].max(axis=0)])
            area = (box[:, 2] - box[:, 0]) * (box[:, 3] - box[:, 1])
            large, small = (k, m) if area[0] >= area[1] else (m, k)
            here = by_key.get((old[large][0].track_id, old[large][1]))
            other = (old[small][0].track_id, old[small][1])
            if here is not None and other not in by_key and np.array_equal(here, hull):
                joined += 1
                joins |= {k, m}
        spoiled += sum(item not in after for k, item in enumerate(old) if k not in joins)
        spoiled += len(after) != len(old) - len(joins) // 2
    return (
        judge_share(spec, "merged", spec.percent, step, joined, pairs, note=NOTE),
        *keeps_boxes(spec, step, spoiled, "neither themselves nor merged"),
        *spares(spec, step, site),
    )


def _near_rows(shot: Shot, near: float) -> list[tuple[int, int]]:
    """Rows of near boxes by the matrix of all gaps, nearest first, each in one pair at most."""
    ids = np.array(shot.truth.detection_object_id, dtype=np.int64)
    px = np.array([b.box_px for b in shot.detections.boxes]).reshape(-1, 4)
    low, high = px[:, :2], px[:, 2:]
    gap = (low[:, None] - high[None]).max(axis=2)
    gap = np.maximum(gap, gap.T)
    width = high[:, 0] - low[:, 0]
    fits = (gap <= near * np.minimum(width[:, None], width[None])) & (ids[:, None] != ids[None])
    fits &= (ids[:, None] >= 0) & (ids[None] >= 0)
    k, m = np.nonzero(np.triu(fits, 1))
    order = np.lexsort((np.maximum(ids[k], ids[m]), np.minimum(ids[k], ids[m]), gap[k, m]))
    used: set[int] = set()
    rows: list[tuple[int, int]] = []
    for a, b in zip(k[order].tolist(), m[order].tolist(), strict=True):
        if a not in used and b not in used:
            used |= {a, b}
            rows.append((a, b))
    return rows


FAULT = DeliveryFault(spec=Merged, act=act, receipts=receipts)
