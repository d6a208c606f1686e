"""What stands in place of a scenario where data were recorded: its name, its objects, where it came from."""

from __future__ import annotations

from typing import Any, Literal

from scenarios.scenario import Finite, Name, NonNegative, Positive, Spec

SYSTEM = "car"  # data of KITTI were recorded from a car; there is no second rig


class RecordedObject(Spec):
    """One labelled object. `size_m`: length, width, height by its label. `occlusion_known`: in some frame."""

    name: str
    category: Name
    size_m: tuple[Positive, Positive, Positive]
    occlusion_known: bool


class RecordedSystem(Spec):
    """As a scenario's system: whether there is something to score."""

    target: str | None


class RecordedScene(Spec):
    """One recording. `number`: of the object layout's frame, the sequence or the drive; it is the run's seed.

    `sha256`: of everything that was read. `boxes`: where detections come from. `rig`: what
    the system is called.
    """

    name: Name
    description: str
    rig: str = SYSTEM
    number: NonNegative
    frames: tuple[int, int]
    sweeps: int
    duration_s: Finite
    boxes: Literal["labels", "model"]
    objects: tuple[RecordedObject, ...]
    sha256: str

    def system(self, name: str) -> RecordedSystem:
        """The one system. KeyError: another one is asked for."""
        if name != self.rig:
            raise KeyError(name)
        return RecordedSystem(target=self.objects[0].name if self.objects else None)


def as_yaml(scene: RecordedScene) -> str:
    """All fields in the schema's order; equal scenes give equal text."""
    import yaml

    data: dict[str, Any] = scene.model_dump(mode="json")
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True, width=110)
