"""What the fusion is told of its sensors."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from scenarios.faults.spec import Cameras, FaultSpec, Severity


class CalibrationRotation(FaultSpec):
    """The fusion is told a camera pose that is turned by angle_deg: T_told = T_true * R(axis, angle).

    The world is unchanged. Axes are those of the viewing direction (roll about it, pitch, yaw); random draws
    one axis per camera, uniform over directions.
    Unit: degrees. Source: field reports of 0.1 to 3 degrees.
    """

    name: ClassVar[str] = "calibration.rotation_deg"
    strength: ClassVar[str] = "angle_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("angle_deg",)
    unit: ClassVar[str] = "deg"

    angle_deg: Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)] = 0.0
    axis: Literal["random", "roll", "pitch", "yaw"] = "random"
    sensors: Cameras = "cameras"


SPECS: tuple[type[FaultSpec], ...] = (CalibrationRotation,)
SEVERITIES: tuple[Severity, ...] = (
    Severity(
        fault=CalibrationRotation.name,
        values=(0.1, 0.25, 0.5, 1.0, 2.0),
        source="field reports of 0.1 to 3 degrees",
    ),
)
