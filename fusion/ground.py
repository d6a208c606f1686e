"""Step 1 of the paper: RANSAC-based preprocessing. Keep the points near the ego, then drop the ground plane.

A region of 70 m by 30 m, centred on the ego, is kept ("points that exceed the limit are removed directly").
A plane n.x + d = 0 is fitted to 6 random points N times, where (the paper's equation)

    N = ln(1 - p) / ln(1 - (1 - e)^n),    p = 0.99, e = 0.2, n = 6  ->  N = 16,

its normal n within 15 degrees of up; points within 0.2 m of it, on either side, are ground. The paper accepts
a plane only with P = (1 - e) S points on it, S being "the total number of 3D LiDAR points": we read 80 % of
those in the region, since the others are gone by then. In most frames the ground has less than that, so the
rule taken literally (`literal_acceptance`) removes nothing there. By default 80 % only ends the search early:
e is measured from the best plane so far and N follows from the same equation (Hartley and Zisserman, Multiple
View Geometry, algorithm 4.5), and the best plane is used after a least-squares fit to its own inliers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64

from fusion.geometry import Transform


@dataclass(frozen=True, kw_only=True)
class GroundConfig:
    """Hyper-parameters of step 1."""

    length_m: float = 70.0  # paper, step 1 of its list; along x of the ego
    width_m: float = 30.0  # paper; along y of the ego
    distance_m: float = 0.2  # paper: delta, point to plane; two-sided is our reading
    sample_size: int = 6  # paper: n
    confidence: float = 0.99  # paper: p
    outlier_share: float = 0.2  # paper: epsilon
    max_tilt_deg: float = 15.0  # ours: the paper says "generally upward"
    literal_acceptance: bool = False  # paper: True; see the module's text
    max_trials: int = 256  # ours: enough for a ground share of 0.51; the refits help below
    refits: int = 2  # ours: least squares on the inliers of the best plane; 0 in the paper
    scored_points: int = 1024  # ours: planes are compared on a random sample of this size
    seed: int = 0  # of the generator; every scan starts from it, so a scan's result is its own

    @staticmethod
    def paper() -> GroundConfig:
        """As printed: 16 trials, 80 % or nothing, no refinement, every point counted."""
        return GroundConfig(literal_acceptance=True, max_trials=16, refits=0, scored_points=0)


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundPlane:
    """Unit normal [3] (upward) and offset [m] in the LiDAR frame: ground where |n.x + offset| <= distance."""

    normal_lidar: Float64[np.ndarray, "3"]
    offset_m: float
    inlier_share: float  # of the points in the region, measured on those that were scored


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundRemoval:
    """`keep` [n]: in the region and not ground. `plane` is None where no plane was acceptable."""

    keep: Bool[np.ndarray, " n"]
    in_region: Bool[np.ndarray, " n"]
    plane: GroundPlane | None
    trials: int


def ransac_trials(confidence: float, outlier_share: float, sample_size: int) -> float:
    """The paper's N, before rounding up; infinite where no sample can be free of outliers."""
    clean = (1.0 - outlier_share) ** sample_size
    if clean >= 1.0:
        return 1.0
    return math.log(1.0 - confidence) / math.log1p(-clean) if clean > 0.0 else math.inf


def remove_ground(
    xyz_m: Float32[np.ndarray, "n 3"], T_ego_lidar: Transform, config: GroundConfig
) -> GroundRemoval:
    """Step 1 for a scan [n 3] in the LiDAR frame. Points that are not finite are never kept."""
    xyz = np.ascontiguousarray(xyz_m.T, dtype=np.float32)  # [3 n]: rows are contiguous, three times faster
    with np.errstate(invalid="ignore", over="ignore"):
        xyz = T_ego_lidar.rotation.astype(np.float32) @ xyz  # now in the ego frame
        xyz += T_ego_lidar.translation_m.astype(np.float32)[:, None]
        in_region = np.abs(xyz[0]) <= 0.5 * config.length_m
        in_region &= np.abs(xyz[1]) <= 0.5 * config.width_m
        in_region &= np.isfinite(xyz[2])
    near = np.flatnonzero(in_region)
    xyz = xyz.take(near, axis=1)
    rng = np.random.Generator(np.random.PCG64(config.seed))
    plane, share, trials = _find_plane(xyz, config, rng)
    if plane is None:
        return GroundRemoval(keep=in_region, in_region=in_region, plane=None, trials=trials)
    keep = in_region.copy()
    keep[near[_distances_m(plane[:, None], xyz)[0] <= config.distance_m]] = False
    normal_ego = np.array([-plane[0], -plane[1], 1.0]) / math.hypot(plane[0], plane[1], 1.0)
    found = GroundPlane(
        normal_lidar=T_ego_lidar.rotation.T @ normal_ego,
        offset_m=float(normal_ego @ (T_ego_lidar.translation_m - np.array([0.0, 0.0, plane[2]]))),
        inlier_share=share,
    )
    return GroundRemoval(keep=keep, in_region=in_region, plane=found, trials=trials)


