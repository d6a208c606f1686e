"""Proof of effect: what the data itself says about every fault, against what was asked for and drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from scenarios.fault_set import FaultSet
from scenarios.faults import Drift, EdgeError, FaultSpec, Flex, Knock, TriggerOffset
from simbench.capture import Captured
from simbench.faults import detector as detector_fault
from simbench.faults import motion as motion_fault
from simbench.faults import timing as timing_fault
from simbench.faults.body import shaking
from simbench.faults.deliver import DELIVERY_FAULTS
from simbench.faults.draw import Drawn, place_of
from simbench.faults.estimate import PoseEvidence
from simbench.faults.evidence import body_of, cameras_of, lidar_of
from simbench.faults.mounts import drift_receipts, knock_receipts, settled
from simbench.faults.receipt import Receipt, judge
from simbench.faults.refit import Refit, refit_receipts
from simbench.faults.struck import struck
from simbench.faults.tell import told_receipts
from simbench.faults.telling import Witness
from simbench.mount import BracketMotion
from simbench.sensors.rig import SensorRig


def receipts(
    captured: Captured, rig: SensorRig, faults: FaultSet, duration_s: float, refits: Sequence[Refit] = ()
) -> tuple[Receipt, ...]:
    """Requested, realised and measured of every fault that is on. `rig` is the one that measured."""
    if not faults:
        return ()
    drawn, measured = captured.drawn, captured.measured
    cameras, body = cameras_of(captured, rig), body_of(captured, rig)
    evidence = tuple(_settled(item, drawn) for item in cameras)
    seen = (*cameras, lidar_of(captured, rig)) if _lidar_moves(captured, rig, faults) else cameras
    result: list[Receipt] = []
    if (offset := faults.get(TriggerOffset)) is not None:
        result += timing_fault.receipts(offset, struck(offset, rig), drawn.delays_ns, evidence, body)
    if (shaken := shaking(faults)) is not None:
        fault, spec = shaken
        result += fault.receipts(spec, drawn.body_shake, duration_s, body, evidence)
    if (bend := faults.get(Flex)) is not None:
        bent = tuple(_settled(item, drawn) for item in seen)
        result += motion_fault.flex_receipts(bend, struck(bend, rig), drawn.flex, duration_s, bent, body)
    if (knock := faults.get(Knock)) is not None:
        rest = _rest(drawn.flex, drawn.drifts)
        result += knock_receipts(
            knock, struck(knock, rig), drawn.knocks, seen, drawn.body_shake, rest, duration_s
        )
    if (drift := faults.get(Drift)) is not None:
        rest = _rest(drawn.flex, drawn.knocks)
        result += drift_receipts(
            drift, struck(drift, rig), drawn.drifts, seen, drawn.body_shake, rest, duration_s
        )
    result += refit_receipts(faults, refits, rig, captured)
    witness = Witness(place=place_of(rig, captured.site.seed), evidence=evidence, body=body)
    result += told_receipts(faults, drawn.tellings, captured.recording.calibration, witness)
    if (edge_error := faults.get(EdgeError)) is not None:
        sizes = {name: (c.width_px, c.height_px) for name, c in rig.pinholes.items()}
        period_s = {1.0 / camera.rate_hz for camera in rig.cameras.values()}
        shots = [shot for name in rig.cameras for shot in measured.shots[name]]
        detections, images = [shot.detections for shot in shots], [shot.truth for shot in shots]
        result += detector_fault.receipts(
            edge_error, drawn.edge_errors, detections, images, sizes, max(period_s, default=1.0)
        )
    entries = {fault.spec: fault for fault in DELIVERY_FAULTS}
    for step in captured.steps:
        result += entries[type(step.spec)].receipts(step.spec, step, captured.site)
    proved = {receipt.fault for receipt in result}
    result += [_nothing_measured(spec) for spec in faults if spec.name not in proved]
    return tuple(result)


def _nothing_measured(spec: FaultSpec) -> Receipt:
    """A fault that no receipt speaks of never acted."""
    return judge(
        fault=spec.name, quantity="effect", unit="share", requested=1.0, realised=0.0, measured=None,
        estimator_sd=0.0, allowed=0.0, note="no step of this fault was taken: nothing to measure",
    )  # fmt: skip


def _lidar_moves(captured: Captured, rig: SensorRig, faults: FaultSet) -> bool:
    """Whether a bracket fault names the LiDAR, or something moves its bracket that should not."""
    brackets = [spec for kind in (Flex, Knock, Drift) if (spec := faults.get(kind)) is not None]
    asked = any(rig.lidar_name in struck(spec, rig) for spec in brackets)
    return asked or (bool(brackets) and rig.lidar_name in captured.motion.flex)


def _settled(item: PoseEvidence, drawn: Drawn) -> PoseEvidence:
    """A sensor's evidence less the knock and the drift of its bracket, which have receipts of their own."""
    found = [motions[item.sensor] for motions in (drawn.knocks, drawn.drifts) if item.sensor in motions]
    if not found:
        return item
    turn_rad, shift_m = settled(item, found)
    return replace(item, turn_rad=turn_rad, shift_m=shift_m)


def _rest(*drawn: Mapping[str, BracketMotion]) -> dict[str, list[BracketMotion]]:
    """Several motions of each bracket, side by side."""
    rest: dict[str, list[BracketMotion]] = {}
    for motions in drawn:
        for name, motion in motions.items():
            rest.setdefault(name, []).append(motion)
    return rest
