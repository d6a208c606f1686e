"""detector.misses_hard_percent: the smaller or more hidden an object, the likelier it is not found.

Per object, camera and frame one free draw u, in view or not: missed where u < percent / 100 * hardness of
the true box in that image. Receipt: boxes that are gone over the sum of the hardness of all that were there,
which is `percent` on average, over all boxes and on either side of hardness 1/2: misses that come evenly are
not it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from scenarios.faults.detector import HardMisses
from scenarios.seeding import stream
from simbench.faults.chances import share_allowed
from simbench.faults.delivery import Delivery, Shot
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.labelled import (
    EXACT,
    NO_BOXES,
    frames_in,
    keeps_boxes,
    labelled,
    object_names,
    pairs_of_shots,
    relabelled,
    spares,
)
from simbench.faults.receipt import Receipt, judge
from simbench.faults.struck import struck
from simbench.truth import TrueBox

NOTE = "true boxes before and after, by their height and visible share"
GROUPS = ("missed", "missed of the harder ones", "missed of the easier ones")


def hardness(spec: HardMisses, box: TrueBox) -> float:
    """How hard it is to see (0..1)."""
    if box.visible_px is None:
        return 1.0
    ratio = (box.visible_px[3] - box.visible_px[1]) / spec.half_height_px
    small, hidden = 1.0 / (1.0 + ratio**2), 1.0 - box.visible_fraction
    return {"size": small, "visibility": hidden, "either": 1.0 - (1.0 - small) * (1.0 - hidden)}[spec.by]


def act(spec: HardMisses, delivery: Delivery, site: Site) -> Acted:
    names, shots = object_names(site), dict(delivery.shots)
    tally = np.zeros((2, 2))  # [harder or easier] (gone, hardness)
    for camera in struck(spec, site.rig):
        frames = frames_in(shots[camera])
        draws = {i: stream(site.seed, "fault", spec.name, camera, n).random(frames) for i, n in names.items()}
        result = []
        for shot in shots[camera]:
            true, kept = {box.object_id: box for box in shot.truth.boxes}, []
            for box, i in labelled(shot):
                hard = hardness(spec, true[i]) if i >= 0 else 0.0
                gone = i >= 0 and draws[i][shot.detections.seq] < 0.01 * spec.percent * hard
                tally[0 if hard >= 0.5 else 1] += (gone, hard)
                if not gone:
                    kept.append((box, i))
            result.append(relabelled(shot, kept))
        shots[camera] = tuple(result)
    rows = (tally.sum(axis=0), *tally)
    realised = {
        name: 100.0 * float(gone / hard) if hard > 0.0 else 0.0
        for name, (gone, hard) in zip(GROUPS, rows, strict=True)
    }
    return Acted(delivery=replace(delivery, shots=shots), realised=realised)


def receipts(spec: HardMisses, step: Step, site: Site) -> tuple[Receipt, ...]:
    """`percent` from what is gone of all boxes, of the harder and of the easier ones; that no other went."""
    rows, spoiled = [], 0
    for was, now in pairs_of_shots(step, struck(spec, site.rig)):
        still = set(labelled(now))
        spoiled += len(still - set(labelled(was)))
        looks = _looks(was)
        for item in labelled(was):
            if item[1] < 0:
                spoiled += item not in still
                continue
            rows.append((*looks[item[1]], item not in still))
    height_px, visible, gone = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    by_size = spec.half_height_px**2 / (spec.half_height_px**2 + height_px**2)
    seen = {
        "size": 1.0 - by_size,
        "visibility": visible,
        "either": (1.0 - by_size) * visible,
    }[spec.by]
    hard = 1.0 - seen
    groups = (np.full(len(hard), True), hard >= 0.5, (hard < 0.5) & (hard > 0.0))
    result = [
        _judged(spec, name, float(gone[group].sum()), hard[group], step.realised)
        for name, group in zip(GROUPS, groups, strict=True)
        if group.any() or name == GROUPS[0]
    ]
    return (*result, *keeps_boxes(spec, step, spoiled, "other boxes lost or new"), *spares(spec, step, site))


def _looks(shot: Shot) -> dict[int, tuple[float, float]]:
    """Height of the visible box in px and visible share of every object in an image."""
    found = {}
    for box in shot.truth.boxes:
        if box.visible_px is not None:
            found[box.object_id] = (box.visible_px[3] - box.visible_px[1], box.visible_fraction)
    return found


def _judged(
    spec: HardMisses, quantity: str, gone: float, hard: np.ndarray, realised: Mapping[str, float]
) -> Receipt:
    """Gone over the sum of hardness. Trials of unequal chances scatter no more than as many of their mean
    chance (Hoeffding 1956), whose exact interval is taken."""
    total = float(hard.sum())
    if total == 0.0:
        return judge(
            fault=spec.name, quantity=quantity, unit="%", requested=spec.percent, realised=spec.percent,
            measured=None, systematic=5.0 * EXACT, allowed=0.0, note=NO_BOXES,
        )  # fmt: skip
    mean = total / len(hard)
    return judge(
        fault=spec.name, quantity=quantity, unit="%", requested=spec.percent,
        realised=realised.get(quantity, 0.0), measured=100.0 * gone / total, systematic=5.0 * EXACT,
        allowed=100.0 * share_allowed(0.01 * spec.percent * mean, len(hard)) / mean, note=NOTE,
    )  # fmt: skip


FAULT = DeliveryFault(spec=HardMisses, act=act, receipts=receipts)
