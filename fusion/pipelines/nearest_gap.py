"""Rival: the nearest cluster by range, as in Autoware's `roi_pointcloud_fusion` (there `closest_cluster`).

The points of the box without ground are sorted by their planar distance from the camera. Going outwards from
the nearest one, a cluster ends where the next distance is `tolerance_m` or more farther; the first cluster of
at least `min_points` is the object.

Values: Autoware's `roi_pointcloud_fusion.param.yaml`. Not taken over: the upper limits (20 points, 2 m: there
the node is for small unknown objects in thinned clouds), and that the points of clusters passed over as too
small still count, so that two lone returns in front of an object end the search with nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from fusion.pipelines.within_box import BoxPoints, RivalConfig, WithinBox


@dataclass(frozen=True, kw_only=True)
class NearestGapConfig(RivalConfig):
    """When a cluster ends, and which one counts."""

    tolerance_m: float = 0.5  # Autoware: cluster_2d_tolerance
    min_points: int = 2  # Autoware: min_cluster_size


class NearestGap(WithinBox):
    """The points from the nearest return to the first gap in range."""

    def __init__(self, config: NearestGapConfig | None = None) -> None:
        self.config = NearestGapConfig() if config is None else config
        super().__init__(self.config)

    def select(self, inside: BoxPoints) -> Bool[np.ndarray, " k"]:
        """See the module's text."""
        chosen = np.zeros(len(inside.xyz_lidar_m), dtype=bool)
        x, y = (inside.xyz_lidar_m[:, :2].astype(np.float64) - inside.camera_lidar_m[:2]).T
        distance_m = np.hypot(x, y)
        outwards = np.argsort(distance_m, kind="stable")
        ends = np.flatnonzero(np.diff(distance_m[outwards]) >= self.config.tolerance_m) + 1
        for cluster in np.split(outwards, ends):
            if len(cluster) >= self.config.min_points:
                chosen[cluster] = True
                break
        return chosen
