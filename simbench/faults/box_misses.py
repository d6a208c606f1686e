"""detector.misses_percent: true objects that are not found, one by one or in bursts.

Per object and camera a two-state chain over the camera's frames: a miss follows a miss with chance 1 - 1/L, a
hit with chance p / ((1 - p) L); without bursts both are p. Drawn for every frame, in view or not. Receipt:
true boxes that are no longer there, and how often a miss follows a miss.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np
from jaxtyping import Bool

from scenarios.faults.detector import Misses
from scenarios.seeding import stream
from simbench.faults.chances import share_allowed
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.labelled import (
    EXACT,
    frames_in,
    judge_share,
    keeps_boxes,
    labelled,
    object_names,
    pairs_of_shots,
    relabelled,
    spares,
)
from simbench.faults.receipt import Receipt, judge
from simbench.faults.struck import struck

NOTE = "true boxes before and after"
FEWEST = 5  # misses, to say what follows them


def _chances(spec: Misses) -> tuple[float, float]:
    """Of a miss after a hit, and after a miss."""
    share = 0.01 * spec.percent
    if spec.burst_frames == 0.0 or share == 0.0:
        return share, share
    return share / ((1.0 - share) * spec.burst_frames), 1.0 - 1.0 / spec.burst_frames


def _missed(spec: Misses, camera: str, name: str, frames: int, seed: int) -> Bool[np.ndarray, " f"]:
    """Whether an object is missed in each frame of a camera."""
    after_hit, after_miss = _chances(spec)
    draw = stream(seed, "fault", spec.name, camera, name).random(frames)
    missed = np.zeros(frames, dtype=bool)
    for f in range(frames):
        if f == 0:
            missed[f] = draw[f] < 0.01 * spec.percent
        else:
            missed[f] = draw[f] < (after_miss if missed[f - 1] else after_hit)
    return missed


def act(spec: Misses, delivery: Delivery, site: Site) -> Acted:
    names, shots = object_names(site), dict(delivery.shots)
    seen = lost = 0
    follows: list[bool] = []
    for camera in struck(spec, site.rig):
        frames = frames_in(shots[camera])
        chains = {i: _missed(spec, camera, name, frames, site.seed) for i, name in names.items()}
        shown = {i: np.zeros(frames, dtype=bool) for i in names}
        result = []
        for shot in shots[camera]:
            f, boxes = shot.detections.seq, labelled(shot)
            kept = [(box, i) for box, i in boxes if i < 0 or not chains[i][f]]
            for _, i in boxes:
                if i >= 0:
                    shown[i][f] = True
            seen += sum(i >= 0 for _, i in boxes)
            lost += len(boxes) - len(kept)
            result.append(relabelled(shot, kept))
        shots[camera] = tuple(result)
        for i, missed in chains.items():
            after_miss = shown[i][1:] & shown[i][:-1] & missed[:-1]
            follows += missed[1:][after_miss].tolist()
    realised = {
        "percent": 100.0 * lost / max(seen, 1),
        "follows": float(np.mean(follows)) if follows else 0.0,
    }
    return Acted(delivery=replace(delivery, shots=shots), realised=realised)


def receipts(spec: Misses, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Share of the true boxes that are gone; with bursts, how often a miss follows a miss."""
    before, spoiled = 0, 0
    gone: dict[tuple[str, int], dict[int, bool]] = defaultdict(dict)
    for was, now in pairs_of_shots(step, struck(spec, site.rig)):
        still = set(labelled(now))
        spoiled += len(still - set(labelled(was)))
        for item in labelled(was):
            if item[1] >= 0:
                before += 1
                gone[was.detections.sensor, item[1]][was.detections.seq] = item not in still
            else:
                spoiled += item not in still
    found = sum(sum(by_frame.values()) for by_frame in gone.values())
    after_hit, after_miss = _chances(spec)
    link = min(max(after_miss - after_hit, -0.99), 0.99)
    result = [
        judge_share(
            spec, "missed", spec.percent, step, found, before, note=NOTE,
            free=before * (1.0 - link) / (1.0 + link),
        )
    ]  # fmt: skip
    follow = [now for by_frame in gone.values() for f, now in by_frame.items() if by_frame.get(f - 1, False)]
    if spec.burst_frames > 0.0 and len(follow) >= FEWEST:
        result.append(
            judge(
                fault=spec.name, quantity="a miss follows a miss", unit="share", requested=after_miss,
                realised=step.realised["follows"], measured=sum(follow) / len(follow), systematic=5.0 * EXACT,
                allowed=share_allowed(after_miss, len(follow)), note=NOTE,
            )
        )  # fmt: skip
    return (*result, *keeps_boxes(spec, step, spoiled, "other boxes lost or new"), *spares(spec, step, site))


FAULT = DeliveryFault(spec=Misses, act=act, receipts=receipts)
