"""Fault specs: what may go wrong, in physical units, each acting at one place of the flow.

A spec says how much; the bench holds the injector and the receipt of each. A spec of zero strength is off,
and a fault that is off is the same as one that was never mentioned. Random parts (jitter, phases, axes) are
drawn by the bench from the run's seed. Marks of the sources: data sheet, computed (in a trial), judgement.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, get_args, get_origin

from pydantic import Field, model_validator

from scenarios.scenario import Finite, Name, Spec, broken

Cameras = Literal["cameras"] | tuple[Name, ...]
"""All cameras of the rig, or some by their names."""


class FaultSpec(Spec):
    """Base of all faults. `name` is how a file calls it, `strength` the field that a bare number sets.

    A spec is off when every field in `zero_when_off` is 0.
    """

    name: ClassVar[str]
    strength: ClassVar[str]
    zero_when_off: ClassVar[tuple[str, ...]]
    unit: ClassVar[str]

    @classmethod
    def strength_words(cls) -> tuple[str, ...]:
        """The words that the strength may be, weakest first; none where it is a number."""
        annotation = cls.model_fields[cls.strength].annotation
        return tuple(get_args(annotation)) if get_origin(annotation) is Literal else ()

    @property
    def is_off(self) -> bool:
        """Whether this spec does nothing."""
        return all(getattr(self, field) == 0.0 for field in self.zero_when_off)

    @property
    def named_cameras(self) -> tuple[str, ...]:
        """The cameras that this spec names one by one; empty when it means all of them."""
        sensors = getattr(self, "sensors", "cameras")
        return () if sensors == "cameras" else tuple(sensors)

    @model_validator(mode="after")
    def _names_cameras_once(self) -> FaultSpec:
        named = self.named_cameras
        if getattr(self, "sensors", "cameras") == ():
            raise broken("names no camera; leave it out to mean all", "sensors")
        if len(set(named)) < len(named):
            raise broken("names a camera twice", "sensors")
        return self


class TriggerOffset(FaultSpec):
    """Cameras expose later than their stamp says: the paper's error, which fusion cannot know.

    Exposure i of each camera is taken at t_i + offset_ms + jitter_ms * n_i with n_i standard normal; the
    stamp stays that of the nominal t_i, the message arrives as much later as it is taken. A negative offset
    exposes earlier.
    Unit: milliseconds. Source: field reports of 2 to 150 ms; a hidden offset of half an exposure is 0.5-5 ms
    (data sheet); host stamps jitter by 5-15 ms (judgement).
    """

    name: ClassVar[str] = "timing.trigger_offset_ms"
    strength: ClassVar[str] = "offset_ms"
    zero_when_off: ClassVar[tuple[str, ...]] = ("offset_ms", "jitter_ms")
    unit: ClassVar[str] = "ms"

    offset_ms: Annotated[float, Field(ge=-1000, le=1000, allow_inf_nan=False)] = 0.0
    jitter_ms: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = 0.0
    sensors: Cameras = "cameras"


class Vibration(FaultSpec):
    """The ego's body shakes, and all sensors with it (common mode).

    Pitch, roll and yaw are band-limited noise with RMS rms_deg, roll_ratio * rms_deg and yaw_ratio * rms_deg;
    heave has RMS heave_m_per_deg * rms_deg. Each run is rescaled to the requested RMS. The spectrum is that
    of `profile`; auto: by the rig's body. car: heave and pitch modes near 1.3 Hz, roll 1.5 Hz, wheel hop near
    11 Hz, band noise 0.5-20 Hz. rider: sway at 0.3-1.5 Hz and 4-20 Hz from the wheels.
    Unit: degrees RMS of pitch. Source: level by road class and band computed; sway, ratios, heave judgement.
    """

    name: ClassVar[str] = "motion.vibration_deg"
    strength: ClassVar[str] = "rms_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("rms_deg",)
    unit: ClassVar[str] = "deg RMS"

    rms_deg: Annotated[float, Field(ge=0, le=30, allow_inf_nan=False)] = 0.0
    roll_ratio: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.8
    yaw_ratio: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.25
    heave_m_per_deg: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.02
    profile: Literal["auto", "car", "rider"] = "auto"


Roughness = Literal["smooth", "A", "B", "C", "D", "E"]
"""Classes of ISO 8608, and a road without any roughness."""


class RoadEvent(Spec):
    """One thing on the road, from `at_m` along the ego's path to `length_m` farther on.

    0 lies where the vehicle's origin is at t = 0. `height_m`: of a bump, kerb or seam; depth of a pothole or
    joint. A single-track vehicle meets the events of either track.
    """

    kind: Literal["bump", "kerb", "pothole", "joint", "seam"]
    at_m: Finite
    height_m: Annotated[float, Field(gt=0, le=0.3, allow_inf_nan=False)]
    length_m: Annotated[float, Field(ge=0.01, le=50, allow_inf_nan=False)]
    track: Literal["left", "right", "both"] = "both"


class RoadShake(FaultSpec):
    """The ego drives over a rough road: what its body does is integrated, not scripted.

    The car on its suspension, or the e-scooter with its rider, drives along the scripted path over an
    ISO 8608 road of class `roughness`, drawn from the run's seed, and over `events`. The body's roll, pitch
    and heave carry all sensors. Stands instead of motion.vibration_deg, never beside it.
    Unit: ISO 8608 class. Source: classes by the standard; vehicle and rider judgement within what is usual.
    """

    name: ClassVar[str] = "motion.road"
    strength: ClassVar[str] = "roughness"
    zero_when_off: ClassVar[tuple[str, ...]] = ()
    unit: ClassVar[str] = "ISO 8608 class"

    roughness: Roughness = "smooth"
    events: tuple[RoadEvent, ...] = Field(default=(), max_length=100)

    @property
    def is_off(self) -> bool:
        """A smooth road without events shakes nothing."""
        return self.roughness == "smooth" and not self.events


class Flex(FaultSpec):
    """Each camera's bracket bends against the body, independently of the others.

    Rotation about each of the three axes is band noise of RMS rms_deg; the first mode lies at 20-60 Hz
    (stiff) or 8-20 Hz (soft). The calibration still tells the pose at rest.
    Unit: degrees RMS per axis. Source: judgement.
    """

    name: ClassVar[str] = "motion.flex_deg"
    strength: ClassVar[str] = "rms_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("rms_deg",)
    unit: ClassVar[str] = "deg RMS"

    rms_deg: Annotated[float, Field(ge=0, le=30, allow_inf_nan=False)] = 0.0
    stiffness: Literal["stiff", "soft"] = "stiff"
    sensors: Cameras = "cameras"


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


class EdgeError(FaultSpec):
    """The detector's box edges are off, and stay off for a while.

    Each edge moves outward by side * (bias_fraction + a_t), side being the box's width or height.
    a_t is AR(1) noise of SD sd_fraction with time constant tau_s: a_t = r a_(t-dt) + sqrt(1 - r^2) sd n_t,
    r = exp(-dt / tau_s); tau_s 0 is white noise.
    Unit: share of the box's side. Source: judgement (SD 3 %, 0.3 s): white jitter alone flatters smoothers.
    """

    name: ClassVar[str] = "detector.edge_error"
    strength: ClassVar[str] = "sd_fraction"
    zero_when_off: ClassVar[tuple[str, ...]] = ("sd_fraction", "bias_fraction")
    unit: ClassVar[str] = "fraction of the side"

    sd_fraction: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.03
    tau_s: Annotated[float, Field(ge=0, le=60, allow_inf_nan=False)] = 0.3
    bias_fraction: Annotated[float, Field(ge=-0.5, le=1, allow_inf_nan=False)] = 0.0


FAULTS: dict[str, type[FaultSpec]] = {
    spec.name: spec for spec in (CalibrationRotation, EdgeError, Flex, RoadShake, Vibration, TriggerOffset)
}
"""Every fault by its name, sorted."""
