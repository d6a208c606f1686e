"""Faults of what the fusion is told, one after the other: first what a calibration finds wrongly, then what
happens to it afterwards, last how it is handed on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fusion.messages import Calibration
from scenarios.fault_set import FaultSet
from scenarios.faults import FaultSpec
from simbench.faults import calibration, clicks, displaced, intrinsics, mixup, undistorted
from simbench.faults.receipt import Receipt
from simbench.faults.telling import CalibrationFault, Place, Telling, Witness

CALIBRATION_FAULTS: tuple[CalibrationFault, ...] = (
    *undistorted.TOLD,
    *clicks.TOLD,
    *calibration.TOLD,
    *displaced.TOLD,
    *intrinsics.TOLD,
    *mixup.TOLD,
)
"""In the order in which they act."""


def asks_to_tell(faults: FaultSet) -> bool:
    """Whether any of them changes what the fusion is told."""
    return any(faults.get(fault.spec) is not None for fault in CALIBRATION_FAULTS)


def tell(faults: FaultSet, place: Place) -> tuple[Calibration, tuple[Telling, ...]]:
    """What the fusion is told, and every step on the way from the truth."""
    tellings: list[Telling] = []
    now = place.true
    for fault in CALIBRATION_FAULTS:
        spec = faults.get(fault.spec)
        if spec is None:
            continue
        told = fault.tell(spec, now, place)
        tellings.append(Telling(fault=spec.name, before=now, after=told.calibration, realised=told.realised))
        now = told.calibration
    return now, tuple(tellings)


def told_receipts(
    faults: FaultSet, tellings: Sequence[Telling], handed_out: Calibration, witness: Witness
) -> tuple[Receipt, ...]:
    """Requested, realised and measured of every fault that is on. The last step ends in what was handed out
    to the fusion, whatever the steps say; a fault without a step drew nothing.
    """
    made = {telling.fault: telling for telling in tellings}
    now, steps = witness.place.true, list[tuple[CalibrationFault, FaultSpec, Telling]]()
    for fault in CALIBRATION_FAULTS:
        spec = faults.get(fault.spec)
        if spec is None:
            continue
        nothing = Telling(fault=spec.name, before=now, after=now, realised={})
        step = replace(made.get(spec.name, nothing), before=now)
        steps.append((fault, spec, step))
        now = step.after
    result: list[Receipt] = []
    for i, (fault, spec, step) in enumerate(steps):
        last = i == len(steps) - 1
        result += fault.receipts(spec, replace(step, after=handed_out) if last else step, witness)
    return tuple(result)
