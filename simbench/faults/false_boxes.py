"""detector.false_boxes_per_image: boxes of nothing.

Per camera the counts are Poisson; place, size, category, confidence and place in the list come from a stream
per camera and frame, ids from one per camera. Receipt: boxes that no true object is behind.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion.camera import PinholeCamera
from fusion.messages import Detection
from scenarios.faults.detector import FalseBoxes
from scenarios.seeding import stream
from simbench.faults.chances import count_allowed
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.labelled import (
    EXACT,
    frames_in,
    fresh_ids,
    keeps_boxes,
    labelled,
    pairs_of_shots,
    relabelled,
    spares,
)
from simbench.faults.receipt import Receipt, judge
from simbench.faults.struck import struck

NOTE = "delivered boxes without a true object"
QUANTITY = "false boxes per image"
HEIGHT_SHARE = (0.03, 0.3)  # of the image's height
ASPECT = (0.4, 2.0)  # width over height


def act(spec: FalseBoxes, delivery: Delivery, site: Site) -> Acted:
    shots, added, images = dict(delivery.shots), 0, 0
    known = site.rig.rig.detector.categories
    for camera in struck(spec, site.rig):
        path = (site.seed, "fault", spec.name, camera)
        counts = stream(*path).poisson(spec.boxes_per_image, frames_in(shots[camera]))
        ids = fresh_ids(delivery, site, stream(*path, "ids"))
        result = []
        for shot in shots[camera]:
            rng, boxes = stream(*path, str(shot.detections.seq)), labelled(shot)
            for _ in range(int(counts[shot.detections.seq])):
                box = _false_box(rng, site.rig.pinholes[camera], known, next(ids))
                boxes.insert(int(rng.random() * (len(boxes) + 1)), (box, -1))
            added += int(counts[shot.detections.seq])
            images += 1
            result.append(relabelled(shot, boxes))
        shots[camera] = tuple(result)
    return Acted(
        delivery=replace(delivery, shots=shots), realised={"boxes_per_image": added / max(images, 1)}
    )


def _false_box(
    rng: np.random.Generator, camera: PinholeCamera, known: tuple[str, ...], track_id: int
) -> Detection:
    """A box whose centre is anywhere in the picture, cut at its border."""
    width, height = float(camera.width_px), float(camera.height_px)
    x, y = rng.uniform(0.0, width), rng.uniform(0.0, height)
    high = height * float(np.exp(rng.uniform(*np.log(HEIGHT_SHARE))))
    wide = high * rng.uniform(*ASPECT)
    x0, x1 = max(x - wide / 2, 0.0), min(x + wide / 2, width)
    y0, y1 = max(y - high / 2, 0.0), min(y + high / 2, height)
    return Detection(
        track_id=track_id,
        category=known[int(rng.random() * len(known))],
        box_px=(float(x0), float(y0), float(x1), float(y1)),
        confidence=0.5 + 0.5 * float(rng.random()),
    )


def receipts(spec: FalseBoxes, step: Step, site: Site) -> tuple[Receipt, ...]:
    """False boxes by the truth and boxes in the messages, both more than before; ids, places, true boxes."""
    more = longer = images = spoiled = 0
    had = {b.track_id for s in step.before.shots.values() for shot in s for b in shot.detections.boxes}
    for was, now in pairs_of_shots(step, struck(spec, site.rig)):
        camera = site.rig.pinholes[now.detections.sensor]
        images += 1
        longer += len(now.detections.boxes) - len(was.detections.boxes)
        more += sum(i < 0 for i in now.truth.detection_object_id)
        more -= sum(i < 0 for i in was.truth.detection_object_id)
        old = labelled(was)
        spoiled += sum(item not in labelled(now) for item in old)
        for box, i in labelled(now):
            if i < 0 and (box, i) not in old:
                x0, y0, x1, y1 = box.box_px
                inside = 0.0 <= x0 < x1 <= camera.width_px and 0.0 <= y0 < y1 <= camera.height_px
                spoiled += box.track_id in had or not inside
    if images == 0:
        return (
            judge(
                fault=spec.name, quantity=QUANTITY, unit="boxes", requested=spec.boxes_per_image,
                realised=spec.boxes_per_image, measured=None, systematic=5.0 * EXACT, allowed=0.0,
                note="no image was taken",
            ),
        )  # fmt: skip
    spoiled += abs(longer - more)
    return (
        judge(
            fault=spec.name, quantity=QUANTITY, unit="boxes", requested=spec.boxes_per_image,
            realised=step.realised["boxes_per_image"], measured=more / images, systematic=5.0 * EXACT,
            allowed=count_allowed(spec.boxes_per_image * images) / images + 1e-9, note=NOTE,
        ),
        *keeps_boxes(spec, step, spoiled, "boxes lost, outside, or with a known id"),
        *spares(spec, step, site),
    )  # fmt: skip


FAULT = DeliveryFault(spec=FalseBoxes, act=act, receipts=receipts)
