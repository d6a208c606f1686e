"""Other scenes than the paper's, one thing changed at a time: what would have to be different."""

from __future__ import annotations

from dataclasses import dataclass

from simbench.case import Boxes
from simbench.reproduce.cells import Cell


@dataclass(frozen=True, kw_only=True)
class Scene:
    """side_m: how far to the side the two pass; farther_m: how much farther apart they are along the road,
    all the time; bare: nothing stands or walks beside the road; boxes: where detections come from, None: as
    everywhere."""

    name: str
    title: str
    side_m: float = 3.0
    farther_m: float = 0.0
    bare: bool = False
    boxes: Boxes | None = None


SCENES = (
    Scene(name="close", title="passes 1.5 m to the side, not 3 m", side_m=1.5),
    Scene(name="wide", title="passes 4.5 m to the side", side_m=4.5),
    Scene(name="far", title="15 m farther apart along the road", farther_m=15.0),
    Scene(name="bare", title="nothing but road, car and rider", bare=True),
    Scene(name="labels", title="exact boxes, not a detector's", boxes="labels"),
)
AHEAD_M = {("overtake-approach", "car"): 28.5, ("overtake-approach", "wearable"): 31.0}
"""How far ahead the rider is at first, as the scenarios say; 0 in `overtake-recede`."""


def changes_of(scene: Scene, cell: Cell) -> tuple[str, ...]:
    """What `--set` is given."""
    changes = []
    if scene.side_m != 3.0 or scene.farther_m:
        ahead_m = AHEAD_M.get((cell.scenario, cell.system), 0.0)
        x_m = ahead_m + (scene.farther_m if ahead_m else -scene.farther_m)
        changes.append(f"systems.{cell.system}.actors.rider.path.waypoints_m=[[{x_m:g}, {-scene.side_m:g}]]")
    if scene.bare:
        changes.append("background=[]")
    return tuple(changes)
