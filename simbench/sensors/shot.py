"""One sweep on its way: every beam aimed, everything it may meet at its place of that instant."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float32, Float64, Int64

from fusion.geometry import readonly
from simbench.motion import Motion
from simbench.sensors import cones, rays
from simbench.sensors.beams import BeamTable
from simbench.sensors.compiled import jit
from simbench.sensors.cones import Cones
from simbench.world import World

COLUMNS_PER_KEY = 32


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """The middle rays of all beams, [g k] by group and place in it (see `BeamTable`).

    The sensor's pose is exact at each group's instant. Bodies have key poses every `COLUMNS_PER_KEY` columns
    (3.1 ms of an OS1) and move evenly from one to the next: a body with acceleration a is off by a dt^2 / 8,
    12 micrometres at 10 m/s^2.
    """

    world: World
    placed: rays.Placed
    instant_ns: Int64[np.ndarray, " g"]
    rotation: Float64[np.ndarray, "g 3 3"]  # T_world_lidar
    origin_m: Float64[np.ndarray, "g 3"]
    body_rotation: Float64[np.ndarray, "t b 3 3"]
    body_position_m: Float64[np.ndarray, "t b 3"]
    key: Int64[np.ndarray, " g"]
    weight: Float64[np.ndarray, " g"]
    fans: rays.Fans
    width: int

    def cast(self) -> rays.Hits:
        """Nearest hits [g k] of all middle rays."""
        hits = rays.empty_hits((len(self.instant_ns), self.width))
        rays.cast_fans(self.placed, self.key, self.weight, self.rotation, self.origin_m, self.fans, hits)
        return hits

    def edges(
        self, hits: rays.Hits, grown: rays.Geoms, widening: float, depth: Float64[np.ndarray, " n"]
    ) -> Cones:
        """The beams whose cones may hold more than one surface; see `cones.edges`."""
        return cones.edges(
            self.placed, self.key, self.weight, self.rotation, self.origin_m, self.fans, hits, grown,
            widening, depth,
        )  # fmt: skip

    def cast_beside(self, edges: Cones, offset_rad: Float64[np.ndarray, "s 2"]) -> rays.Hits:
        """Nearest hits [n s] of rays that look aside some beams' middle ones by angles (across to the left,
        up), at the beams' own instants."""
        return cones.cast_cones(
            self.placed, self.key, self.weight, self.rotation, self.origin_m, self.fans, edges, offset_rad
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """Where the sensor is at every group's instant of a sweep (T_world_lidar), and all bodies at its keys."""

    rotation: Float64[np.ndarray, "g 3 3"]
    origin_m: Float64[np.ndarray, "g 3"]
    body_rotation: Float64[np.ndarray, "t b 3 3"]
    body_position_m: Float64[np.ndarray, "t b 3"]


def courses(
    name: str, motion: Motion, table: BeamTable, start_ns: Int64[np.ndarray, " n"]
) -> tuple[Course, ...]:
    """Those of several sweeps of sensor `name` that start at true times start_ns: quicker than one by one."""
    key_ns, instants = _keys(table, COLUMNS_PER_KEY)[0], table.group_offset_ns
    rotation, origin = motion.sensor(name, (start_ns[:, None] + instants).ravel())
    body_rotation, body_position = motion.poses((start_ns[:, None] + key_ns).ravel())
    sweeps = len(start_ns)
    return tuple(
        Course(rotation=a, origin_m=b, body_rotation=c, body_position_m=d)
        for a, b, c, d in zip(
            rotation.reshape(sweeps, -1, 3, 3), origin.reshape(sweeps, -1, 3),
            np.split(body_rotation, sweeps), np.split(body_position, sweeps), strict=True,
        )
    )  # fmt: skip


def aim(
    name: str,
    motion: Motion,
    table: BeamTable,
    start_ns: int,
    azimuth_error: Float32[np.ndarray, "c b"],
    elevation_error: Float32[np.ndarray, "c b"],
    sd_rad: float,
    course: Course | None = None,
) -> Shot:
    """Sensor `name` starts a sweep at true time `start_ns`; its beams are off by `sd_rad` times the two
    errors, to first order. course: that of this sweep, where it is known already."""
    if course is None:
        course = courses(name, motion, table, np.array([start_ns]))[0]
    _, key, weight = _keys(table, COLUMNS_PER_KEY)
    fans = table.fans
    if sd_rad > 0.0:
        slope, skew = fans.slope.copy(), fans.skew.copy()
        slack = _disturb(
            table.base, table.along_azimuth, table.along_elevation, table.slots,
            azimuth_error, elevation_error, sd_rad, slope, skew,
        )  # fmt: skip
        fans = replace(fans, slope=slope, skew=skew, slack=slack)
    return Shot(
        world=motion.world,
        placed=rays.place(motion.world.geoms, course.body_rotation, course.body_position_m),
        instant_ns=start_ns + table.group_offset_ns,
        rotation=course.rotation,
        origin_m=course.origin_m,
        body_rotation=course.body_rotation,
        body_position_m=course.body_position_m,
        key=key,
        weight=weight,
        fans=fans,
        width=table.slots.shape[1],
    )


@lru_cache(maxsize=8)
def _keys(
    table: BeamTable,
    columns_per_key: int,
) -> tuple[Int64[np.ndarray, " t"], Int64[np.ndarray, " g"], Float64[np.ndarray, " g"]]:
    """Times of key poses from the sweep's start, the last at or after the last firing; of each group, the key
    before it and how far it is on the way to the next."""
    fire_ns = table.group_offset_ns
    key_ns = table.column_offset_ns[::columns_per_key]
    if key_ns[-1] < fire_ns[-1]:
        key_ns = np.append(key_ns, fire_ns[-1])
    key = np.searchsorted(key_ns, fire_ns, side="right") - 1
    step_ns = np.append(np.diff(key_ns), 1)
    return readonly(key_ns), readonly(key), readonly((fire_ns - key_ns[key]) / step_ns[key])


@jit
def _disturb(base, along_azimuth, along_elevation, slots, azimuth_error, elevation_error, sd, slope, skew):  # type: ignore[no-untyped-def]
    """Slopes and skews of the disturbed beams; the largest change of any."""
    instants, width = slots.shape
    lanes, most = slope.shape[2], 0.0
    for g in range(azimuth_error.shape[0] * instants):
        c, i = g // instants, g % instants
        block, lane = g // lanes, g % lanes
        for k in range(width):
            b = slots[i, k]
            x, y = sd * azimuth_error[c, b], sd * elevation_error[c, b]
            forward = base[i, k, 0] + x * along_azimuth[i, k, 0] + y * along_elevation[i, k, 0]
            up = base[i, k, 1] + y * along_elevation[i, k, 1]
            left = base[i, k, 2] + x * along_azimuth[i, k, 2] + y * along_elevation[i, k, 2]
            new_slope, new_skew = up / forward, left / forward
            change = max(abs(new_slope - slope[block, k, lane]), abs(new_skew - skew[block, k, lane]))
            most = max(most, change)
            slope[block, k, lane], skew[block, k, lane] = new_slope, new_skew
    return most
