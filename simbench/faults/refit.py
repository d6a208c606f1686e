"""Faults that change what a sensor is, before anything is built or measured: another exposure, another lens.

`refit` is called where a rig meets its faults (`stage.py`; `timeline.py` for a run that is only drawn). The
rig before and after each of them is kept, for its receipt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from scenarios.fault_set import FaultSet
from scenarios.faults import FaultSpec, MotionBlur, TriggerAngle, Undistorted
from simbench.capture import Captured
from simbench.faults import exposure, trigger_angle, undistorted
from simbench.faults.receipt import Receipt
from simbench.sensors.rig import SensorRig


@dataclass(frozen=True, kw_only=True, eq=False)
class Refit:
    """One fault in its turn: the rig before it and after it."""

    spec: FaultSpec
    before: SensorRig
    after: SensorRig


@dataclass(frozen=True, kw_only=True)
class RigFault:
    """One entry of the catalogue. `change` and `receipts` take specs of class `spec` only. `change` raises
    BadInput for what no such sensor can be; `receipts` gets the rig before and after, and what was captured.
    """

    spec: type[FaultSpec]
    change: Callable[[Any, SensorRig], SensorRig]
    receipts: Callable[[Any, SensorRig, SensorRig, Captured], tuple[Receipt, ...]]


RIG_FAULTS: tuple[RigFault, ...] = (
    RigFault(spec=MotionBlur, change=exposure.expose_longer, receipts=exposure.receipts),
    RigFault(spec=TriggerAngle, change=trigger_angle.fire_elsewhere, receipts=trigger_angle.receipts),
    RigFault(spec=Undistorted, change=undistorted.bend, receipts=lambda *_: ()),  # the telling's says it all
)
"""In the order in which they act."""


def refit(rig: SensorRig, faults: FaultSet) -> tuple[SensorRig, tuple[Refit, ...]]:
    """The rig that measures, and every step to it. Raises BadInput."""
    steps: list[Refit] = []
    for fault in RIG_FAULTS:
        spec = faults.get(fault.spec)
        if spec is None:
            continue
        after = fault.change(spec, rig)
        steps.append(Refit(spec=spec, before=rig, after=after))
        rig = after
    return rig, tuple(steps)


def refit_receipts(
    faults: FaultSet, refits: Sequence[Refit], rig: SensorRig, captured: Captured
) -> tuple[Receipt, ...]:
    """Requested, realised and measured of every such fault that is on. One without a step changed nothing:
    the rig before and after it is the one that measured.
    """
    made = {step.spec.name: step for step in refits}
    result: list[Receipt] = []
    for fault in RIG_FAULTS:
        spec = faults.get(fault.spec)
        if spec is None:
            continue
        step = made.get(spec.name, Refit(spec=spec, before=rig, after=rig))
        result += fault.receipts(spec, step.before, step.after, captured)
    return tuple(result)
