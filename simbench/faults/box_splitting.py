"""detector.split_percent: one object is found as two halves.

Per object, camera and frame two draws: whether, and where the right half stands in the list. The left half
keeps the id; the right one's was never used. Both are the object's own, since what is in them is. Receipt:
true boxes in whose place there are two halves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion.messages import Detection
from scenarios.faults.detector import Split
from scenarios.seeding import stream
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.labelled import (
    frames_in,
    fresh_ids,
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

NOTE = "two boxes side by side in place of one"


def act(spec: Split, delivery: Delivery, site: Site) -> Acted:
    names, shots, seen, split = object_names(site), dict(delivery.shots), 0, 0
    for camera in struck(spec, site.rig):
        path = (site.seed, "fault", spec.name, camera)
        frames, ids = frames_in(shots[camera]), fresh_ids(delivery, site, stream(*path, "ids"))
        draws = {i: stream(*path, "object", name).random((frames, 2)) for i, name in names.items()}
        result = []
        for shot in shots[camera]:
            boxes = labelled(shot)
            for box, i in labelled(shot):
                if i < 0:
                    continue
                whether, place = draws[i][shot.detections.seq]
                seen += 1
                if whether < 0.01 * spec.percent:
                    split += 1
                    left, right = _halves(box, next(ids))
                    at = next(k for k, (b, _) in enumerate(boxes) if b is box)
                    boxes[at] = (left, i)
                    boxes.insert(int(place * (len(boxes) + 1)), (right, i))
            result.append(relabelled(shot, boxes))
        shots[camera] = tuple(result)
    realised = {"percent": 100.0 * split / max(seen, 1)}
    return Acted(delivery=replace(delivery, shots=shots), realised=realised)


def _halves(box: Detection, track_id: int) -> tuple[Detection, Detection]:
    x0, y0, x1, y1 = box.box_px
    middle = 0.5 * (x0 + x1)
    left, right = (x0, y0, middle, y1), (middle, y0, x1, y1)
    return replace(box, box_px=left), replace(box, box_px=right, track_id=track_id)


def receipts(spec: Split, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Share of the true boxes that two boxes of the same object now fill, one of them under a new id."""
    had = {b.track_id for s in step.before.shots.values() for shot in s for b in shot.detections.boxes}
    boxes = halved = spoiled = 0
    for was, now in pairs_of_shots(step, struck(spec, site.rig)):
        after = labelled(now)
        explained = 0
        for item in labelled(was):
            box, i = item
            boxes += i >= 0
            if item in after:
                explained += 1
                continue
            own = [b for b, j in after if j == i and (b.track_id == box.track_id or b.track_id not in had)]
            spans = np.array([b.box_px for b in own]).reshape(-1, 4)
            hull = (*spans[:, :2].min(axis=0, initial=np.inf), *spans[:, 2:].max(axis=0, initial=-np.inf))
            apart = abs(np.sum(spans[:, 2] - spans[:, 0]) - (box.box_px[2] - box.box_px[0])) < 1e-6
            if i >= 0 and len(own) == 2 and apart and np.allclose(hull, box.box_px, atol=1e-6):
                halved += 1
                explained += 2
            else:
                spoiled += 1
        spoiled += abs(len(after) - explained)
    return (
        judge_share(spec, "split", spec.percent, step, halved, boxes, note=NOTE),
        *keeps_boxes(spec, step, spoiled, "neither whole nor two halves"),
        *spares(spec, step, site),
    )


FAULT = DeliveryFault(spec=Split, act=act, receipts=receipts)
