"""Clusters of points in space: Euclidean clusters, DBSCAN, and the voxel grid that thins a cloud for them.

Both may work on a grid's cells instead of the points: a cell stands for its points by their centroid and
their number. Nothing is random.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64
from scipy.spatial import cKDTree


@dataclass(frozen=True, kw_only=True, eq=False)
class Voxels:
    """The filled cells of a grid: each point's cell; each cell's centroid and number of points."""

    cell_of_point: Int64[np.ndarray, " n"]
    centroid_m: Float64[np.ndarray, "m d"]
    count: Int64[np.ndarray, " m"]


def voxels(xyz_m: Float[np.ndarray, "n d"], size_m: float) -> Voxels:
    """The cells, cubes of side `size_m` (squares for d = 2), that hold the finite points [n d].

    Cells are ordered by place, so the order of the points does not matter. ValueError: size not above 0.
    """
    if not size_m > 0.0:
        raise ValueError(f"size_m must be positive, got {size_m}")
    points = np.asarray(xyz_m, dtype=np.float64)
    cells = np.floor(points.T / size_m)
    order = np.lexsort(cells)
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = np.any(np.diff(cells[:, order], axis=1) != 0.0, axis=0)
    starts = np.flatnonzero(is_new)
    cell_of_point = np.empty(len(points), dtype=np.int64)
    cell_of_point[order] = np.cumsum(is_new) - 1
    count = np.bincount(cell_of_point, minlength=len(starts))
    if len(starts) == 0:
        return Voxels(cell_of_point=cell_of_point, centroid_m=points, count=count)
    centroid_m = np.add.reduceat(points[order], starts, axis=0) / count[:, None]
    return Voxels(cell_of_point=cell_of_point, centroid_m=centroid_m, count=count)


def euclidean_clusters(xyz_m: Float64[np.ndarray, "m d"], tolerance_m: float) -> Int64[np.ndarray, " m"]:
    """Label [m] of each finite point [m d]: two points share one if steps of at most the tolerance join them.

    What `pcl::EuclideanClusterExtraction` finds (Rusu, Semantic 3D object maps, 2009).
    """
    near = _pairs(xyz_m, tolerance_m)
    return _components(len(xyz_m), near)


def dbscan(
    xyz_m: Float64[np.ndarray, "m d"],
    weight: Int64[np.ndarray, " m"],
    eps_m: Float64[np.ndarray, " m"],
    min_points: int,
) -> Int64[np.ndarray, " m"]:
    """DBSCAN (Ester et al., KDD 1996): label [m] of each finite point [m d], -1 for noise.

    Two points are neighbours if their distance is at most the smaller of their `eps_m` [m]. A point is a core
    point if it and its neighbours weigh `min_points` or more; a point of weight w counts as w points. Core
    points that are neighbours share a cluster. Another point joins its nearest core neighbour (the paper:
    whichever comes first); one without is noise.
    """
    if len(xyz_m) == 0:
        return np.zeros(0, dtype=np.int64)
    near = _pairs(xyz_m, float(eps_m.max()))
    length_m = np.linalg.norm(xyz_m[near[:, 0]] - xyz_m[near[:, 1]], axis=1)
    linked = length_m <= np.minimum(eps_m[near[:, 0]], eps_m[near[:, 1]])
    near, length_m = near[linked], length_m[linked]
    total = weight + np.bincount(near[:, 0], weight[near[:, 1]], minlength=len(xyz_m))
    total += np.bincount(near[:, 1], weight[near[:, 0]], minlength=len(xyz_m))
    core = total >= min_points
    labels = np.full(len(xyz_m), -1, dtype=np.int64)
    number = np.cumsum(core) - 1  # of each core point among the core points
    labels[core] = _components(int(core.sum()), number[near[core[near].all(axis=1)]])
    _join_border(labels, core, near, length_m)
    return labels


def _join_border(
    labels: Int64[np.ndarray, " m"],
    core: Bool[np.ndarray, " m"],
    near: Int64[np.ndarray, "p 2"],
    length_m: Float64[np.ndarray, " p"],
) -> None:
    """Give every point with a core neighbour, itself no core point, the label of the nearest."""
    edges, lengths = np.concatenate([near, near[:, ::-1]]), np.concatenate([length_m, length_m])
    joins = ~core[edges[:, 0]] & core[edges[:, 1]]
    edges, lengths = edges[joins], lengths[joins]
    far_first = np.lexsort((edges[:, 1], -lengths))  # the last assignment stays
    labels[edges[far_first, 0]] = labels[edges[far_first, 1]]


def _pairs(xyz_m: Float64[np.ndarray, "m d"], reach_m: float) -> Int64[np.ndarray, "p 2"]:
    """Every pair of points within reach, once."""
    if len(xyz_m) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    found: np.ndarray = cKDTree(xyz_m).query_pairs(reach_m, output_type="ndarray")
    return found.astype(np.int64, copy=False)


def _components(count: int, edges: Int64[np.ndarray, "p 2"]) -> Int64[np.ndarray, " m"]:
    """The connected component of each of `count` nodes, numbered in the order of their first nodes.

    Every component points at its lowest neighbour at once, then every node at its component's first node
    (Shiloach and Vishkin, 1982), until no edge joins two components: a few rounds. For the small graphs of a
    box this takes half of the time that a sparse matrix takes to be made.
    """
    first = np.arange(count)
    left, right = np.ascontiguousarray(edges.T)
    while True:
        a, b = first[left], first[right]
        apart = a != b
        if not apart.any():
            return np.unique(first, return_inverse=True)[1].astype(np.int64)
        left, right, a, b = left[apart], right[apart], a[apart], b[apart]
        np.minimum.at(first, np.maximum(a, b), np.minimum(a, b))
        while not np.array_equal(further := first[first], first):
            first = further
