"""Boxes beside the objects behind them, and what the receipts of box faults share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from fusion.messages import Detection
from scenarios.faults import FaultSpec
from simbench.faults.chances import share_allowed
from simbench.faults.delivery import Delivery, Shot
from simbench.faults.fault import Site, Step
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import struck
from simbench.sensors.detector import TRACK_IDS, draw_track_ids

Labelled = tuple[Detection, int]
"""A box and the true object behind it (-1: a false box)."""

EXACT = 1e-6  # of a count
NO_BOXES = "no box was delivered that it could act on"


def labelled(shot: Shot) -> list[Labelled]:
    """The boxes of a shot with their objects, in order."""
    return list(zip(shot.detections.boxes, shot.truth.detection_object_id, strict=True))


def relabelled(shot: Shot, boxes: Iterable[Labelled]) -> Shot:
    """The same shot with other boxes; message and truth move together."""
    boxes = list(boxes)
    return replace(
        shot,
        detections=replace(shot.detections, boxes=tuple(box for box, _ in boxes)),
        truth=replace(shot.truth, detection_object_id=tuple(object_id for _, object_id in boxes)),
    )


def frames_in(shots: Sequence[Shot]) -> int:
    """Frames to draw for: one for every number that a shot may have."""
    return 1 + max((shot.detections.seq for shot in shots), default=-1)


def object_names(site: Site) -> dict[int, str]:
    """What names the stream of each object."""
    return {info.object_id: info.name for info in site.motion.world.objects}


def fresh_ids(delivery: Delivery, site: Site, rng: np.random.Generator) -> Iterator[int]:
    """Track ids that are no object's and that nobody has had, one after the other."""
    taken = set(draw_track_ids(site.motion.world.objects, site.seed).values())
    taken |= {b.track_id for shots in delivery.shots.values() for s in shots for b in s.detections.boxes}
    while True:
        track_id = int(rng.integers(TRACK_IDS))
        if track_id not in taken:
            taken.add(track_id)
            yield track_id


# -- receipts -----------------------------------------------------------------------------------------------


def pairs_of_shots(step: Step, cameras: Iterable[str]) -> Iterator[tuple[Shot, Shot]]:
    """The shots of some cameras before and after a fault that drops none."""
    for camera in cameras:
        yield from zip(step.before.shots[camera], step.after.shots[camera], strict=True)


def judge_share(
    spec: FaultSpec, quantity: str, percent: float, step: Step, found: int, of: int, *,
    note: str, free: float | None = None,
) -> Receipt:  # fmt: skip
    """`found` of `of` in percent, against realised `percent`. free: independent ones among them."""
    if of == 0:
        return judge(
            fault=spec.name, quantity=quantity, unit="%", requested=percent, realised=percent,
            measured=None, systematic=5.0 * EXACT, allowed=0.0, note=NO_BOXES,
        )  # fmt: skip
    return judge(
        fault=spec.name, quantity=quantity, unit="%", requested=percent,
        realised=step.realised.get("percent", 0.0), measured=100.0 * found / of, systematic=5.0 * EXACT,
        allowed=100.0 * share_allowed(0.01 * percent, of if free is None else free), note=note,
    )  # fmt: skip


def spares(spec: FaultSpec, step: Step, site: Site) -> tuple[Receipt, ...]:
    """That the cameras which the fault does not name deliver what they did."""
    named = struck(spec, site.rig)
    found = []
    for camera in step.before.shots:
        if camera not in named:
            changed = sum(labelled(was) != labelled(now) for was, now in pairs_of_shots(step, (camera,)))
            found.append((float(changed), EXACT))
    return untouched(
        fault=spec.name, quantity="changed images of the other cameras", unit="images", found=found,
        note="delivered boxes, one by one",
    )  # fmt: skip


def keeps_boxes(spec: FaultSpec, step: Step, spoiled: int, quantity: str) -> tuple[Receipt, ...]:
    """That nothing else happened to the boxes: `spoiled` counts those to which it did."""
    return untouched(
        fault=spec.name, quantity=quantity, unit="boxes", found=((float(spoiled), EXACT),),
        note="delivered boxes, one by one",
    )  # fmt: skip


def objects_in(boxes: Iterable[Labelled]) -> Counter[int]:
    """How many boxes each true object has."""
    return Counter(object_id for _, object_id in boxes if object_id >= 0)
