"""Step 5 of the paper: distance and angle of an object from the points that were selected for it.

The distance is planar ("including z-dimension might overestimate the distance"), the angle is the azimuth,
both in the LiDAR's frame. `median` takes one real point, the one at the middle rank of the planar distance,
which is right as long as more than half of the points are the object's; `mean` averages all points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64, Int64

from fusion.geometry import Transform
from fusion.messages import Detection, LidarScan, LocalizedObject

Representative = Literal["median", "mean"]


@dataclass(frozen=True, kw_only=True)
class LocalizeConfig:
    """Hyper-parameters of step 5."""

    representative: Representative = "median"  # paper


def planar_distance_m(xyz_m: Float32[np.ndarray, "k 3"]) -> Float64[np.ndarray, " k"]:
    """Distance of points [k 3] from the z axis."""
    return np.hypot(xyz_m[:, 0].astype(np.float64), xyz_m[:, 1].astype(np.float64))


def median_point(xyz_m: Float32[np.ndarray, "k 3"]) -> int:
    """Index of the point at the middle rank of planar distance (of two middle ranks the nearer).

    The points [k 3], k >= 1, are finite. Equal distances are ordered by x, then y, then z, so that the order
    of the points decides nothing.
    """
    distance_m = planar_distance_m(xyz_m)
    rank = (len(distance_m) - 1) // 2
    middle_m = np.partition(distance_m, rank)[rank]
    equal = (distance_m == middle_m).nonzero()[0]
    if len(equal) == 1:
        return int(equal[0])
    x, y, z = xyz_m[equal].T
    nearer = int(np.count_nonzero(distance_m < middle_m))
    return int(equal[np.lexsort((z, y, x))[rank - nearer]])


def localize(
    scan: LidarScan,
    points: Int64[np.ndarray, " k"],
    *,
    detection: Detection,
    camera: str,
    T_ego_lidar: Transform,
    confidence: float,
    config: LocalizeConfig,
) -> LocalizedObject:
    """The object that a detection of a camera is, given its points [k], k >= 1, of the scan.

    Its stamp is the firing time of the representative point (for `mean`: the mean firing time).
    """
    if len(points) == 0:
        raise ValueError("an object needs at least one point")
    xyz_m, offset_ns = scan.xyz_m[points], scan.offset_ns[points]
    if config.representative == "median":
        index = median_point(xyz_m)
        position_lidar_m, offset = xyz_m[index].astype(np.float64), int(offset_ns[index])
    else:
        position_lidar_m, offset = xyz_m.mean(axis=0, dtype=np.float64), round(float(offset_ns.mean()))
    x, y = float(position_lidar_m[0]), float(position_lidar_m[1])
    return LocalizedObject(
        track_id=detection.track_id,
        category=detection.category,
        sensor=camera,
        stamp_ns=scan.stamp_ns + offset,
        points=points,
        position_ego_m=T_ego_lidar.apply(position_lidar_m),
        distance_m=math.hypot(x, y),
        azimuth_rad=math.atan2(y, x),
        confidence=confidence,
    )
