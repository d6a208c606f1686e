"""Which beam each point of a sweep came from, where the file does not say so.

KITTI's sweeps are stored ring by ring, from the uppermost beam down; within a ring the azimuth runs once
around, counter-clockwise from straight ahead, 0 to 360 degrees. So a ring ends where the azimuth falls
(within a ring it falls by 0.03 degrees at most, on three real sweeps). Elevation alone does not do: the sweep
was straightened for the car's motion and the lasers sit apart, so that a ring's elevation varies by up to a
degree, more than the rings are apart.

What is found is believed only if it looks like rings: at least `FEWEST`, and mean elevations that fall from
ring to ring, but for a few. A ring that no point came back from is not counted.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int16

FEWEST, MOST = 4, 256
FALLING = 0.9  # share of the steps from ring to ring
BACK_RAD = np.deg2rad(0.1)
NONE = -1


def rings_of(xyz_m: Float32[np.ndarray, "n 3"]) -> Int16[np.ndarray, " n"] | None:
    """Ring of every point [n], 0 the uppermost; None where the points do not lie ring by ring."""
    if len(xyz_m) == 0:
        return None
    x, y, z = xyz_m.astype(np.float64).T
    azimuth = np.arctan2(y, x) % (2.0 * np.pi)
    ring = np.concatenate([[0], np.cumsum(np.diff(azimuth) < -BACK_RAD)])
    count = int(ring[-1]) + 1
    if not FEWEST <= count <= MOST:
        return None
    elevation = np.bincount(ring, weights=np.arctan2(z, np.hypot(x, y))) / np.bincount(ring)
    if np.mean(np.diff(elevation) < 0.0) < FALLING:
        return None
    return ring.astype(np.int16)
