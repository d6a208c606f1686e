"""What the fusion is told of its sensors."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from scenarios.faults.spec import Cameras, FaultSpec, Sensors, Severity
from scenarios.scenario import broken

Pixels = Annotated[float, Field(ge=-2000, le=2000, allow_inf_nan=False)]


class CalibrationRotation(FaultSpec):
    """The fusion is told a sensor's pose that is turned by angle_deg: T_told = T_true * R(axis, angle).

    The world is unchanged. Axes are those of the viewing direction (roll about it, pitch, yaw), of the LiDAR
    its own x, y and z; random draws one axis per sensor, uniform over directions.
    Unit: degrees. Source: field reports of 0.1 to 3 degrees.
    """

    name: ClassVar[str] = "calibration.rotation_deg"
    strength: ClassVar[str] = "angle_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("angle_deg",)
    unit: ClassVar[str] = "deg"

    angle_deg: Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)] = 0.0
    axis: Literal["random", "roll", "pitch", "yaw"] = "random"
    sensors: Sensors = "cameras"


class CalibrationTranslation(FaultSpec):
    """The fusion is told a sensor's place that is off by shift_cm: t_told = t_true + 0.01 shift_cm * a.

    The world is unchanged. a is the ego's x (forward), y (left) or z (up); random draws one direction per
    sensor, uniform.
    Unit: centimetres. Source: judgement; a tape measure errs by 1 to 2 cm, a mount that was moved by 20.
    """

    name: ClassVar[str] = "calibration.translation_cm"
    strength: ClassVar[str] = "shift_cm"
    zero_when_off: ClassVar[tuple[str, ...]] = ("shift_cm",)
    unit: ClassVar[str] = "cm"

    shift_cm: Annotated[float, Field(ge=-1000, le=1000, allow_inf_nan=False)] = 0.0
    axis: Literal["random", "x", "y", "z"] = "random"
    sensors: Sensors = "cameras"


class Drift(FaultSpec):
    """The mount of a camera, or the LiDAR's, creeps away from where it was calibrated, evenly over the run.

    At time t of a run of length T the bracket is turned by angle_deg t / T about an axis of the ego, and
    shifted by shift_cm t / T along one. The fusion is told the pose at time 0 for good.
    Unit: degrees at the end of the run. Source: judgement; heat and loose screws, in minutes rather than
    seconds: short runs show the end of it.
    """

    name: ClassVar[str] = "calibration.drift_deg"
    strength: ClassVar[str] = "angle_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("angle_deg", "shift_cm")
    unit: ClassVar[str] = "deg"

    angle_deg: Annotated[float, Field(ge=-30, le=30, allow_inf_nan=False)] = 0.0
    axis: Literal["roll", "pitch", "yaw"] = "yaw"
    shift_cm: Annotated[float, Field(ge=-100, le=100, allow_inf_nan=False)] = 0.0
    along: Literal["x", "y", "z"] = "y"
    sensors: Sensors = "cameras"


class FocalLength(FaultSpec):
    """The fusion is told a focal length that is off: f_told = f_true * (1 + percent / 100), both axes.

    Every projected point lies farther from the image's centre by that much; boxes stay.
    Unit: per cent. Source: judgement; data sheets round focal lengths to 1 to 5 %, heat changes them by 0.1.
    """

    name: ClassVar[str] = "calibration.focal_percent"
    strength: ClassVar[str] = "percent"
    zero_when_off: ClassVar[tuple[str, ...]] = ("percent",)
    unit: ClassVar[str] = "%"

    percent: Annotated[float, Field(ge=-50, le=100, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


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


class Undistorted(FaultSpec):
    """The lens bends the picture, and the fusion is told that it is straight: the paper's assumption.

    The lens gets a radial distortion k1 = -corner_px / (f r^3), r the slope of the farthest corner, in place
    of what it had; pictures and boxes are as it shows them. Told is a lens without distortion, which puts a
    point in the corner corner_px too far out. Positive is a barrel, negative a pincushion.
    Unit: pixels at the corner. Source: judgement; 2 (a good narrow lens) to 40 (a wide one).
    """

    name: ClassVar[str] = "calibration.undistorted_px"
    strength: ClassVar[str] = "corner_px"
    zero_when_off: ClassVar[tuple[str, ...]] = ("corner_px",)
    unit: ClassVar[str] = "px"

    corner_px: Annotated[float, Field(ge=-500, le=500, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


Mixup = Literal["none", "transposed_rotation", "degrees_for_radians", "cameras_swapped", "inverse"]
"""What gets mixed up when a calibration is handed on; the first word is nothing."""


class CalibrationMixup(FaultSpec):
    """The calibration is handed on in another convention than it is read in.

    transposed_rotation: R_told = R^T, t as it was. degrees_for_radians: the rotation vector of R is written
    in degrees and read as radians (turns beyond whole ones fall away). cameras_swapped: two cameras exchange
    pose and intrinsics, the two that are named or the rig's first two. inverse: T_told = T^-1.
    Unit: which. Source: field reports.
    """

    name: ClassVar[str] = "calibration.mixup"
    strength: ClassVar[str] = "what"
    zero_when_off: ClassVar[tuple[str, ...]] = ()
    unit: ClassVar[str] = "which"

    what: Mixup = "none"
    sensors: Cameras = "cameras"

    @property
    def is_off(self) -> bool:
        """Nothing is mixed up."""
        return self.what == "none"

    @model_validator(mode="after")
    def _two_are_swapped(self) -> CalibrationMixup:
        if self.what == "cameras_swapped" and len(self.named_cameras) not in (0, 2):
            raise broken("swaps two cameras; name both, or leave it out to mean the first two", "sensors")
        return self


class ClickNoise(FaultSpec):
    """Each camera is told the pose that a calibration with noisy clicks finds.

    In `boards` poses of the checkerboard, near_m to far_m from the camera and within the inner 60 % of its
    picture, each corner of the panel is clicked at its true pixel + noise_px * n (n standard normal, each
    axis); PnP and fine tuning as in fusion.calibrate, with the lens that is told, give T_told. LiDAR points
    are exact. For a lens that is told wrongly the pose makes up inside this volume, and nowhere else.
    Unit: pixels (1 SD per axis). Source: judgement; 0.5 px by an algorithm, 1 to 5 by hand.
    """

    name: ClassVar[str] = "calibration.click_noise_px"
    strength: ClassVar[str] = "noise_px"
    zero_when_off: ClassVar[tuple[str, ...]] = ("noise_px",)
    unit: ClassVar[str] = "px"

    noise_px: Annotated[float, Field(ge=0, le=50, allow_inf_nan=False)] = 0.0
    near_m: Annotated[float, Field(ge=1, le=15, allow_inf_nan=False)] = 3.0
    far_m: Annotated[float, Field(ge=1, le=15, allow_inf_nan=False)] = 6.0
    boards: Annotated[int, Field(ge=4, le=100)] = 15
    sensors: Cameras = "cameras"

    @model_validator(mode="after")
    def _near_is_nearer(self) -> ClickNoise:
        if not self.near_m < self.far_m:
            raise broken("must be farther than near_m", "far_m")
        return self


SPECS: tuple[type[FaultSpec], ...] = (
    CalibrationMixup,
    CalibrationRotation,
    CalibrationTranslation,
    ClickNoise,
    Drift,
    FocalLength,
    PixelShift,
    Undistorted,
)
SEVERITIES: tuple[Severity, ...] = (
    Severity(
        fault=CalibrationRotation.name,
        values=(0.1, 0.25, 0.5, 1.0, 2.0),
        source="field reports of 0.1 to 3 degrees",
    ),
    Severity(
        fault=CalibrationTranslation.name,
        values=(1.0, 2.0, 5.0, 10.0, 20.0),
        source="judgement: from a tape measure's error to a mount that was moved",
    ),
    Severity(
        fault=ClickNoise.name,
        values=(0.5, 1.0, 2.0, 3.0, 5.0),
        source="judgement: from corners found by an algorithm to hurried clicks",
    ),
    Severity(
        fault=Drift.name,
        values=(0.1, 0.25, 0.5, 1.0, 2.0),
        source="as a rotation that was told wrongly",
    ),
    Severity(
        fault=FocalLength.name,
        values=(0.2, 0.5, 1.0, 2.0, 5.0),
        source="judgement: from heat to the data sheet's rounded number",
    ),
    Severity(fault=PixelShift.name, values=(1.0, 2.0, 5.0, 10.0, 20.0), source="judgement"),
    Severity(
        fault=Undistorted.name,
        values=(2.0, 5.0, 10.0, 20.0, 40.0),
        source="judgement: from a good narrow lens to a wide one",
    ),
)
