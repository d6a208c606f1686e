"""The ground, sector by sector: a rolling sweep of a shaking sensor bends it, one plane does not follow.

The sweep is cut into narrow sectors about z. Each is measured within a few milliseconds, so that the sensor's
attitude is one and level ground is a line z = a + b r in it. The lines are fitted to low points: the mean of
what lies near the lowest point of each cell (sector x ring of distance). Cells under objects have no ground;
they lie above the line and lose their weight in a few rounds with a shrinking, asymmetric gate. Neighbouring
sectors share their sums, and a weak pull towards a plane through all sectors decides where a sector has no
ground of its own. In spirit the sectors of Himmelsbach et al. (IV 2010), with one line per sector.

Real ground is no line either: a road is cambered and has kerbs. What is flat in a cell and lies near the line
is ground too; the cells' deviations, averaged with their neighbours', are added to the lines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64


@dataclass(frozen=True, kw_only=True)
class LocalGroundConfig:
    """`sectors` in a full turn; `ring_m`: depth of a cell; gates: how far above the line a cell's low points
    may lie, round by round (below it: twice that)."""

    sectors: int = 72
    ring_m: float = 2.0
    max_range_m: float = 60.0
    low_band_m: float = 0.12  # what of a cell counts as low: this far above its lowest point
    gates_m: tuple[float, ...] = (0.8, 0.4, 0.2, 0.12)
    neighbours: int = 2  # sectors to either side that share their sums, with falling weight
    pull: float = 2.0  # cells' worth of weight for the common plane
    max_slope: float = 0.15
    unevenness_m: float = 0.35  # how far flat ground may lie off its line
    flat_share: float = 0.6  # of a cell's points below `step_m` above the lowest, what must be low
    step_m: float = 0.6
    slices: int = 6  # per sector; every other one is used. 0: all points


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalGround:
    """Per sector the line z = height_m + slope * r, at the sector's middle; per cell what is added to it."""

    height_m: Float64[np.ndarray, " s"]
    slope: Float64[np.ndarray, " s"]
    added_m: Float64[np.ndarray, "s rings"]
    ring_m: float

    def at(
        self, range_m: Float32[np.ndarray, " n"], azimuth_rad: Float32[np.ndarray, " n"]
    ) -> Float32[np.ndarray, " n"]:
        """Ground height [n] at planar distance and azimuth [n]; lines are linear between sectors' middles."""
        count, rings = self.added_m.shape
        turn = azimuth_rad * np.float32(count / (2.0 * math.pi)) + np.float32(count)
        ring = np.minimum((range_m / np.float32(self.ring_m)).astype(np.int32), rings - 1)
        added = self.added_m.astype(np.float32).ravel()[turn.astype(np.int32) % count * rings + ring]
        turn -= np.float32(0.5)
        left = turn.astype(np.int32)
        turn -= left
        left %= count
        height, slope = self.height_m.astype(np.float32), self.slope.astype(np.float32)
        rise, steeper = np.roll(height, -1) - height, np.roll(slope, -1) - slope
        ground: np.ndarray = height[left] + turn * rise[left]
        ground += range_m * (slope[left] + turn * steeper[left])
        ground += added
        return ground


def fit_local_ground(
    range_m: Float32[np.ndarray, " n"],
    azimuth_rad: Float32[np.ndarray, " n"],
    z_m: Float32[np.ndarray, " n"],
    config: LocalGroundConfig,
) -> LocalGround:
    """The ground below finite points [n], given by planar distance, azimuth (within -pi..pi) and height.

    z is up and near 0 on the ground below the sensor. Without points: level ground at z = 0.
    """
    rings = math.ceil(config.max_range_m / config.ring_m)
    cells = config.sectors * rings
    low = np.flatnonzero((range_m < config.max_range_m) & (np.abs(z_m) < 0.5 + config.max_slope * range_m))
    turn = azimuth_rad[low] * np.float32(config.sectors / (2.0 * math.pi)) + np.float32(config.sectors)
    if config.slices:  # half of the points tell as much of the ground: those in every other slice of azimuth
        half = np.flatnonzero((turn * np.float32(config.slices)).astype(np.int32) & 1)
        low, turn = low[half], turn[half]
    r, z = range_m[low], z_m[low]
    cell = turn.astype(np.int32) % config.sectors * rings + (r / np.float32(config.ring_m)).astype(np.int32)
    # Sorting 16-bit integers is a radix sort, four times faster than `np.minimum.at`.
    order = np.argsort(cell.astype(np.int16 if cells < 2**15 else np.int64), kind="stable")
    cell, r, z = cell[order], r[order], z[order]
    begin = np.flatnonzero(np.diff(cell, prepend=-1))
    lowest = np.full(cells, np.inf, dtype=np.float32)
    if len(begin):
        lowest[cell[begin]] = np.minimum.reduceat(z, begin)
    above = z - lowest[cell]
    band = above <= np.float32(config.low_band_m)
    near = np.bincount(cell[above <= np.float32(config.step_m)], minlength=cells)
    cell, r, z = cell[band], r[band], z[band]
    count = np.bincount(cell, minlength=cells)
    filled = np.flatnonzero(count)
    data = _Cells(
        sector=filled // rings,
        r=np.bincount(cell, r, minlength=cells)[filled] / count[filled],
        z=np.bincount(cell, z, minlength=cells)[filled] / count[filled],
        weight=np.minimum(count[filled], 8.0) / 8.0,
    )
    height, slope = _fit(data, config)
    flat = np.zeros(cells)
    flat[filled] = data.weight * (count[filled] >= config.flat_share * near[filled])
    off = np.zeros(cells)
    off[filled] = data.z - height[data.sector] - slope[data.sector] * data.r
    flat[np.abs(off) > config.unevenness_m] = 0.0
    added_m = _averaged(off.reshape(-1, rings), flat.reshape(-1, rings))
    return LocalGround(height_m=height, slope=slope, added_m=added_m, ring_m=config.ring_m)


