"""Constant velocity with white acceleration: the Kalman filter forward, Rauch-Tung-Striebel backward.

Per axis the state is (position, velocity); over a step dt

    F = [1 dt; 0 1],    Q = q [dt^3/3 dt^2/2; dt^2/2 dt],    H = [1 0],

q being the density of the acceleration noise [m^2/s^3]. All axes share noise and times, so they share one
covariance [2 2] and the state is a matrix [2 axes]. RTS as in Rauch, Tung, Striebel (AIAA J. 1965); on linear
Gaussian data it is the batch least-squares solution (tested).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64


@dataclass(frozen=True, kw_only=True)
class KalmanConfig:
    """`acceleration`: q [m^2/s^3]. `speed_sd_mps`: spread of an unknown object's velocity."""

    acceleration: float = 4.0
    speed_sd_mps: float = 12.0
    outlier_sds: float = 3.0  # where a robust smoother starts to believe a sample less (Huber)
    powers: tuple[float, ...] = (0.5, 1.0, 2.0, 2.0)  # of the robust smoother, round by round
    start_neighbours: int = 6
    start_gate_m: float = 0.7


@dataclass(frozen=True, kw_only=True, eq=False)
class Belief:
    """State [2 axes] (positions; velocities), its covariance [2 2] (the same for every axis), its instant."""

    stamp_ns: int
    state: Float64[np.ndarray, "2 a"]
    covariance: Float64[np.ndarray, "2 2"]

    @property
    def position_m(self) -> Float64[np.ndarray, " a"]:
        return self.state[0]

    @property
    def velocity_mps(self) -> Float64[np.ndarray, " a"]:
        return self.state[1]


def start(stamp_ns: int, position_m: Float64[np.ndarray, " a"], sd_m: float, config: KalmanConfig) -> Belief:
    """What one position [a] tells: nothing of the velocity."""
    state = np.stack([position_m, np.zeros_like(position_m)])
    return Belief(stamp_ns=stamp_ns, state=state, covariance=np.diag([sd_m**2, config.speed_sd_mps**2]))


def predict(belief: Belief, stamp_ns: int, config: KalmanConfig) -> Belief:
    """The belief at another instant (an earlier one too: the noise grows with the time between)."""
    transition, noise = _step((stamp_ns - belief.stamp_ns) * 1e-9, config)
    return Belief(
        stamp_ns=stamp_ns,
        state=transition @ belief.state,
        covariance=transition @ belief.covariance @ transition.T + noise,
    )


def correct(belief: Belief, position_m: Float64[np.ndarray, " a"], sd_m: float) -> Belief:
    """The belief after a position [a] measured at its instant with `sd_m` on every axis."""
    gain = belief.covariance[:, 0] / (belief.covariance[0, 0] + sd_m**2)
    keep = np.eye(2) - np.outer(gain, [1.0, 0.0])
    return Belief(
        stamp_ns=belief.stamp_ns,
        state=belief.state + np.outer(gain, position_m - belief.state[0]),
        covariance=keep @ belief.covariance @ keep.T + np.outer(gain, gain) * sd_m**2,  # Joseph: symmetric
    )


def smooth(
    stamp_ns: Int64[np.ndarray, " n"],
    position_m: Float64[np.ndarray, "n a"],
    sd_m: Float64[np.ndarray, " n"],
    config: KalmanConfig,
) -> tuple[Float64[np.ndarray, "n 2 a"], Float64[np.ndarray, "n 2 2"]]:
    """States and covariances at ascending stamps [n], n >= 1, given all positions; `sd_m` inf: none there.

    The first position must be finite; its `sd_m` too.
    """
    beliefs = [start(int(stamp_ns[0]), position_m[0], float(sd_m[0]), config)]
    predicted = [beliefs[0]]
    for at_ns, where_m, sd in zip(stamp_ns[1:], position_m[1:], sd_m[1:], strict=True):
        predicted.append(predict(beliefs[-1], int(at_ns), config))
        beliefs.append(correct(predicted[-1], where_m, float(sd)) if np.isfinite(sd) else predicted[-1])
    states, covariances = [beliefs[-1].state], [beliefs[-1].covariance]
    for here, ahead in zip(beliefs[-2::-1], predicted[:0:-1], strict=True):
        transition, _ = _step((ahead.stamp_ns - here.stamp_ns) * 1e-9, config)
        gain = here.covariance @ transition.T @ np.linalg.inv(ahead.covariance)
        states.append(here.state + gain @ (states[-1] - ahead.state))
        covariances.append(here.covariance + gain @ (covariances[-1] - ahead.covariance) @ gain.T)
    return np.stack(states[::-1]), np.stack(covariances[::-1])


