"""Laws that hold for every fault of a delivery, and a delivery made by hand to ask them of.

Traffic of `OTHERS` objects whose boxes drift through the pictures of the car's cameras, each frame with its
truth; the reference is the rig's own. Nothing is cast or rendered, so that a law costs milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from fusion.geometry import Transform
from fusion.messages import Detection, Detections
from scenarios.faults import FaultSpec
from scenarios.seeding import stream
from simbench.capture import _reference, set_in_motion
from simbench.faults.deliver import DELIVERY_FAULTS
from simbench.faults.delivery import Delivery, Shot
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.receipt import MISMATCH, Receipt
from simbench.sensors.detector import draw_track_ids
from simbench.truth import ImageTruth, ObjectInfo, TrueBox
from tests.simbench.support import staged

OTHERS = 7
FRAMES = 40
PERIOD_NS = 100_000_000


@cache
def site(seed: int = 0, system: str = "car") -> Site:
    """Where the faults act: a catalogue scenario with more traffic, which only boxes show."""
    at = staged(system, duration_s=FRAMES * PERIOD_NS * 1e-9)
    real = at.world.objects
    traffic = tuple(
        ObjectInfo(object_id=len(real) + i, name=f"car-{i}", category="car", size_m=(4.0, 1.8, 1.5))
        for i in range(OTHERS)
    )
    world = replace(at.world, objects=(*real, *traffic))
    motion = set_in_motion(world, at.rig, at.system.ego, None)
    return Site(rig=at.rig, motion=motion, duration_s=at.system.duration_s, seed=seed)


@cache
def clean(system: str = "car") -> Delivery:
    """What the sensors measured."""
    at, place = staged(system, duration_s=FRAMES * PERIOD_NS * 1e-9), site(0, system)
    target = next(o.object_id for o in at.world.objects if o.name == at.system.target)
    return Delivery(
        sweeps=(),
        shots={name: _shots(name, place) for name in place.rig.cameras},
        motions=(),
        reference=_reference(place.rig, place.motion, target, FRAMES * PERIOD_NS, 0),
    )


def _shots(camera: str, place: Site) -> tuple[Shot, ...]:
    pinhole, objects = place.rig.pinholes[camera], place.motion.world.objects
    ids, rng = draw_track_ids(objects, place.seed), stream(0, "laws", camera)
    width, height = float(pinhole.width_px), float(pinhole.height_px)
    traffic = objects[-OTHERS:]
    x, drift = rng.uniform(0.1, 0.9, OTHERS) * width, rng.uniform(-0.002, 0.002, OTHERS) * width
    wide = rng.uniform(0.05, 0.15, OTHERS) * width
    looks = stream(0, "laws", camera, "looks")
    tall_px, visible = looks.uniform(5.0, 120.0, OTHERS), looks.uniform(0.1, 1.0, OTHERS)
    result = []
    for f in range(FRAMES):
        boxes = [
            (
                Detection(
                    track_id=ids[o.object_id],
                    category=o.category,
                    box_px=(
                        float(x[i] + f * drift[i] - wide[i] / 2), 0.4 * height,
                        float(x[i] + f * drift[i] + wide[i] / 2), 0.6 * height,
                    ),
                    confidence=0.8,
                ),
                o.object_id,
            )
            for i, o in enumerate(traffic)
            if rng.random() < 0.95
        ]  # fmt: skip
        t_ns = f * PERIOD_NS
        shared = {"sensor": camera, "seq": f}
        result.append(
            Shot(
                detections=Detections(
                    **shared, stamp_ns=t_ns, arrival_ns=t_ns + 1, boxes=tuple(b for b, _ in boxes)
                ),
                image=None,
                truth=ImageTruth(
                    **shared,
                    capture_ns=t_ns,
                    T_world_camera=Transform.identity(),
                    boxes=tuple(
                        TrueBox(
                            object_id=o.object_id,
                            amodal_px=(0.0, 0.0, 10.0, 120.0),
                            visible_px=(0.0, 0.0, 10.0, float(tall_px[i])),
                            visible_fraction=float(visible[i]),
                        )
                        for i, o in enumerate(traffic)
                    ),
                    detection_object_id=tuple(i for _, i in boxes),
                ),
            )
        )
    return tuple(result)


@dataclass(frozen=True)
class Case:
    """A fault and what else the same injector could have done by mistake."""

    spec: FaultSpec
    mutants: tuple[FaultSpec, ...]


def entry(spec: FaultSpec) -> DeliveryFault:
    return next(fault for fault in DELIVERY_FAULTS if fault.spec is type(spec))


def act(spec: FaultSpec, delivery: Delivery, place: Site) -> Acted:
    return entry(spec).act(spec, delivery, place)


def receipts(spec: FaultSpec, before: Delivery, acted: Acted, place: Site) -> tuple[Receipt, ...]:
    step = Step(spec=spec, before=before, after=acted.delivery, realised=acted.realised)
    return entry(spec).receipts(spec, step, place)


def mismatches(found: tuple[Receipt, ...]) -> list[str]:
    return [r.quantity for r in found if r.status == MISMATCH]


def other(spec: FaultSpec, **fields: object) -> FaultSpec:
    """The same fault with other values, past what its rules allow."""
    return spec.model_copy(update=fields)


def scaled(spec: FaultSpec, *factors: float) -> tuple[FaultSpec, ...]:
    """The same fault times each factor."""
    return tuple(other(spec, **{spec.strength: by * getattr(spec, spec.strength)}) for by in factors)


def finite(found: tuple[Receipt, ...]) -> bool:
    return all(np.isfinite([r.requested, r.realised]).all() for r in found)
