"""Rival: DBSCAN (Ester et al., KDD 1996) over the points in the box's frustum, the largest cluster wins.

The points of the box without ground are clustered in space. Their neighbourhood grows with the range, because
the gap between two rings of the LiDAR does: the radius is `eps_m`, or `eps_per_range` times the range where
that is more. The cluster with the most points is the object; of two that are as large the nearer, by its
nearest point. That choice, like the numbers below, is ours: the recipe is common, its details are not.

A dense box is thinned first: points in one cube of side `cell_m` stand at their centroid and count as many.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from fusion.euclidean import dbscan, voxels
from fusion.pipelines.within_box import BoxPoints, RivalConfig, WithinBox


@dataclass(frozen=True, kw_only=True)
class FrustumDbscanConfig(RivalConfig):
    """Radius and density of DBSCAN."""

    eps_m: float = 0.5  # ours: less than the room between two people
    eps_per_range: float = 0.04  # ours: rings 2 degrees apart (a VLP-16) are neighbours
    min_points: int = 5  # ours
    cell_m: float = 0.1  # ours: a fifth of eps_m


class FrustumDbscan(WithinBox):
    """The largest cluster of the frustum; none where all is noise."""

    def __init__(self, config: FrustumDbscanConfig | None = None) -> None:
        self.config = FrustumDbscanConfig() if config is None else config
        super().__init__(self.config)

    def select(self, inside: BoxPoints) -> Bool[np.ndarray, " k"]:
        """See the module's text."""
        config, xyz_m = self.config, inside.xyz_lidar_m
        if len(xyz_m) < config.min_points:  # all noise
            return np.zeros(len(xyz_m), dtype=bool)
        cells = voxels(xyz_m, config.cell_m)
        eps_m = np.maximum(config.eps_m, config.eps_per_range * np.linalg.norm(cells.centroid_m, axis=1))
        label = dbscan(cells.centroid_m, cells.count, eps_m, config.min_points)[cells.cell_of_point]
        clustered = label >= 0
        if not clustered.any():
            return clustered
        count = np.bincount(label[clustered])
        nearest_m = np.full(len(count), np.inf)
        np.minimum.at(nearest_m, label[clustered], np.linalg.norm(xyz_m[clustered], axis=1))
        return label == np.lexsort((nearest_m, -count))[0]
