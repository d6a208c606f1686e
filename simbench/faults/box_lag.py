"""detector.lag_frames: a smoothing tracker shows each box between where it is and where it was.

box[f] = (1 - a) box[f] + a box[f - 1] by track, from what the detector found in both frames. Receipt: how far
the box of each true object lies on the way back to its place in the frame before.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from fusion.messages import BoxPx
from scenarios.faults.detector import BoxLag
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.labelled import (
    EXACT,
    Labelled,
    keeps_boxes,
    labelled,
    objects_in,
    pairs_of_shots,
    relabelled,
    spares,
)
from simbench.faults.receipt import Receipt, judge
from simbench.faults.struck import struck

NOTE = "boxes of the same object in this frame and the one before"
LEAST_PX = 0.1  # that boxes must move in all, to show a lag


def act(spec: BoxLag, delivery: Delivery, site: Site) -> Acted:
    shots = dict(delivery.shots)
    for camera in struck(spec, site.rig):
        by_frame = {
            shot.detections.seq: {box.track_id: box.box_px for box in shot.detections.boxes}
            for shot in shots[camera]
        }
        result = []
        for shot in shots[camera]:
            before = by_frame.get(shot.detections.seq - 1, {})
            boxes: list[Labelled] = []
            for box, i in labelled(shot):
                was = before.get(box.track_id)
                if was is not None:
                    box = replace(box, box_px=_between(box.box_px, was, spec.lag_frames))
                boxes.append((box, i))
            result.append(relabelled(shot, boxes))
        shots[camera] = tuple(result)
    return Acted(delivery=replace(delivery, shots=shots), realised={"lag_frames": float(spec.lag_frames)})


def _between(now: BoxPx, was: BoxPx, lag: float) -> BoxPx:
    x0, y0, x1, y1 = (n + lag * (w - n) for n, w in zip(now, was, strict=True))
    return (x0, y0, x1, y1)


def receipts(spec: BoxLag, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Least squares of the delivered shift on the way back, over objects with one box in both frames."""
    seen: dict[tuple[str, int], dict[int, tuple[np.ndarray, np.ndarray]]] = defaultdict(dict)
    spoiled = 0
    for was, now in pairs_of_shots(step, struck(spec, site.rig)):
        once = {i for i, n in objects_in(labelled(was)).items() if n == 1}
        for (old, i), (new, j) in zip(labelled(was), labelled(now), strict=True):
            spoiled += i != j or replace(old, box_px=new.box_px) != new
            if i in once:
                boxes = np.array(old.box_px), np.array(new.box_px)
                seen[was.detections.sensor, i][was.detections.seq] = boxes
    back, shift = [], []
    for by_frame in seen.values():
        for f, (old_px, new_px) in by_frame.items():
            if f - 1 in by_frame:
                back.append(by_frame[f - 1][0] - old_px)
                shift.append(new_px - old_px)
    way, moved = np.array(back).reshape(-1, 4), np.array(shift).reshape(-1, 4)
    power = float(np.sum(way**2))
    shows = power > LEAST_PX**2
    return (
        judge(
            fault=spec.name, quantity="lag", unit="frames", requested=spec.lag_frames,
            realised=step.realised["lag_frames"],
            measured=float(np.sum(way * moved)) / power if shows else None, systematic=5.0 * EXACT,
            allowed=0.01 * spec.lag_frames, note=NOTE if shows else "no box moved",
        ),
        *keeps_boxes(spec, step, spoiled, "changed otherwise"),
        *spares(spec, step, site),
    )  # fmt: skip


FAULT = DeliveryFault(spec=BoxLag, act=act, receipts=receipts)
