"""Fault specs: what may go wrong, in physical units, each acting at one place of the flow.

A spec says how much; the bench holds the injector and the receipt of each. A spec of zero strength is off,
and a fault that is off is the same as one that was never mentioned. Random parts (jitter, phases, axes) are
drawn by the bench from the run's seed. Marks of the sources: data sheet, computed (in a trial), judgement.

One file a family, named as the first word of its faults' names.
"""

from __future__ import annotations

from scenarios.faults import calibration, camera, detector, lidar, motion, reference, timing
from scenarios.faults.calibration import (
    CalibrationMixup,
    CalibrationRotation,
    CalibrationTranslation,
    ClickNoise,
    Drift,
    FocalLength,
    PixelShift,
    Undistorted,
)
from scenarios.faults.camera import MotionBlur
from scenarios.faults.detector import EdgeError
from scenarios.faults.motion import (
    Flex,
    Knock,
    Mode,
    RoadEvent,
    RoadShake,
    Roughness,
    Spectrum,
    Trace,
    Vibration,
)
from scenarios.faults.spec import Cameras, FaultSpec, Sensors
from scenarios.faults.timing import (
    ClockDrift,
    ClockOffset,
    Dropped,
    Duplicated,
    Frozen,
    Latency,
    Reordered,
    StaleFrames,
    StampJitter,
    StampMeaning,
    StampOnSave,
    StampQuantum,
    StampStep,
    TriggerAngle,
    TriggerOffset,
)

__all__ = [
    "FAMILIES",
    "FAULTS",
    "CalibrationMixup",
    "CalibrationRotation",
    "CalibrationTranslation",
    "Cameras",
    "ClickNoise",
    "ClockDrift",
    "ClockOffset",
    "Drift",
    "Dropped",
    "Duplicated",
    "EdgeError",
    "FaultSpec",
    "Flex",
    "FocalLength",
    "Frozen",
    "Knock",
    "Latency",
    "Mode",
    "MotionBlur",
    "PixelShift",
    "Reordered",
    "RoadEvent",
    "RoadShake",
    "Roughness",
    "Sensors",
    "Spectrum",
    "StaleFrames",
    "StampJitter",
    "StampMeaning",
    "StampOnSave",
    "StampQuantum",
    "StampStep",
    "Trace",
    "TriggerAngle",
    "TriggerOffset",
    "Undistorted",
    "Vibration",
]

FAMILIES = (calibration, camera, detector, lidar, motion, reference, timing)
"""One module a family: its SPECS and their SEVERITIES."""

FAULTS: dict[str, type[FaultSpec]] = {
    spec.name: spec for spec in sorted((s for f in FAMILIES for s in f.SPECS), key=lambda spec: spec.name)
}
"""Every fault by its name, sorted."""
