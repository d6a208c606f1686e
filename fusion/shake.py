"""How much of the measured yaw is the body's shake, and not the turning of its path.

The ego frame of all outputs follows the path and does not shake; the gyro sits on the body and feels both. A
path turns slowly, but a rider who sways turns as fast as a body shakes, so frequency alone does not part
them. Strength does: what shakes in yaw shakes in roll and pitch too, and mostly more. The angles about all
three axes, integrated over the run, are cut into a slow part (a cubic spline with a knot a second) and the
rest. Where the rest of yaw is not larger than `share` of the rest of roll or pitch it is called shake; else
the path itself sways, and nothing is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.interpolate import BSpline

from fusion.odometry import Odometry


@dataclass(frozen=True, kw_only=True)
class ShakeConfig:
    """`knot_s`: slower than about twice this is path. `share`: of yaw, against the larger of the others."""

    knot_s: float = 1.0
    share: float = 0.6
    least_samples: int = 50


def yaw_shake_rad(
    odometry: Odometry, stamp_ns: Int64[np.ndarray, " n"], config: ShakeConfig
) -> Float64[np.ndarray, " n"]:
    """The shake in yaw [n] at the instants [n]; zeros where the yaw is the path's, or too little is known."""
    heard_ns, rate_radps = odometry.gyro()
    if len(heard_ns) < config.least_samples:
        return np.zeros(len(stamp_ns))
    time_s = (heard_ns - heard_ns[0]) * 1e-9
    steps = 0.5 * (rate_radps[1:] + rate_radps[:-1]) * np.diff(time_s)[:, None]
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    rest = angle - _slow(time_s, angle, config.knot_s)
    roll, pitch, yaw = np.sqrt(np.mean(rest**2, axis=0))
    if yaw > config.share * max(roll, pitch):
        return np.zeros(len(stamp_ns))
    return np.interp((stamp_ns - heard_ns[0]) * 1e-9, time_s, rest[:, 2], left=0.0, right=0.0)


def _slow(
    time_s: Float64[np.ndarray, " n"], values: Float64[np.ndarray, "n a"], knot_s: float
) -> Float64[np.ndarray, "n a"]:
    """The least-squares cubic spline with equal knots about `knot_s` apart."""
    spans = max(round(float(time_s[-1]) / knot_s), 1)
    inner = np.linspace(0.0, float(time_s[-1]), spans + 1)
    knots = np.concatenate([np.repeat(inner[0], 3), inner, np.repeat(inner[-1], 3)])
    basis = BSpline.design_matrix(time_s, knots, 3).toarray()
    fitted: np.ndarray = basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    return fitted