def _find_plane(
    xyz_ego_m: Float32[np.ndarray, "3 n"], config: GroundConfig, rng: np.random.Generator
) -> tuple[Float64[np.ndarray, "3"] | None, float, int]:
    """The best of the trials, its share of inliers among the scored points, and how many trials there were.

    A plane is (a, b, c) of z = a x + b y + c: it must be near level, so the fit may be along z.
    """
    count = xyz_ego_m.shape[1]
    if count < config.sample_size:
        return None, 0.0, 0
    scored = xyz_ego_m
    if 0 < config.scored_points < count:
        scored = xyz_ego_m[:, rng.integers(count, size=config.scored_points)]
    accepted = 1.0 - config.outlier_share
    max_slope = math.tan(math.radians(config.max_tilt_deg))
    batch = math.ceil(ransac_trials(config.confidence, config.outlier_share, config.sample_size))
    best, best_share, trials = None, 0.0, 0
    while True:
        batch = min(batch, config.max_trials - trials)
        planes = _fit_planes(xyz_ego_m[:, rng.integers(count, size=(config.sample_size, batch))])
        planes = planes[:, np.hypot(planes[0], planes[1]) <= max_slope]  # False for NaN
        trials += batch
        if planes.shape[1] > 0:
            shares = np.mean(_distances_m(planes, scored) <= config.distance_m, axis=1)
            enough = np.flatnonzero(shares >= accepted)  # "acceptable": the first such plane ends the search
            winner = int(enough[0]) if len(enough) else int(np.argmax(shares))
            if shares[winner] > best_share:
                best, best_share = planes[:, winner], float(shares[winner])
        needed = ransac_trials(config.confidence, 1.0 - best_share, config.sample_size)
        if best_share >= accepted or trials >= min(needed, config.max_trials):
            break
        batch = trials  # double the number of trials
    if best is None or (config.literal_acceptance and best_share < accepted):
        return None, best_share, trials
    for _ in range(config.refits):
        ground = scored[:, _distances_m(best[:, None], scored)[0] <= config.distance_m]
        refitted = _fit_planes(ground[:, :, None])[:, 0]
        if not math.hypot(refitted[0], refitted[1]) <= max_slope:  # True for NaN: fewer than three points
            break
        best = refitted
    return best, float(np.mean(_distances_m(best[:, None], scored)[0] <= config.distance_m)), trials


def _distances_m(
    planes: Float64[np.ndarray, "3 t"], xyz_m: Float32[np.ndarray, "3 n"]
) -> Float32[np.ndarray, "t n"]:
    """Distance of every point from every plane, in float32 (1e-5 m at 50 m)."""
    a, b, c = planes
    steepness = np.sqrt(1.0 + a * a + b * b)
    rows = np.stack([-a, -b, np.ones_like(a)], axis=1) / steepness[:, None]
    signed: np.ndarray = rows.astype(np.float32) @ xyz_m - (c / steepness).astype(np.float32)[:, None]
    np.abs(signed, out=signed)
    return signed


def _fit_planes(xyz_m: Float32[np.ndarray, "3 k t"]) -> Float64[np.ndarray, "3 t"]:
    """Least-squares z = a x + b y + c for t sets of k points; NaN where the points do not span a plane."""
    points = xyz_m.astype(np.float64)
    centre = points.mean(axis=1, keepdims=True)
    x, y, z = points - centre
    xx, xy, yy = (x * x).sum(axis=0), (x * y).sum(axis=0), (y * y).sum(axis=0)
    xz, yz = (x * z).sum(axis=0), (y * z).sum(axis=0)
    det = xx * yy - xy * xy
    with np.errstate(divide="ignore", invalid="ignore"):
        det = np.where(det > 1e-9 * xx * yy, det, np.nan)
        a, b = (yy * xz - xy * yz) / det, (xx * yz - xy * xz) / det
    x0, y0, z0 = centre[:, 0]
    return np.stack([a, b, z0 - a * x0 - b * y0])
