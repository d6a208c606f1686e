"""Every row of an image at its own time: when it is exposed, and where camera and bodies are then."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64, Int64

from scenarios.scenario import CameraSensor
from simbench.motion import Motion
from simbench.sensors import rays

KEY_NS = 500_000  # bodies move evenly between instants so far apart: 0.03 mm off at 1,000 m/s^2


def line_delay_ns(sensor: CameraSensor) -> float:
    """From one row's exposure to the next's; 0 for a global shutter."""
    return round(sensor.readout_ms * 1e6) / max(sensor.height_px - 1, 1)


def row_times_ns(mid_ns: int, line_delay_ns: float, height_px: int) -> Int64[np.ndarray, " h"]:
    """The middle of each row's exposure, top row first; the middle row's is `mid_ns`."""
    return mid_ns + np.rint((np.arange(height_px) - 0.5 * (height_px - 1)) * line_delay_ns).astype(np.int64)


def _keys(t_ns: Int64[np.ndarray, " h"]) -> tuple[np.ndarray, np.ndarray]:
    """Instants at most KEY_NS apart from the first to the last of t_ns, and where among them t_ns lie."""
    first, last = int(t_ns[0]), int(t_ns[-1])
    count = 2 + (last - first) // KEY_NS
    keys = first + np.rint(np.linspace(0, last - first, count)).astype(np.int64)
    return keys, np.interp(t_ns - first, keys - first, np.arange(count))


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposure:
    """Geoms and camera while each row is exposed, for `rays.cast_fans`.

    Row r sees the geoms between keys key[r] and key[r] + 1 of `placed`, weight[r] of the way.
    """

    placed: rays.Placed
    key: Int64[np.ndarray, " h"]
    weight: Float64[np.ndarray, " h"]
    R_world_camera: Float64[np.ndarray, "h 3 3"]
    origin_m: Float64[np.ndarray, "h 3"]


@lru_cache(maxsize=4)
def _placed(motion: Motion, keys_ns: tuple[int, ...]) -> rays.Placed:
    """All geoms at some instants; kept, because cameras that share a pulse ask for the same ones."""
    return rays.place(motion.world.geoms, *motion.poses(np.array(keys_ns, dtype=np.int64)))


def exposure_at(motion: Motion, sensor: str, t_ns: Int64[np.ndarray, " h"]) -> Exposure:
    """Poses for rows that are exposed about true times t_ns, which do not descend."""
    if t_ns[0] == t_ns[-1]:
        keys, at = t_ns[:1], np.zeros(len(t_ns))
        rotation, origin = motion.sensor(sensor, keys)
        rotation, origin = np.repeat(rotation, len(t_ns), axis=0), np.repeat(origin, len(t_ns), axis=0)
    else:
        keys, at = _keys(t_ns)
        rotation, origin = motion.sensor(sensor, t_ns)
    key = np.minimum(at.astype(np.int64), max(len(keys) - 2, 0))
    return Exposure(
        placed=_placed(motion, tuple(keys.tolist())),
        key=key,
        weight=at - key,
        R_world_camera=rotation,
        origin_m=origin,
    )
