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

from dataclasses import dataclass

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
        return tuple(np.flatnonzero(self.bin_of_point == b) for b in np.flatnonzero(self.is_candidate))


def distance_histogram(
    distance_m: Float[np.ndarray, " k"], *, granularity_m: float, min_points: int, config: ClusteringConfig
) -> DistanceHistogram:
    """Step 3 for the planar distances [k] of one AOI. ValueError unless these are finite, the width positive.

    With fewer than `min_points` points within any one granularity there is no candidate.
    """
    distance_m = np.asarray(distance_m, dtype=np.float64)
    if not np.isfinite(distance_m).all():
        raise ValueError("distance_m holds a number that is not finite")
    if not granularity_m > 0.0:
        raise ValueError(f"granularity_m must be positive, got {granularity_m}")
    ascending = np.sort(distance_m)
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
    edges_m, is_centre = _fill_bins(centres, granularity_m, float(ascending[0]), float(ascending[-1]))
    bin_of_point = np.clip(np.searchsorted(edges_m, distance_m, side="right") - 1, 0, len(is_centre) - 1)
    counts = np.bincount(bin_of_point, minlength=len(is_centre))
    padded = np.concatenate([[0], counts, [0]])
    is_peak = is_centre | ((counts >= padded[:-2]) & (counts >= padded[2:]))
    enough = (counts >= min_points) & (counts >= config.peak_ratio * counts.max())
    return DistanceHistogram(
        edges_m=edges_m,
        counts=counts,
        is_centre=is_centre,
        is_candidate=is_peak & enough,
        bin_of_point=bin_of_point,
    )


def density_centres(
    ascending_m: Float64[np.ndarray, " k"],
    *,
    granularity_m: float,
    min_points: int,
    max_centres: int,
    trimmed: bool,
) -> Float64[np.ndarray, " c"]:
    """Centres of one-dimensional K-means over sorted values, ascending, at least one granularity apart."""
    centres = _densest_windows(ascending_m, granularity_m, min_points, max_centres)
    if len(centres) == 0:
        return centres
    sums = np.concatenate([[0.0], np.cumsum(ascending_m)])
    for _ in range(_ITERATIONS):
        low, high = _shares(ascending_m, centres, 0.5 * granularity_m if trimmed else np.inf)
        filled = high > low
        moved = np.where(filled, (sums[high] - sums[low]) / np.maximum(high - low, 1), centres)
        done = bool(np.abs(moved - centres).max() < 1e-9)
        centres = np.sort(moved)
        if done:
            break
    low, high = _shares(ascending_m, centres, 0.5 * granularity_m)
    kept: list[float] = []
    for index in np.argsort(low - high, kind="stable"):  # the fullest first; bins must not overlap
        if all(abs(centres[index] - other) >= granularity_m for other in kept):
            kept.append(float(centres[index]))
    return np.sort(np.array(kept))


def _shares(
    ascending_m: np.ndarray, centres: np.ndarray, reach_m: float
) -> tuple[Int64[np.ndarray, " c"], Int64[np.ndarray, " c"]]:
    """Per centre the range [low, high) of the sorted values nearest to it and within its reach."""
    middle = 0.5 * (centres[1:] + centres[:-1])
    start, stop = centres - reach_m, centres + reach_m
    np.maximum(start[1:], middle, out=start[1:])
    np.minimum(stop[:-1], middle, out=stop[:-1])
    return ascending_m.searchsorted(start, "left"), ascending_m.searchsorted(stop, "right")


def _densest_windows(
    ascending_m: Float64[np.ndarray, " k"], width_m: float, min_points: int, most: int
) -> Float64[np.ndarray, " c"]:
    """Means of the densest windows (ties: nearest), each sought among the points outside those before it.

    A window is moved to the mean of its points before these are taken away, so that it does not take the
    edge of the next object with it. Returned ascending.
    """
    left, centres = ascending_m, np.zeros(0)
    while len(centres) < most and len(left) >= max(min_points, 1):
        ends = left.searchsorted(left + width_m, side="right")
        start = int((ends - np.arange(len(left))).argmax())
        end = int(ends[start])
        if end - start < min_points:
            break
        sums = np.zeros(len(left) + 1)
        left.cumsum(out=sums[1:])
        centre = float(sums[end] - sums[start]) / (end - start)
        for _ in range(_ITERATIONS):
            start, end = left.searchsorted((centre - 0.5 * width_m, centre + 0.5 * width_m)).tolist()
            moved = float(sums[end] - sums[start]) / (end - start) if end > start else centre
            if abs(moved - centre) < 1e-9:
                break
            centre = moved
        centres = np.append(centres, centre)
        left = np.concatenate([left[:start], left[max(end, start + 1) :]])
    return np.sort(centres)


def _fill_bins(
    centres: Float64[np.ndarray, " c"], width_m: float, nearest_m: float, farthest_m: float
) -> tuple[Float64[np.ndarray, " b1"], Bool[np.ndarray, " b"]]:
    """Edges [b + 1] of bins over all values, and which bins [b] belong to a centre.

    From each centre's bin outward bins of the full width follow; the last one before the next is narrower.
    """
    half = 0.5 * width_m
    before = int(np.ceil(max(centres[0] - half - nearest_m, 0.0) / width_m))
    edges = [float(centres[0] - half) - width_m * i for i in range(before, 0, -1)]
    is_centre = [False] * before
    for index, centre in enumerate(centres):
        edges.append(float(centre - half))
        is_centre.append(True)
        start = float(centre + half)
        if index + 1 < len(centres):
            stop = float(centres[index + 1] - half)
            gap = stop - start
            fill = int(np.ceil(gap / width_m - 1e-9)) if gap > 1e-9 else 0
        else:
            fill = int(np.floor(max(farthest_m - start, 0.0) / width_m)) + 1 if farthest_m >= start else 0
        edges += [start + width_m * i for i in range(fill)]
        is_centre += [False] * fill
    edges.append(float(centres[-1] + half) + width_m * fill)
    return np.array(edges), np.array(is_centre)
