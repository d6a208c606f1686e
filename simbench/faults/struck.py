"""Which sensors of a rig a fault acts on, and which it leaves alone."""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from scenarios.faults import FaultSpec


class Sensors(Protocol):
    """Whatever has cameras and a LiDAR, by their names."""

    @property
    def cameras(self) -> Collection[str]: ...

    @property
    def lidar_name(self) -> str: ...


def struck(spec: FaultSpec, on: Sensors) -> tuple[str, ...]:
    """The sensors that a fault acts on."""
    if getattr(spec, "sensors", "cameras") == "lidar":
        return (on.lidar_name,)
    return spec.named_cameras or tuple(on.cameras)


def spared(spec: FaultSpec, on: Sensors) -> tuple[str, ...]:
    """The sensors that a fault leaves alone, where it says which ones it acts on; else none."""
    if getattr(spec, "sensors", "cameras") == "cameras":
        return ()
    return tuple(name for name in (*on.cameras, on.lidar_name) if name not in struck(spec, on))
