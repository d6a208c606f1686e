"""Faults that can be injected into recorded data, and how `--faults` asks for them.

What was recorded has happened: nothing can shake a body or move a shutter any more. What the fusion is told,
and what it is given, can still be changed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scenarios.errors import BadInput, Where
from scenarios.fault_set import NONE, OPTION, FaultSet, parse_fault_arguments
from scenarios.faults import (
    FAULTS,
    CalibrationMixup,
    CalibrationRotation,
    CalibrationTranslation,
    ClickNoise,
    EdgeError,
    FaultSpec,
    FocalLength,
    PixelShift,
    StaleFrames,
)
from scenarios.faults.lidar import BeamLoss

ON_RECORDINGS: Mapping[str, type[FaultSpec]] = {
    spec.name: spec
    for spec in (
        PixelShift,
        FocalLength,
        CalibrationRotation,
        CalibrationTranslation,
        ClickNoise,
        CalibrationMixup,
        EdgeError,
        BeamLoss,
        StaleFrames,
    )
}
"""Every fault that acts on recorded data, by its name."""


def parse_recorded_faults(arguments: Sequence[str]) -> FaultSet:
    """The faults that the values of `--faults` ask for on recorded data, later ones winning.

    BadInput: unknown or malformed, or a fault that only a simulated drive can have.
    """
    for argument in arguments:
        name, equals, _ = (part.strip() for part in argument.partition("="))
        if equals and name not in FAULTS:
            raise Where(file=OPTION).unknown("fault", name, ON_RECORDINGS)
    change = parse_fault_arguments(arguments)
    found = FaultSet().override(change)
    for spec in found:
        if spec.name not in ON_RECORDINGS:
            raise BadInput(
                f"{OPTION}: {spec.name} does not act on recorded data",
                allowed=", ".join([*ON_RECORDINGS, NONE]),
            )
    return found
