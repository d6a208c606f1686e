"""How the body that carries the sensors moves, and their brackets against it."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from scenarios.faults.spec import Cameras, FaultSpec, Severity
from scenarios.scenario import Finite, Spec


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


SPECS: tuple[type[FaultSpec], ...] = (Flex, RoadShake, Vibration)
SEVERITIES: tuple[Severity, ...] = (
    Severity(fault=Flex.name, values=(0.02, 0.05, 0.1, 0.2, 0.5), source="judgement"),
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
