"""A small analytic scene: flat ground and turned boxes, for the conformance kit and provisional shapes.

Not a simulator: everything stands still during a sweep, nothing is measured with error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64


@dataclass(frozen=True, kw_only=True)
class Block:
    """A box standing in a z-up frame: centre and full size in metres, turned about z."""

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_rad: float = 0.0

    def corners_m(self) -> Float64[np.ndarray, "8 3"]:
        """The eight corners."""
        signs = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5], indexing="ij"), axis=-1)
        turned: np.ndarray = signs.reshape(8, 3) * self.size_m @ _about_z(self.yaw_rad).T
        return turned + self.centre_m


def beams(rings: int, columns: int, elevation_rad: float) -> Float64[np.ndarray, "n 3"]:
    """Unit directions of a spinning LiDAR, column by column, elevations within +- the given angle."""
    azimuth = -2.0 * np.pi * np.arange(columns) / columns  # clockwise from above, starting forward
    elevation = np.linspace(elevation_rad, -elevation_rad, rings)
    az, el = (grid.ravel() for grid in np.meshgrid(azimuth, elevation, indexing="ij"))
    return np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=1)


def cast(
    origin_m: Float64[np.ndarray, "3"],
    directions: Float64[np.ndarray, "n 3"],
    blocks: Sequence[Block],
    *,
    ground: bool = True,
) -> tuple[Float64[np.ndarray, " n"], Int64[np.ndarray, " n"]]:
    """Range [n] along each ray to the first hit (inf: none) and the block hit [n] (-1: ground or none)."""
    directions = np.asarray(directions, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        down = -origin_m[2] / directions[:, 2]
        range_m = np.where((down > 0.0) & ground, down, np.inf)
        hit = np.full(len(directions), -1, dtype=np.int64)
        for index, block in enumerate(blocks):
            rotation, half = _about_z(block.yaw_rad), 0.5 * np.asarray(block.size_m)
            start, along = (origin_m - block.centre_m) @ rotation, directions @ rotation
            a, b = (-half - start) / along, (half - start) / along
            enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            nearer = (enter <= leave) & (enter > 0.0) & (enter < range_m)
            range_m, hit = np.where(nearer, enter, range_m), np.where(nearer, index, hit)
    return range_m, hit


def _about_z(yaw_rad: float) -> Float64[np.ndarray, "3 3"]:
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
