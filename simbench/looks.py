"""What only cameras see: colours, gloss, and the paint on the ground.

The ground is one plane. What lies on it (grass beyond the pavement, lines, dashes) is a table of strips along
x, declared here once: OpenGL draws them as thin slabs, the shader of ray-cast pictures reads the table.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64

from fusion.geometry import readonly
from scenarios.scenario import Road

LINE_WIDTH_M = 0.12
DASH_M, DASH_PERIOD_M = 3.0, 9.0  # the middle line: 3 m painted, 6 m gap
GRASS_M = 200.0  # how far grass goes on beyond the pavement
Colour = tuple[float, float, float]
Rectangle = tuple[float, float, float, float]  # x0, y0, x1, y1


@dataclass(frozen=True, kw_only=True, eq=False)
class Paint:
    """Strips on the ground plane, world metres; later ones cover earlier ones. Colours are sRGB 0..1.

    extent_m: x0, y0, x1, y1 of each strip. period_m: 0 where it is unbroken; else it is painted `dash_m` long
    from x0 on every `period_m`.
    """

    ground_colour: Float64[np.ndarray, " 3"]
    extent_m: Float64[np.ndarray, "p 4"]
    period_m: Float64[np.ndarray, " p"]
    dash_m: Float64[np.ndarray, " p"]
    grass: Bool[np.ndarray, " p"]
    colour: Float64[np.ndarray, "p 3"]

    def __post_init__(self) -> None:
        for name in ("ground_colour", "extent_m", "period_m", "dash_m", "grass", "colour"):
            object.__setattr__(self, name, readonly(getattr(self, name)))

    def rectangles(self) -> Iterator[tuple[int, Rectangle]]:
        """Every painted rectangle with the number of its strip."""
        for number, (x0, y0, x1, y1) in enumerate(self.extent_m.tolist()):
            period_m, dash_m = float(self.period_m[number]), float(self.dash_m[number])
            if period_m == 0.0:
                yield number, (x0, y0, x1, y1)
                continue
            for start in np.arange(x0, x1, period_m).tolist():
                yield number, (start, y0, min(start + dash_m, x1), y1)


def plain_paint(ground_colour: Colour = (0.33, 0.33, 0.33)) -> Paint:
    """Bare ground."""
    return Paint(
        ground_colour=np.array(ground_colour),
        extent_m=np.empty((0, 4)),
        period_m=np.empty(0),
        dash_m=np.empty(0),
        grass=np.empty(0, dtype=bool),
        colour=np.empty((0, 3)),
    )


def road_paint(road: Road, asphalt: Colour, marking: Colour, grass: Colour) -> Paint:
    """Grass on both sides of the pavement, an unbroken line at either edge of the lanes, dashes between
    lanes. A road with a bend is bare: strips are straight."""
    if road.bend is not None:
        return plain_paint(asphalt)
    half_length, half_width = 0.5 * road.length_m, 0.5 * road.width_m
    lanes = sorted(road.lanes_m)
    strips = [
        (-half_length, half_width, half_length, half_width + GRASS_M, 0.0, True),
        (-half_length, -half_width - GRASS_M, half_length, -half_width, 0.0, True),
    ]
    half_line = 0.5 * LINE_WIDTH_M
    for y in sorted({lanes[0][0], lanes[-1][1]}) if lanes else []:
        strips.append((-half_length, y - half_line, half_length, y + half_line, 0.0, False))
    for first, second in pairwise(lanes):
        y = 0.5 * (first[1] + second[0])
        strips.append((-half_length, y - half_line, half_length, y + half_line, DASH_PERIOD_M, False))
    on_grass = np.array([strip[5] for strip in strips])
    return Paint(
        ground_colour=np.array(asphalt),
        extent_m=np.array([strip[:4] for strip in strips]),
        period_m=np.array([strip[4] for strip in strips]),
        dash_m=np.where([strip[4] > 0.0 for strip in strips], DASH_M, 0.0),
        grass=on_grass,
        colour=np.where(on_grass[:, None], np.array(grass), np.array(marking)),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Looks:
    """Per geom as in `World.geoms`: sRGB colour, specular and shininess (MuJoCo's), all 0..1; the paint."""

    colour: Float64[np.ndarray, "g 3"]
    specular: Float64[np.ndarray, " g"]
    shininess: Float64[np.ndarray, " g"]
    paint: Paint

    def __post_init__(self) -> None:
        for name in ("colour", "specular", "shininess"):
            object.__setattr__(self, name, readonly(getattr(self, name)))


def plain_looks(geoms: int, colour: Colour = (0.6, 0.6, 0.6)) -> Looks:
    """Everything of one matt colour on bare ground."""
    return Looks(
        colour=np.tile(np.array(colour), (geoms, 1)),
        specular=np.zeros(geoms),
        shininess=np.zeros(geoms),
        paint=plain_paint(),
    )
