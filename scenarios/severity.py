"""Severities 1 to 5 of the faults, and what a vibration level means on a real road."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from types import MappingProxyType
from typing import Literal

from scenarios.errors import BadInput
from scenarios.faults import FAULTS, FaultSpec

Profile = Literal["car", "rider"]


@dataclass(frozen=True, kw_only=True)
class Severity:
    """What severities 1 to 5 of a fault mean, as numbers or words. `profile`: the body it holds for (None:
    both).
    """

    fault: str
    values: tuple[float, float, float, float, float] | tuple[str, str, str, str, str]
    profile: Profile | None
    source: str


SEVERITIES = (
    Severity(
        fault="timing.trigger_offset_ms",
        values=(2.0, 10.0, 30.0, 50.0, 100.0),
        profile=None,
        source="field reports of 2 to 150 ms",
    ),
    Severity(
        fault="calibration.rotation_deg",
        values=(0.1, 0.25, 0.5, 1.0, 2.0),
        profile=None,
        source="field reports of 0.1 to 3 degrees",
    ),
    Severity(
        fault="motion.flex_deg",
        values=(0.02, 0.05, 0.1, 0.2, 0.5),
        profile=None,
        source="judgement",
    ),
    Severity(
        fault="motion.road",
        values=("A", "B", "C", "D", "E"),
        profile=None,
        source="classes of ISO 8608",
    ),
    Severity(
        fault="motion.vibration_deg",
        values=(0.07, 0.14, 0.28, 0.55, 1.1),
        profile="car",
        source="pitch of a car at 12.5 m/s on ISO 8608 classes A to E, computed",
    ),
    Severity(
        fault="motion.vibration_deg",
        values=(0.5, 1.0, 2.0, 3.0, 5.0),
        profile="rider",
        source="sway of the wearer, assumed",
    ),
)

ROAD_PITCH_RMS_DEG = MappingProxyType(
    {
        "car": (0.07, 0.14, 0.28, 0.55, 1.1),
        "rider": (0.11, 0.21, 0.42, 0.85, 1.7),
    }
)
"""Pitch RMS in degrees on ISO 8608 classes A to E: a car at 12.5 m/s; the deck of an e-scooter at 5.2 m/s
(computed; the scooter's E is D doubled, as roughness doubles from class to class)."""


def severe(fault: str, level: int, profile: Profile = "car") -> FaultSpec:
    """The spec of `fault` at severity `level` (1 to 5). BadInput: it has no severities, or no such level."""
    for severity in SEVERITIES:
        if severity.fault == fault and severity.profile in (None, profile):
            if not 1 <= level <= len(severity.values):
                raise BadInput(f"severity {level} of {fault} does not exist", allowed="1 to 5")
            spec = FAULTS[fault]
            return spec.model_validate({spec.strength: severity.values[level - 1]})
    raise BadInput(f"{fault} has no severities", allowed=", ".join(sorted({s.fault for s in SEVERITIES})))


def road_class(rms_deg: float, profile: Profile) -> str:
    """The ISO 8608 class whose road gives this body that pitch RMS: "A" to "E", or "beyond E: stress only".

    A class spans a factor of 2 in amplitude around its mean; anything below A's counts as A.
    """
    for letter, mean_deg in zip("ABCDE", ROAD_PITCH_RMS_DEG[profile], strict=True):
        if rms_deg <= mean_deg * sqrt(2.0):
            return letter
    return "beyond E: stress only"
