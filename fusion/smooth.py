"""Step 6 of the paper: the trajectory smoother.

The independent variable is time ("X, Y, Z" in the text are the three dependent ones). Per axis, RANSAC fits a
polynomial of order two over the whole track; a sample farther from it than twice the residuals' scale on any
axis is an outlier. Then an order-three polynomial per axis is fitted to the inliers and gives the smoothed
positions, and the positions of frames in which the object was missed. Nothing is extrapolated: the trajectory
runs from the first inlier to the last.

The scale is 1.4826 x the median absolute residual by default, about a model refitted to its own inliers. The
paper's plain standard deviation contains the outliers and rejects nothing once 30 % of the samples are wrong
(`SmootherConfig.paper`). Deviations below `floor_m` are never outliers by default: mapping errors "result in
a distance difference larger than the size of the object" (the paper's assumption 2), whereas the true path
bends away from a parabola by decimetres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from fusion.messages import Trajectory

_REFITS = 10  # at most; it settles after two or three


@dataclass(frozen=True, kw_only=True)
class SmootherConfig:
    """Hyper-parameters of step 6."""

    detect_order: int = 2  # paper
    smooth_order: int = 3  # paper
    threshold_scales: float = 2.0  # paper: twice the standard deviation
    robust_scale: bool = True  # ours; the paper's is plain
    floor_m: float = 0.5  # ours: below a third of the smallest target's length nothing is an outlier; paper 0
    trials: int = 300  # ours: 3 clean samples out of 70 % clean ones are found with certainty
    seed: int = 0

    @staticmethod
    def paper() -> SmootherConfig:
        """Twice the plain standard deviation about the best fit, no floor."""
        return SmootherConfig(robust_scale=False, floor_m=0.0)


def smooth_track(
    *,
    track_id: int,
    stamp_ns: Int64[np.ndarray, " n"],
    position_ego_m: Float64[np.ndarray, "n 3"],
    missing_ns: Int64[np.ndarray, " m"],
    config: SmootherConfig,
) -> Trajectory:
    """Step 6 for one track's samples, in any order, and the stamps at which it was missed.

    Several samples may share a stamp (several cameras): all take part in the fit, the trajectory has that
    stamp once. `inlier` is False where no sample of that stamp was an inlier, or where there was none: that
    position is interpolated.
    With fewer distinct times than a polynomial needs its order is lowered (one time: a constant), and with
    fewer than five no outlier is sought. Without any inlier the trajectory is empty.
    """
    stamp_ns = np.asarray(stamp_ns, dtype=np.int64)
    order = np.argsort(stamp_ns, kind="stable")
    stamp_ns, position_ego_m = stamp_ns[order], np.asarray(position_ego_m, dtype=np.float64)[order]
    if len(stamp_ns) == 0:
        return _trajectory(track_id, stamp_ns, position_ego_m, np.zeros(0, dtype=bool))
    first_ns, last_ns = int(stamp_ns[0]), int(stamp_ns[-1])
    time = _unit_time(stamp_ns, first_ns, last_ns)
    inlier = find_inliers(time, position_ego_m, config)
    kept_ns = stamp_ns[inlier]
    if len(kept_ns) == 0:
        return _trajectory(track_id, kept_ns, position_ego_m[:0], inlier[:0])
    coefficients = _fit(time[inlier], position_ego_m[inlier], config.smooth_order)
    out_ns = np.unique(np.concatenate([stamp_ns, np.asarray(missing_ns, dtype=np.int64)]))
    out_ns = out_ns[(out_ns >= kept_ns[0]) & (out_ns <= kept_ns[-1])]
    smoothed = _evaluate(coefficients, _unit_time(out_ns, first_ns, last_ns))
    return _trajectory(track_id, out_ns, smoothed, np.isin(out_ns, kept_ns))


def find_inliers(
    time: Float64[np.ndarray, " n"], position_m: Float64[np.ndarray, "n 3"], config: SmootherConfig
) -> Bool[np.ndarray, " n"]:
    """Phase one: which samples, ascending in time (scaled to [-1, 1]), follow the polynomials of all axes."""
    times, first_of_time, samples_at_time = np.unique(time, return_index=True, return_counts=True)
    size = config.detect_order + 1
    if len(times) < size + 2:
        return np.ones(len(time), dtype=bool)
    rng = np.random.Generator(np.random.PCG64(config.seed))
    # Distinct times, then one of the samples at each: never a singular system.
    chosen = np.argpartition(rng.random((config.trials, len(times))), size, axis=1)[:, :size]
    picks = first_of_time[chosen] + (rng.random(chosen.shape) * samples_at_time[chosen]).astype(np.int64)
    powers = np.vander(time, size, increasing=True)
    models = np.linalg.solve(powers[picks], position_m[picks])  # [trials, power, axis]
    residuals = position_m - powers @ models  # [trials, n, axis]
    best = np.argmin(_scale(residuals, config), axis=0)
    residual = np.stack([residuals[trial, :, axis] for axis, trial in enumerate(best)], axis=1)
    inlier = np.abs(residual) <= _threshold(residual, config)
    for _ in range(_REFITS if config.robust_scale else 0):
        before = inlier
        for axis in range(position_m.shape[1]):
            near = inlier[:, axis]
            fit = _fit(time[near], position_m[near, axis : axis + 1], config.detect_order)
            residual[:, axis] = position_m[:, axis] - _evaluate(fit, time)[:, 0]
        inlier = np.abs(residual) <= _threshold(residual, config)
        if np.array_equal(inlier, before):
            break
    on_all_axes: np.ndarray = inlier.all(axis=1)
    return on_all_axes


def _scale(residual_m: Float64[np.ndarray, "*t n 3"], config: SmootherConfig) -> Float64[np.ndarray, "*t 3"]:
    """Standard deviation of the residuals about the model, estimated robustly or plainly."""
    scale_m: np.ndarray
    if config.robust_scale:
        scale_m = 1.4826 * np.median(np.abs(residual_m), axis=-2)
    else:
        scale_m = np.sqrt(np.mean(residual_m**2, axis=-2))
    return scale_m


def _threshold(residual_m: Float64[np.ndarray, "n 3"], config: SmootherConfig) -> Float64[np.ndarray, "3"]:
    rounding_m = 1e-9  # an exact fit has no scale, only rounding errors
    floor_m = max(config.floor_m, rounding_m)
    threshold_m: np.ndarray = np.maximum(config.threshold_scales * _scale(residual_m, config), floor_m)
    return threshold_m


def _unit_time(stamp_ns: Int64[np.ndarray, " n"], first_ns: int, last_ns: int) -> Float64[np.ndarray, " n"]:
    """Stamps scaled to [-1, 1] over the track, so that powers of time stay well conditioned."""
    time: np.ndarray = 2.0 * (stamp_ns - first_ns) / max(last_ns - first_ns, 1) - 1.0
    return time


def _fit(
    time: Float64[np.ndarray, " n"], values: Float64[np.ndarray, "n a"], order: int
) -> Float64[np.ndarray, "p a"]:
    """Least-squares polynomials, lowest power first; of lower order with too few distinct times."""
    order = min(order, len(np.unique(time)) - 1)
    powers = np.vander(time, order + 1, increasing=True)
    coefficients: np.ndarray = np.linalg.lstsq(powers, values, rcond=None)[0]
    return coefficients


def _evaluate(
    coefficients: Float64[np.ndarray, "p a"], time: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, "n a"]:
    values: np.ndarray = np.vander(time, len(coefficients), increasing=True) @ coefficients
    return values


def _trajectory(
    track_id: int, stamp_ns: np.ndarray, position_ego_m: np.ndarray, inlier: np.ndarray
) -> Trajectory:
    return Trajectory(track_id=track_id, stamp_ns=stamp_ns, position_ego_m=position_ego_m, inlier=inlier)
