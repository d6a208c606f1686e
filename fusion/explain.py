"""Steps 3 and 4 for one AOI, with everything that a picture of them needs.

`explain_aoi` is what the probabilistic pipeline runs; a report calls the same function (or `explain_scan` of
`fusion/pipelines/probabilistic.py`) and reads the distance histogram, the candidate clusters, their
descriptors and their scores before and after rotation from the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.clustering import ClusteringConfig, DistanceHistogram, distance_histogram
from fusion.messages import BoxPx, Detection
from fusion.shape import (
    ShapeConfig,
    descriptor,
    kl_divergence,
    main_axis,
    select,
    similarity,
    upright,
)
from fusion.timing import StepClock


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """One candidate cluster: its points [m] (indices into the scan), pixels, distances and likeness to S*."""

    points: Int64[np.ndarray, " m"]
    uv_px: Float64[np.ndarray, "m 2"]
    distance_m: Float64[np.ndarray, " m"]
    uv_rotated_px: Float64[np.ndarray, "m 2"]
    rotation_rad: float  # by which the pixels were turned, positive from u to v
    descriptor: Float64[np.ndarray, "9"]  # after rotation
    divergence: float  # D(descriptor || S*), after rotation: what decides
    similarity: float

    @property
    def descriptor_before(self) -> Float64[np.ndarray, "9"]:
        """The descriptor without rotation."""
        return descriptor(self.uv_px)


@dataclass(frozen=True, kw_only=True, eq=False)
class AoiExplanation:
    """What steps 2 to 4 made of one detection.

    points [k]: indices into the scan of what maps into `aoi_px` after step 1; then its pixels and distances.
    chosen: index into `candidates`; None where there is no candidate (then there is no object).
    """

    camera: str
    detection: Detection
    aoi_px: BoxPx
    points: Int64[np.ndarray, " k"]
    uv_px: Float64[np.ndarray, "k 2"]
    distance_m: Float64[np.ndarray, " k"]
    histogram: DistanceHistogram
    benchmark: Float64[np.ndarray, "9"]
    smoothing: float
    candidates: tuple[Candidate, ...]
    chosen: int | None

    def similarity_before(self, candidate: Candidate) -> float:
        """The candidate's similarity to S* without rotation (the first number in the paper's figure)."""
        return similarity(kl_divergence(candidate.descriptor_before, self.benchmark, self.smoothing))


def explain_aoi(
    *,
    camera: str,
    detection: Detection,
    aoi_px: BoxPx,
    points: Int64[np.ndarray, " k"],
    uv_px: Float64[np.ndarray, "k 2"],
    distance_m: Float64[np.ndarray, " k"],
    granularity_m: float,
    min_points: int,
    benchmark: Float64[np.ndarray, "9"],
    clustering: ClusteringConfig,
    shape: ShapeConfig,
    clock: StepClock,
) -> AoiExplanation:
    """Steps 3 and 4 for the points [k] of one AOI. With one candidate the shape decides nothing."""
    with clock("clustering"):
        histogram = distance_histogram(
            distance_m, granularity_m=granularity_m, min_points=min_points, config=clustering
        )
        clusters = histogram.candidates()
    with clock("shape"):
        candidates = tuple(
            _candidate(points[c], uv_px[c], distance_m[c], detection.category, benchmark, shape)
            for c in clusters
        )
        divergences = np.array([c.divergence for c in candidates])
        counts = np.array([len(c) for c in clusters], dtype=np.int64)
        chosen = select(divergences, counts, shape.pick) if candidates else None
    return AoiExplanation(
        camera=camera,
        detection=detection,
        aoi_px=aoi_px,
        points=points,
        uv_px=uv_px,
        distance_m=distance_m,
        histogram=histogram,
        benchmark=benchmark,
        smoothing=shape.smoothing,
        candidates=candidates,
        chosen=chosen,
    )


def _candidate(
    points: np.ndarray,
    uv_px: np.ndarray,
    distance_m: np.ndarray,
    category: str,
    benchmark: np.ndarray,
    config: ShapeConfig,
) -> Candidate:
    rotated, rotation_rad = upright(uv_px, main_axis(category), config.max_rotation_deg)
    cells = descriptor(rotated)
    divergence = kl_divergence(cells, benchmark, config.smoothing)
    return Candidate(
        points=points,
        uv_px=uv_px,
        distance_m=distance_m,
        uv_rotated_px=rotated,
        rotation_rad=rotation_rad,
        descriptor=cells,
        divergence=divergence,
        similarity=similarity(divergence),
    )
