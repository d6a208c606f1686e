"""detector.class_confusion_percent: an object is found and called something else.

Per object, camera and frame two draws: whether, and which of the other categories that the detector knows.
Receipt: delivered categories against those of the true objects.
"""

from __future__ import annotations

from dataclasses import replace

from scenarios.faults.detector import ClassConfusion
from scenarios.seeding import stream
from simbench.faults.delivery import Delivery
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

NOTE = "delivered against true categories"


def act(spec: ClassConfusion, delivery: Delivery, site: Site) -> Acted:
    names, known = object_names(site), site.rig.rig.detector.categories
    shots, seen, changed = dict(delivery.shots), 0, 0
    for camera in struck(spec, site.rig):
        frames = frames_in(shots[camera])
        draws = {
            i: stream(site.seed, "fault", spec.name, camera, name).random((frames, 2))
            for i, name in names.items()
        }
        result = []
        for shot in shots[camera]:
            boxes: list[Labelled] = []
            for box, i in labelled(shot):
                others = [category for category in known if category != box.category]
                if i >= 0 and others:
                    whether, which = draws[i][shot.detections.seq]
                    seen += 1
                    if whether < 0.01 * spec.percent:
                        changed += 1
                        box = replace(box, category=others[int(which * len(others))])
                boxes.append((box, i))
            result.append(relabelled(shot, boxes))
        shots[camera] = tuple(result)
    realised = {"percent": 100.0 * changed / max(seen, 1)}
    return Acted(delivery=replace(delivery, shots=shots), realised=realised)


def receipts(spec: ClassConfusion, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Share of the true boxes whose category is not their object's, less that of before."""
    true = {info.object_id: info.category for info in site.motion.world.objects}
    known = set(site.rig.rig.detector.categories)
    wrong = boxes = spoiled = 0
    for was, now in pairs_of_shots(step, struck(spec, site.rig)):
        for (old, i), (new, j) in zip(labelled(was), labelled(now), strict=True):
            if i >= 0 and len(known) > 1:
                boxes += 1
                wrong += (new.category != true[j]) - (old.category != true[i])
                spoiled += new.category not in known
            elif old != new:
                spoiled += 1
            spoiled += i != j or replace(old, category="") != replace(new, category="")
    return (
        judge_share(spec, "another category", spec.percent, step, wrong, boxes, note=NOTE),
        *keeps_boxes(spec, step, spoiled, "changed otherwise"),
        *spares(spec, step, site),
    )


FAULT = DeliveryFault(spec=ClassConfusion, act=act, receipts=receipts)
