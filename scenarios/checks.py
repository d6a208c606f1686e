"""What must hold between the parts of a scenario: files exist, actors stand apart, something is recorded."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import atan2, cos, pi, radians, sin
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from scenarios.categories import rough_size_m
from scenarios.equipment import load_rig, rig_sensors
from scenarios.errors import Where, nearest
from scenarios.fault_set import FaultSet
from scenarios.library import find
from scenarios.palette import materials_of, palette

if TYPE_CHECKING:
    from scenarios.scenario import Actor, Scenario, System

Box: TypeAlias = tuple[float, float, float, float, float]
"""x, y, heading in radians, length, width: an oriented rectangle on the ground."""


def check_scenario(
    scenario: Scenario, faults: FaultSet, where: Where, beside: Path | None, note: str = ""
) -> None:
    """BadInput: the first thing that does not hold, with its line.

    note: ends messages about numbers that a distribution may have drawn.
    """
    for index, scatter in enumerate(scenario.background):
        find("part", scatter.part, where.at("background", index, "part"))
        _check_area_leaves_lanes(scenario, index, where, note)
    cameras: dict[str, None] = {}
    for name, system in scenario.systems.items():
        here = where.at("systems", name)
        for actor_name, actor in system.actors.items():
            find("part", actor.part, here.at("actors", actor_name, "part"))
            _check_materials(actor, here.at("actors", actor_name, "materials"))
        cameras |= dict.fromkeys(_check_rig(system, here, beside, note))
        _check_actors_stand_apart(system, here, note)
    faults.check(tuple(cameras), where.at("faults"))


def _check_rig(system: System, where: Where, beside: Path | None, note: str) -> Iterator[str]:
    rig = load_rig(system.rig, beside, where.at("rig"))
    sensors = rig_sensors(rig, beside)
    rate_hz = next(sensor.rate_hz for sensor in sensors.values() if sensor.kind == "lidar")
    if system.duration_s * rate_hz < 1.0 - 1e-9:
        raise where.error(
            f"{system.duration_s:g} s is shorter than one sweep of {1.0 / rate_hz:g} s: zero frames{note}",
            ("duration_s",),
        )
    return (name for name, sensor in sensors.items() if sensor.kind == "camera")


def _check_materials(actor: Actor, where: Where) -> None:
    """Only what is drawn for each part may be given; what the whole scene shares is nobody's own."""
    own = [name for name in materials_of(actor.part) if palette()[name]["per"] == "instance"]
    for name in actor.materials or {}:
        if name not in own:
            problem = f"the part '{actor.part}' has no material '{name}' of its own"
            raise where.error(problem, (name,), allowed=", ".join(sorted(own)), hint=nearest(name, own))


def _check_area_leaves_lanes(scenario: Scenario, index: int, where: Where, note: str) -> None:
    scatter = scenario.background[index]
    _, y0, _, y1 = scatter.area_m
    for lane0, lane1 in scenario.road.lanes_m:
        if scatter.count and lane0 <= y0 and y1 <= lane1:
            raise where.error(
                f"lies within the lane from y {lane0:g} to {lane1:g}, where nothing may stand{note}",
                ("background", index, "area_m"),
            )


def _check_actors_stand_apart(system: System, where: Where, note: str) -> None:
    for (name_a, actor_a), (name_b, actor_b) in combinations(system.actors.items(), 2):
        if overlap(start_box(actor_a), start_box(actor_b)):
            raise where.error(
                f"'{name_b}' stands inside '{name_a}' at the start{note}",
                ("actors", name_b, "path", "waypoints_m"),
            )


def start_box(actor: Actor) -> Box:
    """Where an actor starts, and its footprint by its category's size."""
    (x, y), *rest = actor.path.waypoints_m
    heading = atan2(rest[0][1] - y, rest[0][0] - x) if rest else radians(actor.path.heading_deg)
    if (sway := actor.path.sway) is not None:
        left = sway.amplitude_m * sin(radians(sway.phase_deg))
        x, y = x - left * sin(heading), y + left * cos(heading)
    length, width, _ = rough_size_m(actor.category)
    return x, y, heading, length * actor.scale, width * actor.scale


def overlap(a: Box, b: Box) -> bool:
    """Whether two rectangles share area: on no side's normal are they apart (separating axes)."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    for angle in (a[2], a[2] + pi / 2, b[2], b[2] + pi / 2):
        apart = abs(dx * cos(angle) + dy * sin(angle))
        if apart >= _half_extent(a, angle) + _half_extent(b, angle):
            return False
    return True


def _half_extent(box: Box, angle: float) -> float:
    turn = box[2] - angle
    return 0.5 * (box[3] * abs(cos(turn)) + box[4] * abs(sin(turn)))
