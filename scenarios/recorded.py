"""Faults that can be injected into recorded data, and how `--faults` asks for them.

What was recorded has happened: nothing can shake a body or move a shutter any more. What the fusion is told,
and what it is given, can still be changed. Four faults are those of the simulator, one acts on recordings
only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

from pydantic import Field

from scenarios.errors import BadInput, Where
from scenarios.fault_set import NONE, OPTION, FaultChange, FaultSet, parse_fault_arguments
from scenarios.faults import FAULTS, CalibrationRotation, Cameras, EdgeError, FaultSpec, StaleFrames
from scenarios.faults.lidar import BeamLoss
from scenarios.validate import validate
from scenarios.yaml_source import parse_yaml

Pixels = Annotated[float, Field(ge=-2000, le=2000, allow_inf_nan=False)]


class PixelShift(FaultSpec):
    """The fusion is told an image centre that is off, as after a crop that was forgotten.

    Every projected point lies `right_px` too far right and `down_px` too far down; boxes stay.
    Unit: pixels. Source: judgement.
    """

    name: ClassVar[str] = "calibration.shift_px"
    strength: ClassVar[str] = "right_px"
    zero_when_off: ClassVar[tuple[str, ...]] = ("right_px", "down_px")
    unit: ClassVar[str] = "px"

    right_px: Pixels = 0.0
    down_px: Pixels = 0.0
    sensors: Cameras = "cameras"


ONLY_RECORDED: Mapping[str, type[FaultSpec]] = {spec.name: spec for spec in (PixelShift,)}
ON_RECORDINGS: Mapping[str, type[FaultSpec]] = {
    spec.name: spec for spec in (PixelShift, CalibrationRotation, EdgeError, BeamLoss, StaleFrames)
}
"""Every fault that acts on recorded data, by its name."""


def parse_recorded_faults(arguments: Sequence[str]) -> FaultSet:
    """The faults that the values of `--faults` ask for on recorded data, later ones winning.

    BadInput: unknown or malformed, or a fault that only a simulated drive can have.
    """
    change = FaultChange()
    for argument in arguments:
        name, equals, text = (part.strip() for part in argument.partition("="))
        if name in ONLY_RECORDED:
            change = change.then(_own(name, text if equals else "", argument.strip()))
        elif equals and name not in FAULTS:
            raise Where(file=OPTION).unknown("fault", name, ON_RECORDINGS)
        else:
            change = change.then(parse_fault_arguments([argument]))
    found = FaultSet().override(change)
    for spec in found:
        if spec.name not in ON_RECORDINGS:
            raise BadInput(
                f"{OPTION}: {spec.name} changes what happens; what was recorded has happened",
                allowed=", ".join([*ON_RECORDINGS, NONE]),
            )
    return found


def _own(name: str, text: str, argument: str) -> FaultChange:
    kind, where = ONLY_RECORDED[name], Where(file=OPTION)
    if not text:
        raise where.error("needs a value", (name,))
    value = parse_yaml(text, f"{OPTION} {name}").data
    data = dict(value) if isinstance(value, Mapping) else {kind.strength: value}
    return FaultChange(specs=(validate(kind, data, where.at(name)),), label=argument)
