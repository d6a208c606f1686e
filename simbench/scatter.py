"""Background placed by seed: no overlaps, never on the driven lanes, never in an actor's way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from scenarios.errors import BadInput
from scenarios.scenario import Scatter
from simbench.bend import BentRoad

MAX_TRIES = 400
CLEARANCE_M = 0.4


@dataclass(frozen=True, kw_only=True)
class Placement:
    """One background thing: where it stands (or starts to walk), how large it is."""

    part: str
    category: str
    xy_m: tuple[float, float]
    heading_rad: float
    scale: float
    speed_mps: float


def place(
    scatter: tuple[Scatter, ...],
    radius_m: dict[str, float],
    lanes_m: tuple[tuple[float, float], ...],
    keep_off_m: Float64[np.ndarray, "k 3"],
    duration_s: float,
    rng: np.random.Generator,
    road: BentRoad | None = None,
) -> tuple[Placement, ...]:
    """Draw the background. `radius_m`: footprint radius by part. `keep_off_m` [k 3]: circles (x, y, radius)
    that actors sweep in the world. `road`: its bend, by which areas, lanes and placements are given; None: it
    is straight, and all are in the world. Raises BadInput when an area has no room."""
    taken = [tuple(row) for row in keep_off_m]
    placed: list[Placement] = []
    for group in scatter:
        x0, y0, x1, y1 = group.area_m
        for number in range(group.count):
            for _ in range(MAX_TRIES):
                x, y = rng.uniform(x0, x1), rng.uniform(y0, y1)
                heading = rng.uniform(0.0, 2.0 * np.pi)
                scale = 1.0 + rng.uniform(-1.0, 1.0) * group.scale_spread
                if group.align_deg is not None:
                    heading = np.deg2rad(group.align_deg)
                walk = group.speed_mps * duration_s
                if road is not None:  # the inner side of a bend is shorter than its centre line
                    walk *= road.longest_ratio(max(abs(y), abs(y + walk * np.sin(heading))))
                radius = radius_m[group.part] * scale
                swept = [
                    (x + u * walk * np.cos(heading), y + u * walk * np.sin(heading), radius)
                    for u in np.linspace(0.0, 1.0, 1 + int(np.ceil(walk / max(radius, 0.2))))
                ]
                on_lane = any(
                    lane[0] - CLEARANCE_M < cy + cr and cy - cr < lane[1] + CLEARANCE_M
                    for (_, cy, cr) in swept
                    for lane in lanes_m
                )
                circles = swept if road is None else _in_world(swept, road)
                hits = any(
                    np.hypot(cx - tx, cy - ty) < cr + tr + CLEARANCE_M
                    for (cx, cy, cr) in circles
                    for (tx, ty, tr) in taken
                )
                if not on_lane and not hits:
                    taken += circles
                    placed.append(
                        Placement(
                            part=group.part,
                            category=group.category,
                            xy_m=(x, y),
                            heading_rad=heading,
                            scale=scale,
                            speed_mps=group.speed_mps,
                        )
                    )
                    break
            else:
                raise BadInput(
                    f"no room for {group.part} {number + 1} of {group.count} in area_m {list(group.area_m)}: "
                    f"make the area larger or the count smaller"
                )
    return tuple(placed)


def _in_world(circles: list[tuple[float, float, float]], road: BentRoad) -> list[tuple[float, float, float]]:
    """Circles (along, left, radius) about the same points of the world (x, y, radius)."""
    table = np.array(circles)
    xy = road.to_world(table[:, :2])
    return [(x, y, radius) for (x, y), radius in zip(xy.tolist(), table[:, 2].tolist(), strict=True)]
