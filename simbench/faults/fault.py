"""A fault that acts on what was measured: how it acts, and how its receipt is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from scenarios.faults import FaultSpec
from simbench.faults.delivery import Delivery
from simbench.faults.receipt import Receipt
from simbench.motion import Motion
from simbench.sensors.rig import SensorRig


@dataclass(frozen=True, kw_only=True, eq=False)
class Site:
    """Where a fault acts: the rig, the true motion, the length of the run, the run's seed."""

    rig: SensorRig
    motion: Motion
    duration_s: float
    seed: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Acted:
    """What a fault made of a delivery, and what this seed drew for it, by quantity."""

    delivery: Delivery
    realised: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """One fault in its turn: what was delivered before it and after it."""

    spec: FaultSpec
    before: Delivery
    after: Delivery
    realised: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class DeliveryFault:
    """One entry of the catalogue. `act` and `receipts` take specs of class `spec` only; a receipt looks at
    the data before and after, and shares no code with `act`."""

    spec: type[FaultSpec]
    act: Callable[[Any, Delivery, Site], Acted]
    receipts: Callable[[Any, Step, Site], tuple[Receipt, ...]]
