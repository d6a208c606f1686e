"""Step 3 of the paper: mode-based clustering of the distances in an enlarged AOI.

Distances are planar, from the LiDAR. K-means in one dimension (K <= 5) finds the density centres; each
becomes the centre of a bin as wide as the category's granularity, and the gaps are filled with bins of that
width. A bin is a candidate cluster if it is a peak (a density centre's own bin, or no lower than both
neighbours), has the minimum number of points, and at least `peak_ratio` times as many as the fullest bin.

Our readings: K is the number of windows, one granularity wide and taken away densest first, that hold the
minimum number of points, at most 5; they are also where K-means starts, so nothing is random. By default a
centre moves to the mean of *its points within half a granularity*: the plain mean (`trimmed=False`, the
paper's) is dragged by scattered background and then the bin misses half of the object.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

_ITERATIONS = 30


@dataclass(frozen=True, kw_only=True)
class ClusteringConfig:
    """Hyper-parameters of step 3; granularity and minimum number of points belong to the category."""

    max_centres: int = 5  # ours (reading: K <= 5)
    peak_ratio: float = 0.3  # ours; the paper names the parameter, not its value
    trimmed: bool = True  # see the module's text; False in the paper

    @staticmethod
    def paper() -> ClusteringConfig:
        """Plain K-means."""
        return ClusteringConfig(trimmed=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class DistanceHistogram:
    """Bins between ascending `edges_m` [b + 1], empty (one edge) where no density centre was found.

    counts [b]: points in each. is_centre [b]: a density centre's own. is_candidate [b]: a candidate cluster.
    bin_of_point [k]: -1 without bins.
    """

    edges_m: Float64[np.ndarray, " b1"]
    counts: Int64[np.ndarray, " b"]
    is_centre: Bool[np.ndarray, " b"]
    is_candidate: Bool[np.ndarray, " b"]
    bin_of_point: Int64[np.ndarray, " k"]

    def candidates(self) -> tuple[Int64[np.ndarray, " _"], ...]:
        """Indices of the points of each candidate cluster, nearest cluster first."""
        return tuple((self.bin_of_point == b).nonzero()[0] for b in self.is_candidate.nonzero()[0])


def distance_histogram(
    distance_m: Float[np.ndarray, " k"], *, granularity_m: float, min_points: int, config: ClusteringConfig
) -> DistanceHistogram:
    """Step 3 for the planar distances [k] of one AOI. ValueError unless these are finite, the width positive.

    With fewer than `min_points` points within any one granularity there is no candidate.
    """
    if not granularity_m > 0.0:
        raise ValueError(f"granularity_m must be positive, got {granularity_m}")
    distance_m = np.asarray(distance_m, dtype=np.float64)
    ascending = np.sort(distance_m)  # NaN comes last
    if len(ascending) > 0 and not (math.isfinite(ascending[0]) and math.isfinite(ascending[-1])):
        raise ValueError("distance_m holds a number that is not finite")
    centres = density_centres(
        ascending,
        granularity_m=granularity_m,
        min_points=min_points,
        max_centres=config.max_centres,
        trimmed=config.trimmed,
    )
    if len(centres) == 0:
        none = np.zeros(0, dtype=bool)
        return DistanceHistogram(
            edges_m=np.zeros(1),
            counts=np.zeros(0, dtype=np.int64),
            is_centre=none,
            is_candidate=none,
            bin_of_point=np.full(len(distance_m), -1, dtype=np.int64),
        )
    edges, is_centre = _fill_bins(centres, granularity_m, float(ascending[0]), float(ascending[-1]))
    edges_m = np.array(edges)
    bin_of_point = edges_m.searchsorted(distance_m, side="right")
    bin_of_point -= 1
    np.maximum(bin_of_point, 0, out=bin_of_point)
    np.minimum(bin_of_point, len(is_centre) - 1, out=bin_of_point)
    counts = np.bincount(bin_of_point, minlength=len(is_centre))
    return DistanceHistogram(
        edges_m=edges_m,
        counts=counts,
        is_centre=np.array(is_centre),
        is_candidate=np.array(_candidates(counts.tolist(), is_centre, min_points, config.peak_ratio)),
        bin_of_point=bin_of_point,
    )


def _candidates(counts: list[int], is_centre: list[bool], min_points: int, peak_ratio: float) -> list[bool]:
    """Which bins are a peak with enough points."""
    enough = max(float(min_points), peak_ratio * max(counts))
    before, after = [0, *counts[:-1]], [*counts[1:], 0]
    return [
        count >= enough and (centre or (count >= left and count >= right))
        for count, centre, left, right in zip(counts, is_centre, before, after, strict=True)
    ]


def density_centres(
    ascending_m: Float64[np.ndarray, " k"],
    *,
    granularity_m: float,
    min_points: int,
    max_centres: int,
    trimmed: bool,
) -> list[float]:
    """Centres of one-dimensional K-means over sorted values, ascending, at least one granularity apart.

    Plain numbers, because an AOI has a handful of centres: arrays of them would cost ten times as much.
    """
    if len(ascending_m) < max(min_points, 1):
        return []
    values, sums = ascending_m.tolist(), _running_sums(ascending_m)
    centres = _densest_windows(ascending_m, values, sums, granularity_m, min_points, max_centres)
    if not centres:
        return []
    reach_m = 0.5 * granularity_m if trimmed else math.inf
    for _ in range(_ITERATIONS):
        moved = [
            (sums[high] - sums[low]) / (high - low) if high > low else centre
            for centre, (low, high) in zip(centres, _shares(values, centres, reach_m), strict=True)
        ]
        done = max(abs(new - old) for new, old in zip(moved, centres, strict=True)) < 1e-9
        centres = sorted(moved)
        if done:
            break
    shares = _shares(values, centres, 0.5 * granularity_m)
    fullest_first = sorted(range(len(centres)), key=lambda index: shares[index][0] - shares[index][1])
    kept: list[float] = []
    for index in fullest_first:  # bins must not overlap
        if all(abs(centres[index] - other) >= granularity_m for other in kept):
            kept.append(centres[index])
    return sorted(kept)


def _shares(ascending_m: list[float], centres: list[float], reach_m: float) -> list[tuple[int, int]]:
    """Per centre the range [low, high) of the sorted values nearest to it and within its reach."""
    middles = [0.5 * (right + left) for left, right in pairwise(centres)]
    return [
        (
            bisect_left(ascending_m, max(centre - reach_m, left)),
            bisect_right(ascending_m, min(centre + reach_m, right)),
        )
        for centre, left, right in zip(centres, [-math.inf, *middles], [*middles, math.inf], strict=True)
    ]


def _running_sums(values: Float64[np.ndarray, " k"]) -> list[float]:
    """[0, v0, v0 + v1, ...]: the sum of a range is the difference of two of them."""
    return [0.0, *values.cumsum().tolist()]


def _densest_windows(
    ascending_m: Float64[np.ndarray, " k"],
    values: list[float],
    sums: list[float],
    width_m: float,
    min_points: int,
    most: int,
) -> list[float]:
    """Means of the densest windows (ties: nearest), each sought among the points outside those before it.

    A window is moved to the mean of its points before these are taken away, so that it does not take the
    edge of the next object with it. Returned ascending. `values`, `sums`: `ascending_m` and its running sums.
    """
    left, centres = ascending_m, list[float]()
    while len(centres) < most and len(left) >= max(min_points, 1):
        within = left.searchsorted(left + width_m, side="right")
        within -= np.arange(len(left))
        start = int(within.argmax())
        end = start + int(within[start])
        if end - start < min_points:
            break
        if left is not ascending_m:
            values, sums = left.tolist(), _running_sums(left)
        centre = (sums[end] - sums[start]) / (end - start)
        for _ in range(_ITERATIONS):
            start = bisect_left(values, centre - 0.5 * width_m)
            end = bisect_left(values, centre + 0.5 * width_m)
            moved = (sums[end] - sums[start]) / (end - start) if end > start else centre
            if abs(moved - centre) < 1e-9:
                break
            centre = moved
        centres.append(centre)
        left = np.concatenate([left[:start], left[max(end, start + 1) :]])
    return sorted(centres)


def _fill_bins(
    centres: list[float], width_m: float, nearest_m: float, farthest_m: float
) -> tuple[list[float], list[bool]]:
    """Edges [b + 1] of bins over all values, and which bins [b] belong to a centre.

    From each centre's bin outward bins of the full width follow; the last one before the next is narrower.
    """
    half = 0.5 * width_m
    before = math.ceil(max(centres[0] - half - nearest_m, 0.0) / width_m)
    edges = [centres[0] - half - width_m * i for i in range(before, 0, -1)]
    is_centre = [False] * before
    for index, centre in enumerate(centres):
        edges.append(centre - half)
        is_centre.append(True)
        start = centre + half
        if index + 1 < len(centres):
            gap = centres[index + 1] - half - start
            fill = math.ceil(gap / width_m - 1e-9) if gap > 1e-9 else 0
        else:
            fill = math.floor((farthest_m - start) / width_m) + 1 if farthest_m >= start else 0
        edges += [start + width_m * i for i in range(fill)]
        is_centre += [False] * fill
    edges.append(centres[-1] + half + width_m * fill)
    return edges, is_centre