def smooth_robustly(
    stamp_ns: Int64[np.ndarray, " n"],
    position_m: Float64[np.ndarray, "n a"],
    sd_m: Float64[np.ndarray, " n"],
    config: KalmanConfig,
) -> tuple[Float64[np.ndarray, "n 2 a"], Float64[np.ndarray, " n"]]:
    """`smooth` with robust weights: states, and by what factor each sample's SD was raised (1: believed).

    It starts from lines through each sample's neighbours that half of them being wrong does not move
    (`local_lines`): what is farther from its line than `start_gate_m` hardly counts at first. Then, a few
    times, a sample at d > 1 times `outlier_sds` SDs from the smooth path gets its SD raised by a power of d.
    """
    known = np.flatnonzero(np.isfinite(sd_m))
    lines_m = local_lines(stamp_ns[known], position_m[known], config.start_neighbours)
    off = np.zeros(len(stamp_ns))
    off[known] = np.linalg.norm(position_m[known] - lines_m, axis=1) / config.start_gate_m
    factor = np.maximum(off, 1.0) ** 4
    states, _ = smooth(stamp_ns, position_m, sd_m * factor, config)
    for power in config.powers:
        off[known] = np.linalg.norm(position_m[known] - states[known, 0], axis=1) / sd_m[known]
        factor = np.maximum(off / config.outlier_sds, 1.0) ** power
        states, _ = smooth(stamp_ns, position_m, sd_m * factor, config)
    return states, factor


def local_lines(
    stamp_ns: Int64[np.ndarray, " n"], position_m: Float64[np.ndarray, "n a"], neighbours: int
) -> Float64[np.ndarray, "n a"]:
    """For every sample the place, at its instant, of a line in time through it and its neighbours.

    Siegel's repeated medians (Biometrika 1982), over a window of up to 2 x `neighbours` + 1 samples that is
    moved inwards at the ends. Fewer than three samples are their own lines. Stamps must differ.
    """
    count = len(stamp_ns)
    if count < 3:
        return position_m.copy()
    width = min(2 * neighbours + 1, count)
    first = np.clip(np.arange(count) - neighbours, 0, count - width)
    rows = first[:, None] + np.arange(width)
    time_s = (stamp_ns[rows] - stamp_ns[:, None]) * 1e-9  # [n w], 0 at the sample itself
    places = position_m[rows]  # [n w a]
    dt = time_s[:, :, None] - time_s[:, None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = (places[:, :, None] - places[:, None, :]) / dt[..., None]  # NaN against itself
    slope = np.median(np.nanmedian(slopes, axis=2), axis=1)
    line: np.ndarray = np.median(places - slope[:, None] * time_s[..., None], axis=1)
    return line


def _step(dt_s: float, config: KalmanConfig) -> tuple[Float64[np.ndarray, "2 2"], Float64[np.ndarray, "2 2"]]:
    transition = np.array([[1.0, dt_s], [0.0, 1.0]])
    dt = abs(dt_s)
    cross = 0.5 * dt * dt_s
    noise = config.acceleration * np.array([[dt**3 / 3.0, cross], [cross, dt]])
    return transition, noise
