"""Messages made from what a test cares about."""

from __future__ import annotations

import numpy as np

from fusion.messages import LidarScan


def lidar_scan(
    xyz_m: object = (),
    *,
    seq: int = 0,
    stamp_ns: int = 0,
    sensor: str = "lidar",
    offset_ns: object | None = None,
) -> LidarScan:
    """A scan of points [n 3]; point i is fired 10 i ns after the stamp unless told otherwise."""
    xyz = np.asarray(xyz_m, dtype=np.float32).reshape(-1, 3)
    count = len(xyz)
    offsets = 10 * np.arange(count) if offset_ns is None else offset_ns
    return LidarScan(
        sensor=sensor,
        seq=seq,
        stamp_ns=stamp_ns,
        arrival_ns=stamp_ns + 108_000_000,
        xyz_m=xyz,
        intensity=np.zeros(count, dtype=np.float32),
        offset_ns=np.asarray(offsets, dtype=np.int32),
        ring=np.zeros(count, dtype=np.int16),
    )
