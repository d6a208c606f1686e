"""How the body that carries the sensors moves, and their brackets against it."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from scenarios.faults.spec import FaultSpec, Sensors, Severity
from scenarios.scenario import Finite, Spec, broken


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
    """The bracket of each camera, or the LiDAR's, bends against the body, independently of the others.

    Rotation about each of the three axes is band noise of RMS rms_deg; the first mode lies at 20-60 Hz
    (stiff) or 8-20 Hz (soft). The calibration still tells the pose at rest; every beam of a LiDAR that bends
    is cast from where it is as it fires.
    Unit: degrees RMS per axis. Source: judgement.
    """

    name: ClassVar[str] = "motion.flex_deg"
    strength: ClassVar[str] = "rms_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("rms_deg",)
    unit: ClassVar[str] = "deg RMS"

    rms_deg: Annotated[float, Field(ge=0, le=30, allow_inf_nan=False)] = 0.0
    stiffness: Literal["stiff", "soft"] = "stiff"
    sensors: Sensors = "cameras"


Axis = Literal["roll", "pitch", "yaw"]


class Mode(FaultSpec):
    """The ego's body swings in a single mode, and all sensors with it.

    damping 0: angle = sqrt(2) rms_deg sin(2 pi frequency_hz t + phase). Above 0: band noise that this mode
    makes of white noise, density |H|^2 = 1 / ((1 - u^2)^2 + (2 damping u)^2), u = f / frequency_hz. Phases
    are drawn; each run is rescaled to the requested RMS about its straight line.
    Unit: degrees RMS. Source: judgement; pitch of a car 1-1.5 Hz, a mast 5-20 Hz.
    """

    name: ClassVar[str] = "motion.mode_deg"
    strength: ClassVar[str] = "rms_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("rms_deg",)
    unit: ClassVar[str] = "deg RMS"

    rms_deg: Annotated[float, Field(ge=0, le=30, allow_inf_nan=False)] = 0.0
    axis: Axis = "pitch"
    frequency_hz: Annotated[float, Field(ge=0.2, le=100, allow_inf_nan=False)] = 1.3
    damping: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.0


Density = tuple[
    tuple[
        Annotated[float, Field(ge=0.05, le=200, allow_inf_nan=False)],
        Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)],
    ],
    ...,
]
"""(frequency in Hz, one-sided power density), ascending; straight lines between, nothing beyond."""


class Spectrum(FaultSpec):
    """The ego's body shakes with spectra that you give, axis by axis.

    Angles have densities in deg^2/Hz, heave in m^2/Hz. RMS = scale * sqrt(integral of the density); phases
    are drawn, and each run is rescaled to that RMS about its straight line.
    Unit: times the spectra. Source: yours, of a vehicle that was measured.
    """

    name: ClassVar[str] = "motion.spectrum"
    strength: ClassVar[str] = "scale"
    zero_when_off: ClassVar[tuple[str, ...]] = ("scale",)
    unit: ClassVar[str] = "times"

    scale: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)] = 0.0
    roll_deg2_per_hz: Density = ()
    pitch_deg2_per_hz: Density = ((0.5, 0.0), (1.3, 0.01), (3.0, 0.0))
    yaw_deg2_per_hz: Density = ()
    heave_m2_per_hz: Density = ()

    @model_validator(mode="after")
    def _frequencies_ascend(self) -> Spectrum:
        for axis in SPECTRA:
            points = getattr(self, axis)
            if len(points) == 1:
                raise broken("needs two points at least, or none", axis)
            for i in range(1, len(points)):
                if points[i][0] <= points[i - 1][0]:
                    raise broken("is not above the frequency before", axis, i, 0)
        if not any(density > 0.0 for axis in SPECTRA for _, density in getattr(self, axis)):
            raise broken("has no density above 0 on any axis", "scale")
        return self


SPECTRA = ("roll_deg2_per_hz", "pitch_deg2_per_hz", "yaw_deg2_per_hz", "heave_m2_per_hz")
"""Fields of a spectrum, in the order of a shake's axes."""


class Trace(FaultSpec):
    """The ego's body turns as a gyro recorded it.

    A CSV file with the columns time_s, roll_rate_radps, pitch_rate_radps, yaw_rate_radps in this order, the
    first row being the run's first instant. Rates are integrated (trapezoids), less the straight line of the
    angles over the run, which a gyro's bias makes, times scale. The file covers the run, without gaps.
    Unit: a file, relative to the folder in which simbench runs. Source: yours.
    """

    name: ClassVar[str] = "motion.trace"
    strength: ClassVar[str] = "file"
    zero_when_off: ClassVar[tuple[str, ...]] = ("scale",)
    unit: ClassVar[str] = "CSV file"

    file: Annotated[str, Field(max_length=1000)] = ""
    scale: Annotated[float, Field(ge=-100, le=100, allow_inf_nan=False)] = 1.0

    @property
    def is_off(self) -> bool:
        """No file, or nothing of it."""
        return not self.file or self.scale == 0.0


class Knock(FaultSpec):
    """Something knocks a sensor's bracket: from then on it looks elsewhere than it was calibrated.

    The bracket turns by angle_deg about an axis of the ego at at_s, within rise_ms (a half cosine).
    Unit: degrees. Source: judgement (1-2 degrees).
    """

    name: ClassVar[str] = "motion.knock_deg"
    strength: ClassVar[str] = "angle_deg"
    zero_when_off: ClassVar[tuple[str, ...]] = ("angle_deg",)
    unit: ClassVar[str] = "deg"

    angle_deg: Annotated[float, Field(ge=-30, le=30, allow_inf_nan=False)] = 0.0
    axis: Axis = "yaw"
    at_s: Annotated[float, Field(ge=0, le=3600, allow_inf_nan=False)] = 1.0
    rise_ms: Annotated[float, Field(ge=1, le=1000, allow_inf_nan=False)] = 10.0
    sensors: Sensors = "cameras"


SHAKERS: tuple[type[FaultSpec], ...] = (Mode, RoadShake, Spectrum, Trace, Vibration)
"""What shakes the whole body: one of them at a time."""
SPECS: tuple[type[FaultSpec], ...] = (Flex, Knock, *SHAKERS)
SEVERITIES: tuple[Severity, ...] = (
    Severity(fault=Flex.name, values=(0.02, 0.05, 0.1, 0.2, 0.5), source="judgement"),
    Severity(
        fault=Knock.name, values=(0.1, 0.25, 0.5, 1.0, 2.0), source="judgement: 1 to 2 degrees and less"
    ),
    Severity(fault=Mode.name, values=(0.1, 0.2, 0.5, 1.0, 2.0), source="as the classes of roads, and beyond"),
    Severity(
        fault=Spectrum.name, values=(0.25, 0.5, 1.0, 2.0, 4.0), source="amplitudes about the given ones"
    ),
    Severity(fault=RoadShake.name, values=("A", "B", "C", "D", "E"), source="classes of ISO 8608"),
    Severity(
        fault=Vibration.name,
        values=(0.07, 0.14, 0.28, 0.55, 1.1),
        profile="car",
        source="pitch of a car at 12.5 m/s on ISO 8608 classes A to E, computed",
    ),
    Severity(
        fault=Vibration.name,
        values=(0.5, 1.0, 2.0, 3.0, 5.0),
        profile="rider",
        source="sway of the wearer, assumed",
    ),
)
