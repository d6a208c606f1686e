"""Beams with width: rays of fans with a narrow cone about each, and rays within the cones.

Most cones hold a single surface. `edges` finds the others, and which few geoms each of them may meet, so that
`cast_cones` need not look for them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, Int64

from simbench.sensors import cone_kernel as kernel
from simbench.sensors.ray_kernel import LANES
from simbench.sensors.rays import Fans, Geoms, Hits, Placed, empty_hits

DEEPEST_M = 1.0  # how deep below its surface a geom's cone is looked for, at most
ROOM_PER_RAY = 8  # entries of the list of geoms to begin with


@dataclass(frozen=True, kw_only=True, eq=False)
class Cones:
    """Some rays of fans (ray step[i] of fan[i]) and the geoms that any ray of the cone about each may meet,
    but planes: member[first[i] : first[i + 1]]."""

    fan: Int64[np.ndarray, " n"]
    step: Int64[np.ndarray, " n"]
    first: Int64[np.ndarray, " m"]
    member: Int32[np.ndarray, " e"]


def edges(
    placed: Placed,
    key: Int64[np.ndarray, " p"],
    weight: Float64[np.ndarray, " p"],
    R_world_sensor: Float64[np.ndarray, "p 3 3"],
    origin_m: Float64[np.ndarray, "p 3"],
    fans: Fans,
    hits: Hits,
    grown: Geoms,
    widening: float,
    depth: Float64[np.ndarray, " g"],
) -> Cones:
    """The rays whose cones may hold more than one surface; none that does is left out.

    hits [f k]: what the rays themselves meet. A cone's radius is `widening` times the distance. `grown`: the
    same geoms, each grown by the cones' radius at its distance. depth: how many radii below its surface, met
    head on, a geom is looked for that fills the cone. The rest is as for `rays.cast_fans`.
    """
    geoms, rays = placed.geoms, hits.geom.size
    fan, step = np.empty(rays, dtype=np.int64), np.empty(rays, dtype=np.int64)
    first = np.empty(rays + 1, dtype=np.int64)
    room = ROOM_PER_RAY * rays
    while True:
        member = np.empty(room, dtype=np.int32)
        count = kernel._edges(
            geoms.kind, geoms.size_m, grown.size_m, grown.bound_m, placed.row, placed.still, placed.keys,
            placed.path_m, key, weight, R_world_sensor, origin_m, fans.pose, fans.frame, fans.slope,
            fans.skew, fans.first_step, fans.last_step, fans.low, fans.bins_per_slope, fans.slack,
            fans.skew_max, widening, depth, DEEPEST_M, hits.range_m, hits.geom, hits.cosine, fan, step, first,
            member,
        )  # fmt: skip
        if count >= 0:
            break
        room *= 2
    return Cones(fan=fan[:count], step=step[:count], first=first[: count + 1], member=member[: first[count]])


def cast_cones(
    placed: Placed,
    key: Int64[np.ndarray, " p"],
    weight: Float64[np.ndarray, " p"],
    R_world_sensor: Float64[np.ndarray, "p 3 3"],
    origin_m: Float64[np.ndarray, "p 3"],
    fans: Fans,
    cones: Cones,
    offset_rad: Float64[np.ndarray, "s 2"],
) -> Hits:
    """Nearest hits [n s] of rays that look aside the middle ones of cones by angles (across to the left, up),
    among planes and the cones' own geoms."""
    samples = len(offset_rad)
    hits = empty_hits((len(cones.fan), samples))
    across, up = (
        np.pad(np.tan(angle), (0, -samples % LANES), mode="edge").reshape(-1, LANES) for angle in offset_rad.T
    )
    kernel._cast_cones(
        placed.geoms.kind, placed.geoms.size_m, placed.geoms.bound_m, placed.row, placed.still, placed.keys,
        key, weight, R_world_sensor, origin_m, fans.pose, fans.frame, fans.slope, fans.skew, cones.fan,
        cones.step, cones.first, cones.member, up, across, samples, hits.range_m, hits.geom, hits.cosine,
    )  # fmt: skip
    return hits
