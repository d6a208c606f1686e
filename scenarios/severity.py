"""Severities 1 to 5 of the faults, and what a vibration level means on a real road."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from types import MappingProxyType

from scenarios.errors import BadInput
from scenarios.faults import FAMILIES, FAULTS, FaultSpec
from scenarios.faults.spec import Profile, Severity

__all__ = ["ROAD_PITCH_RMS_DEG", "SEVERITIES", "Profile", "Severity", "road_class", "severe"]

SEVERITIES: tuple[Severity, ...] = tuple(s for family in FAMILIES for s in family.SEVERITIES)
"""Of all faults."""

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
            spec, value = FAULTS[fault], severity.values[level - 1]
            return spec.model_validate(dict(value) if isinstance(value, Mapping) else {spec.strength: value})
    raise BadInput(f"{fault} has no severities", allowed=", ".join(sorted({s.fault for s in SEVERITIES})))


def road_class(rms_deg: float, profile: Profile) -> str:
    """The ISO 8608 class whose road gives this body that pitch RMS: "A" to "E", or "beyond E: stress only".

    A class spans a factor of 2 in amplitude around its mean; anything below A's counts as A.
    """
    for letter, mean_deg in zip("ABCDE", ROAD_PITCH_RMS_DEG[profile], strict=True):
        if rms_deg <= mean_deg * sqrt(2.0):
            return letter
    return "beyond E: stress only"