def _averaged(
    off_m: Float64[np.ndarray, "s rings"], weight: Float64[np.ndarray, "s rings"]
) -> Float64[np.ndarray, "s rings"]:
    """Weighted mean of every cell and its eight neighbours, itself four times; pulled to 0 weakly."""
    total, sums = np.zeros_like(off_m), np.zeros_like(off_m)
    for value, into in ((weight, total), (weight * off_m, sums)):
        around = value + 0.5 * (np.roll(value, 1, axis=0) + np.roll(value, -1, axis=0))
        into += 2.0 * around
        into[:, 1:] += around[:, :-1]
        into[:, :-1] += around[:, 1:]
    return sums / (total + 0.5)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cells:
    sector: Int64[np.ndarray, " c"]
    r: Float64[np.ndarray, " c"]
    z: Float64[np.ndarray, " c"]
    weight: Float64[np.ndarray, " c"]


def _fit(
    cells: _Cells, config: LocalGroundConfig
) -> tuple[Float64[np.ndarray, " s"], Float64[np.ndarray, " s"]]:
    """Height and slope of every sector's line."""
    middle = (np.arange(config.sectors) + 0.5) * (2.0 * math.pi / config.sectors)
    direction = np.stack([np.cos(middle), np.sin(middle)])
    height, slope = np.zeros(config.sectors), np.zeros(config.sectors)
    apart = np.abs(np.arange(config.sectors) - np.arange(config.sectors)[:, None])
    apart = np.minimum(apart, config.sectors - apart)
    sharing = np.maximum(1.0 - apart / (config.neighbours + 1.0), 0.0)
    for gate in config.gates_m:
        above = cells.z - (height[cells.sector] + slope[cells.sector] * cells.r)
        weight = cells.weight * ((above <= gate) & (above >= -2.0 * gate))
        plane = _plane(cells, weight, direction)
        height, slope = _lines(cells, weight, plane[0], plane[1:] @ direction, sharing, config.pull)
    return height, slope


def _plane(
    cells: _Cells, weight: Float64[np.ndarray, " c"], direction: Float64[np.ndarray, "2 s"]
) -> Float64[np.ndarray, "3"]:
    """Height and gradient of the plane through the weighted cells, pulled weakly to level."""
    rows = np.stack([np.ones_like(cells.r), *(direction[:, cells.sector] * cells.r)])
    normal = (rows * weight) @ rows.T + np.diag([1e-3, 1.0, 1.0])
    plane: np.ndarray = np.linalg.solve(normal, (rows * weight) @ cells.z)
    return plane


def _lines(
    cells: _Cells,
    weight: Float64[np.ndarray, " c"],
    height0: float,
    slope0: Float64[np.ndarray, " s"],
    sharing: Float64[np.ndarray, "s s"],
    pull: float,
) -> tuple[Float64[np.ndarray, " s"], Float64[np.ndarray, " s"]]:
    """Weighted lines of z over r per sector; the plane's own line counts as `pull` cells at 4 and 12 m."""
    rest = cells.z - height0 - slope0[cells.sector] * cells.r
    weighted = weight * rest
    sums = np.stack(
        [
            np.bincount(cells.sector, values, minlength=len(slope0))
            for values in (weight, weight * cells.r, weight * cells.r**2, weighted, weighted * cells.r)
        ]
    )
    w, wr, wrr, wz, wrz = sums @ sharing
    w, wr, wrr = w + 2.0 * pull, wr + 16.0 * pull, wrr + 160.0 * pull
    det = w * wrr - wr * wr
    slope = (w * wrz - wr * wz) / det
    height = (wz - slope * wr) / w
    return height0 + height, slope0 + slope
