"""A surveyed field of plates around the LiDAR: what receipts measure its pose with.

It stands for a hall hung with flat targets that are known to the last digit, exists for receipts only, and
never reaches a pipeline. The LiDAR looks at it instead of the world, by the same beams at the same instants
and on the same motion as in its sweeps. Plates hang all around at two distances, each turned from the line of
sight by `TILT_DEG` to another side, so that a few beams of one firing fix all of the pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float64

from simbench.motion import Motion
from simbench.sensors import rays

STEP_DEG = 5.0  # from plate to plate
STEEPEST_DEG = 65.0  # above and below the horizon: the beams of a LiDAR that leans by 40
NEAR_M, FAR_M = 7.0, 12.0
TILT_DEG = 50.0
GOLDEN_DEG = 137.50776405  # from one plate's tilt to the next: no two neighbours lean alike
THIN_M = 5e-7  # half a plate's thickness: below what a point is rounded to


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """Plates by number: centres in m and unit normals, in the world."""

    centre_m: Float64[np.ndarray, "m 3"]
    normal: Float64[np.ndarray, "m 3"]
    geoms: rays.Geoms


def field(place_m: Float64[np.ndarray, "3"]) -> Field:
    """The field around a place in the world."""
    around = _around_the_origin()
    centre_m = around.centre_m + place_m
    return replace(around, centre_m=centre_m, geoms=replace(around.geoms, position_m=centre_m))


def in_field(motion: Motion, plates: Field) -> Motion:
    """The same motion with the plates as all that there is to see."""
    world, n = motion.world, len(plates.centre_m)
    seen = replace(
        world, geoms=plates.geoms, geom_model_id=np.zeros(n, dtype=np.int32),
        geom_object=np.zeros(n, dtype=np.int32), reflectivity=np.ones(n), roughness_gain=np.ones(n),
    )  # fmt: skip
    return replace(motion, world=seen)


@lru_cache(maxsize=1)
def _around_the_origin() -> Field:
    elevation, azimuth = np.deg2rad(
        np.meshgrid(
            np.arange(-STEEPEST_DEG, STEEPEST_DEG + 0.5 * STEP_DEG, STEP_DEG),
            np.arange(0.0, 360.0, STEP_DEG),
            indexing="ij",
        )
    ).reshape(2, -1)
    count = np.arange(len(azimuth))
    c, s, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    outward = np.stack([ce * c, ce * s, se], axis=1)
    left, up = np.stack([-s, c, 0.0 * c], axis=1), np.stack([-se * c, -se * s, ce], axis=1)
    side, tilt = np.deg2rad(GOLDEN_DEG * count)[:, None], np.deg2rad(TILT_DEG)
    lean = np.cos(side) * left + np.sin(side) * up
    normal = np.cos(tilt) * outward + np.sin(tilt) * lean
    along = -np.sin(tilt) * outward + np.cos(tilt) * lean
    distance_m = np.where(count % 2 == 0, NEAR_M, FAR_M)
    half_m = 0.5 * np.deg2rad(STEP_DEG) * distance_m
    size_m = np.stack([np.full_like(half_m, THIN_M), half_m / np.cos(tilt), half_m], axis=1)
    centre_m = distance_m[:, None] * outward
    return Field(
        centre_m=centre_m,
        normal=normal,
        geoms=rays.Geoms(
            kind=np.full(len(count), rays.BOX, dtype=np.int32),
            size_m=size_m,
            body=np.zeros(len(count), dtype=np.int32),
            rotation=np.stack([normal, along, np.cross(normal, along)], axis=2),
            position_m=centre_m,
            bound_m=np.linalg.norm(size_m, axis=1),
        ),
    )
