"""detector.identity_switches_per_s: the tracker takes one object for another, from then on.

Per camera and frame three draws: whether, and which tracks. Only tracks that this camera has shown before and
shows now can be confused. What they swap are ids: the box still is who it was. Receipt: changes of the id
under which a camera shows what was one track.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

from scenarios.faults.detector import IdentitySwitches
from scenarios.seeding import stream
from simbench.faults.chances import share_allowed
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.labelled import (
    EXACT,
    NO_BOXES,
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

NOTE = "changes of ids, frame by frame"
QUANTITY = "identity switches"


def act(spec: IdentitySwitches, delivery: Delivery, site: Site) -> Acted:
    shots, switches, time_s = dict(delivery.shots), 0, 0.0
    least = 2 if spec.mode == "swap" else 1
    for camera in struck(spec, site.rig):
        path, frame_s = (site.seed, "fault", spec.name, camera), 1.0 / site.rig.cameras[camera].rate_hz
        draws = stream(*path).random((frames_in(shots[camera]), 3))
        ids = fresh_ids(delivery, site, stream(*path, "ids"))
        now: dict[int, int] = {}  # the id that each track goes under
        known: set[int] = set()
        result = []
        for shot in shots[camera]:
            tracks = [(i, box.track_id) for box, i in labelled(shot) if i >= 0]
            able = [track for _, track in sorted(tracks) if track in known]
            if len(able) >= least:
                time_s += frame_s
                whether, first, second = draws[shot.detections.seq]
                if whether < spec.per_s * frame_s:
                    switches += 1
                    a = able.pop(int(first * len(able)))
                    if spec.mode == "swap":
                        b = able[int(second * len(able))]
                        now[a], now[b] = now.get(b, b), now.get(a, a)
                    else:
                        now[a] = next(ids)
            known |= {track for _, track in tracks}
            result.append(
                relabelled(
                    shot,
                    [(replace(b, track_id=now.get(b.track_id, b.track_id)), i) for b, i in labelled(shot)],
                )
            )
        shots[camera] = tuple(result)
    return Acted(
        delivery=replace(delivery, shots=shots), realised={"per_s": switches / time_s if time_s else 0.0}
    )


def receipts(spec: IdentitySwitches, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Changes of id over the time in which a camera shows tracks that can be confused; a swap is two."""
    changes, frames, time_s, spoiled = 0, 0, 0.0, 0
    last: dict[tuple[str, int], int] = {}
    shown: dict[str, set[int]] = defaultdict(set)
    for was, now in pairs_of_shots(step, struck(spec, site.rig)):
        camera = was.detections.sensor
        again = {b.track_id for b, i in labelled(was) if i >= 0} & shown[camera]
        if len(again) >= (2 if spec.mode == "swap" else 1):
            frames += 1
            time_s += 1.0 / site.rig.cameras[camera].rate_hz
        for (old, i), (new, j) in zip(labelled(was), labelled(now), strict=True):
            spoiled += i != j or replace(old, track_id=0) != replace(new, track_id=0)
            if i >= 0:
                changes += last.get((camera, old.track_id), old.track_id) != new.track_id
                last[camera, old.track_id] = new.track_id
                shown[camera].add(old.track_id)
    if frames == 0:
        one = judge(
            fault=spec.name, quantity=QUANTITY, unit="per s", requested=spec.per_s, realised=spec.per_s,
            measured=None, systematic=5.0 * EXACT, allowed=0.0, note=NO_BOXES,
        )  # fmt: skip
    else:
        frame_s = time_s / frames
        one = judge(
            fault=spec.name, quantity=QUANTITY, unit="per s", requested=spec.per_s,
            realised=step.realised["per_s"],
            measured=changes / (2.0 if spec.mode == "swap" else 1.0) / time_s, systematic=5.0 * EXACT,
            allowed=share_allowed(min(spec.per_s * frame_s, 1.0), frames) / frame_s, note=NOTE,
        )  # fmt: skip
    return (one, *keeps_boxes(spec, step, spoiled, "changed otherwise"), *spares(spec, step, site))


FAULT = DeliveryFault(spec=IdentitySwitches, act=act, receipts=receipts)
