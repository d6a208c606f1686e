"""What each fault is drawn to be in this run: the *realised* side of its receipt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.messages import Calibration
from scenarios.fault_set import FaultSet
from scenarios.faults import Drift, EdgeError, Flex, Knock, TriggerOffset, Vibration
from scenarios.scenario import System
from scenarios.severity import Profile
from simbench.faults import detector as detector_fault
from simbench.faults import motion as motion_fault
from simbench.faults import timing as timing_fault
from simbench.faults.body import Carriage, shaking, words
from simbench.faults.mounts import drifting, knocked
from simbench.faults.struck import struck
from simbench.faults.tell import tell
from simbench.faults.telling import Place, Telling
from simbench.mount import BracketMotion, Ramp, Together
from simbench.sensors.clock import CameraTiming
from simbench.sensors.rig import SensorRig
from simbench.shake import BodyShake, Shake
from simbench.world import World


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """What this seed drew for each fault: the *realised* side of the receipts. `told`: what the fusion is
    told in the end; `tellings`: what each fault made of it, one by one.
    """

    profile: Profile
    body_shake: BodyShake | None
    flex: Mapping[str, Shake]
    knocks: Mapping[str, Ramp]
    drifts: Mapping[str, Ramp]
    delays_ns: Mapping[str, Int64[np.ndarray, " f"]]
    edge_errors: Mapping[str, Mapping[int, Float64[np.ndarray, "f 4"]]]
    told: Calibration
    tellings: tuple[Telling, ...]

    @property
    def brackets(self) -> Mapping[str, BracketMotion]:
        """All that moves each camera's bracket."""
        found: dict[str, list[BracketMotion]] = {}
        for drawn in (self.flex, self.knocks, self.drifts):
            for name, motion in drawn.items():
                found.setdefault(name, []).append(motion)
        return {
            n: parts[0] if len(parts) == 1 else Together(parts=tuple(parts)) for n, parts in found.items()
        }


def place_of(rig: SensorRig, seed: int) -> Place:
    """Where the calibration of a rig is told."""
    return Place(true=rig.calibration, lidar_name=rig.lidar_name, seed=seed)


def draw(
    rig: SensorRig,
    world: World,
    faults: FaultSet,
    timing: Mapping[str, CameraTiming],
    system: System,
    seed: int,
) -> Drawn:
    """Draw every fault from its own stream; none moves another's numbers."""
    duration_s = system.duration_s
    vibration, shaken = faults.get(Vibration), shaking(faults)
    knock, drift = faults.get(Knock), faults.get(Drift)
    offset, bend, edge_error = faults.get(TriggerOffset), faults.get(Flex), faults.get(EdgeError)
    profile: Profile = "car" if rig.rig.body == "vehicle" else "rider"
    if vibration is not None and vibration.profile != "auto":
        profile = vibration.profile
    told, tellings = tell(faults, place_of(rig, seed))
    delays, flex, edges = {}, {}, {}
    if offset is not None:
        for name in struck(offset, rig):
            delays[name] = timing_fault.delays_ns(offset, name, len(timing[name].mid_ns), seed)
    if bend is not None:
        for name in struck(bend, rig):
            flex[name] = motion_fault.bracket_shake(bend, name, duration_s, seed)
    if edge_error is not None:
        for name, camera in rig.cameras.items():
            frames, period_s = len(timing[name].mid_ns), 1.0 / camera.rate_hz
            edges[name] = detector_fault.edge_errors(edge_error, name, world.objects, frames, period_s, seed)
    body_shake: BodyShake | None = None
    if shaken is not None:
        fault, spec = shaken
        carriage = Carriage(
            profile=profile,
            track=next(actor.track for actor in world.actors if actor.name == system.ego),
            origin_m=rig.rig.ego_origin_m,
            exposures_ns=[timing[name].mid_ns + delays.get(name, 0) for name in timing],
            duration_s=duration_s,
            seed=seed,
        )
        body_shake = fault.shake(spec, carriage)
    return Drawn(
        profile=profile,
        body_shake=body_shake,
        flex=flex,
        knocks={} if knock is None else dict.fromkeys(struck(knock, rig), knocked(knock)),
        drifts={} if drift is None else dict.fromkeys(struck(drift, rig), drifting(drift, duration_s)),
        delays_ns=delays,
        edge_errors=edges,
        told=told,
        tellings=tellings,
    )


def shake_words(drawn: Drawn, faults: FaultSet, duration_s: float) -> str:
    """What the body's shake is, in words; empty when it does not shake."""
    shaken = shaking(faults)
    return words(drawn.body_shake, drawn.profile, None if shaken is None else shaken[1], duration_s)
