"""What every fault spec has: a name, a strength, a unit; and the sensors that it may name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args, get_origin

from pydantic import model_validator

from scenarios.scenario import Name, Spec, broken

Cameras = Literal["cameras"] | tuple[Name, ...]
"""All cameras of the rig, or some by their names."""

Sensors = Literal["cameras", "lidar"] | tuple[Name, ...]
"""All cameras of the rig, its LiDAR (whatever its name), or some cameras by their names."""


Level = float | str | Mapping[str, float | str]
"""A fault's strength, or values of several of its fields."""

Profile = Literal["car", "rider"]
"""Whose body carries the sensors."""


@dataclass(frozen=True, kw_only=True)
class Severity:
    """What severities 1 to 5 of a fault mean: values of its strength, or of several fields at once.
    `profile`: the body it holds for (None: both).
    """

    fault: str
    values: tuple[Level, Level, Level, Level, Level]
    profile: Profile | None = None
    source: str


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

    @classmethod
    def off_words(cls) -> str:
        """How to say on the command line that a fault is off."""
        words = cls.strength_words()
        if words:
            return words[0]
        return "0" if cls.strength in cls.zero_when_off else f"{{{cls.zero_when_off[0]}: 0}}"

    @property
    def is_off(self) -> bool:
        """Whether this spec does nothing."""
        return all(getattr(self, field) == 0.0 for field in self.zero_when_off)

    @property
    def named_cameras(self) -> tuple[str, ...]:
        """The cameras that this spec names one by one; empty when it means all of them."""
        sensors = getattr(self, "sensors", "cameras")
        return () if isinstance(sensors, str) else tuple(sensors)

    @model_validator(mode="after")
    def _names_cameras_once(self) -> FaultSpec:
        named = self.named_cameras
        if getattr(self, "sensors", "cameras") == ():
            raise broken("names no camera; leave it out to mean all", "sensors")
        if len(set(named)) < len(named):
            raise broken("names a camera twice", "sensors")
        return self
