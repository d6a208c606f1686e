"""Where the ego was at any instant of the last seconds, from measured motion: dead reckoning in the plane.

The speed (odometer) and the yaw rate (gyro) of `EgoMotion` are held piecewise constant and integrated at the
mean heading of each step. The odometry frame is the ego frame at the first message's stamp; it drifts, but
what is related to each other here lies a second apart. Roll and pitch are left out: level ground is found by
`local_ground.py` in every sector of the sweep.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, Int64

from fusion.messages import EgoMotion

_CAPACITY = 512  # samples at first; doubled when full


class Odometry:
    """Integrates ego motion as it comes; `yaw_rad` turns its vectors into the frame that is worked in."""

    def __init__(self, frame_yaw_rad: float = 0.0) -> None:
        c, s = np.cos(frame_yaw_rad), np.sin(frame_yaw_rad)
        self._frame_ego = np.array([[c, s], [-s, c]])
        self._stamp_ns = np.zeros(_CAPACITY, dtype=np.int64)
        self._pose = np.zeros((_CAPACITY, 3))  # x, y, yaw at the stamp
        self._rate = np.zeros((_CAPACITY, 3))  # of x, y (own axes), yaw from the stamp on
        self._gyro_radps = np.zeros((_CAPACITY, 3))
        self._count = 0

    def add(self, motion: EgoMotion) -> None:
        """Take one message. Left out: what is not finite, and what is not newer than the last."""
        rate = np.append(self._frame_ego @ motion.velocity_mps[:2], motion.rate_radps[2])
        if not (np.isfinite(rate).all() and np.isfinite(motion.rate_radps).all()):
            return
        n = self._count
        if n and motion.stamp_ns <= self._stamp_ns[n - 1]:
            return
        if n == len(self._stamp_ns):
            self._stamp_ns = np.concatenate([self._stamp_ns, np.zeros_like(self._stamp_ns)])
            self._pose = np.concatenate([self._pose, np.zeros_like(self._pose)])
            self._rate = np.concatenate([self._rate, np.zeros_like(self._rate)])
            self._gyro_radps = np.concatenate([self._gyro_radps, np.zeros_like(self._gyro_radps)])
        self._stamp_ns[n], self._rate[n], self._gyro_radps[n] = motion.stamp_ns, rate, motion.rate_radps
        if n:
            self._rate[n - 1] = 0.5 * (self._rate[n - 1] + rate)  # the mean over the step, once it is known
            self._pose[n] = self._advance_one(n - 1, motion.stamp_ns)
        self._count += 1

    def pose(self, stamp_ns: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 3"]:
        """x, y [m] and yaw [rad] of the frame that is worked in at each instant [n], in the odometry frame.

        Before the first and after the last message the motion goes on as it is there; without any there is
        none: zeros.
        """
        stamp_ns = np.asarray(stamp_ns, dtype=np.int64)
        if self._count == 0:
            return np.zeros((len(stamp_ns), 3))
        at = np.searchsorted(self._stamp_ns[: self._count], stamp_ns, side="right") - 1
        if len(stamp_ns) == 1:
            return np.array([self._advance_one(max(int(at[0]), 0), int(stamp_ns[0]))])
        return self._advance(np.maximum(at, 0), stamp_ns)

    def speed_mps(self) -> Float64[np.ndarray, "2"]:
        """The newest velocity in the axes that are worked in; zeros without any message."""
        speed: np.ndarray = self._rate[max(self._count - 1, 0), :2].copy()
        return speed

    def gyro(self) -> tuple[Int64[np.ndarray, " n"], Float64[np.ndarray, "n 3"]]:
        """All samples so far: stamps, and rates about the body's axes [rad/s]."""
        return self._stamp_ns[: self._count].copy(), self._gyro_radps[: self._count].copy()

    def _advance(
        self, at: Int64[np.ndarray, " n"], stamp_ns: Int64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, "n 3"]:
        dt = (stamp_ns - self._stamp_ns[at]) * 1e-9
        turn = self._rate[at, 2] * dt
        yaw = self._pose[at, 2] + 0.5 * turn
        dx, dy = self._rate[at, 0] * dt, self._rate[at, 1] * dt
        c, s = np.cos(yaw), np.sin(yaw)
        return np.stack(
            [
                self._pose[at, 0] + c * dx - s * dy,
                self._pose[at, 1] + s * dx + c * dy,
                self._pose[at, 2] + turn,
            ],
            axis=1,
        )

    def _advance_one(self, at: int, stamp_ns: int) -> tuple[float, float, float]:
        """As `_advance`, ten times faster for one instant."""
        dt = (stamp_ns - int(self._stamp_ns[at])) * 1e-9
        (x, y, yaw), (rate_x, rate_y, rate) = self._pose[at].tolist(), self._rate[at].tolist()
        middle = yaw + 0.5 * rate * dt
        c, s = math.cos(middle), math.sin(middle)
        dx, dy = rate_x * dt, rate_y * dt
        return x + c * dx - s * dy, y + s * dx + c * dy, yaw + rate * dt


def to_odometry(
    xy_m: Float64[np.ndarray, "n 2"], pose: Float64[np.ndarray, "#n 3"]
) -> Float64[np.ndarray, "n 2"]:
    """Points [n 2] at the poses [n 3] (or one pose [1 3] for all) to the odometry frame."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    x, y = xy_m[:, 0], xy_m[:, 1]
    return np.stack([pose[:, 0] + c * x - s * y, pose[:, 1] + s * x + c * y], axis=1)


def from_odometry(
    xy_m: Float64[np.ndarray, "n 2"], pose: Float64[np.ndarray, "#n 3"]
) -> Float64[np.ndarray, "n 2"]:
    """The inverse of `to_odometry`."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    x, y = xy_m[:, 0] - pose[:, 0], xy_m[:, 1] - pose[:, 1]
    return np.stack([c * x + s * y, c * y - s * x], axis=1)
