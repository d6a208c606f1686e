"""A fault of what the fusion is told: how it changes a calibration, and how its receipt is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fusion.messages import Calibration
from scenarios.faults import FaultSpec
from simbench.faults.estimate import BodyAttitude, PoseEvidence
from simbench.faults.receipt import Receipt


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """Where a calibration is told: the true one, the name of its LiDAR, the run's seed."""

    true: Calibration
    lidar_name: str
    seed: int

    @property
    def cameras(self) -> tuple[str, ...]:
        return tuple(self.true.cameras)


@dataclass(frozen=True, kw_only=True, eq=False)
class Told:
    """What a fault made of a calibration, and what this seed drew for it, by quantity."""

    calibration: Calibration
    realised: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Telling:
    """One fault (by its name) in its turn: what was told before it and after it."""

    fault: str
    before: Calibration
    after: Calibration
    realised: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Witness:
    """What receipts measure with: each camera's poses by PnP over the run, the body's attitude by the gyro
    (None where there is none)."""

    place: Place
    evidence: Sequence[PoseEvidence]
    body: BodyAttitude | None


@dataclass(frozen=True, kw_only=True)
class CalibrationFault:
    """One entry of the catalogue. `tell` and `receipts` take specs of class `spec` only; a receipt looks at
    the calibration before and after, and shares no code with `tell`."""

    spec: type[FaultSpec]
    tell: Callable[[Any, Calibration, Place], Told]
    receipts: Callable[[Any, Telling, Witness], tuple[Receipt, ...]]
