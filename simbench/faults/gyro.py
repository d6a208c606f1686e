"""What a gyro would find of a drawn shake, and how its noise moves what is found.

An ideal gyro on the drawn shake is read at the stamps of the real one (Euler angles about z, y, x to body
rates: p = roll' - yaw' sin pitch, q = pitch' cos roll + yaw' cos pitch sin roll, r = yaw' cos pitch cos roll
- pitch' sin roll) and integrated as the real one is, so that samples and turns about several axes err alike
on both sides and what is left is the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.interpolate import CubicSpline

from scenarios.scenario import ImuSensor
from simbench.shake import BodyShake

STEP_NS = 250_000  # to either side, of the difference that is an angle's rate


@dataclass(frozen=True, kw_only=True)
class GyroNoise:
    """White noise of the rate, 1 SD of a sample; the 1-SD step from sample to sample by which its bias
    wanders; 1 SD of the bias that it starts with."""

    white_radps: float = 0.0
    wander_radps: float = 0.0
    bias_radps: float = 0.0

    @classmethod
    def of(cls, sensor: ImuSensor, period_s: float) -> GyroNoise:
        """Of a one-sided density up to the Nyquist frequency and a random walk, at samples so far apart."""
        return cls(
            white_radps=float(np.deg2rad(sensor.gyro_noise_dps_rthz) * np.sqrt(0.5 / period_s)),
            wander_radps=float(np.deg2rad(sensor.gyro_walk_dps_rts) * np.sqrt(period_s)),
            bias_radps=float(np.deg2rad(sensor.gyro_bias_dps)),
        )

    def biased_share(self) -> float:
        """Of other axes' angles, at most, that a bias turns into one: 5 SD of it times 0.1 s. An angle that
        swings at 0.5 Hz or faster integrates to a third of a second of itself, and not much more than a third
        of that swings with another axis."""
        return 5.0 * self.bias_radps * 0.1

    def sum_sd(self, weight: Float64[np.ndarray, "n a"], period_s: float) -> float:
        """1 SD of the weighted sum of integrated angles. The angle at sample j is the sum of all rates before
        and half of that at j: the error of sample k moves every angle from k on. Weights add up to 0, as
        what knows no mean has it."""
        moves = period_s * (_from_here_on(weight) - 0.5 * weight)
        wanders = _from_here_on(moves)
        variance = self.white_radps**2 * np.sum(moves**2) + self.wander_radps**2 * np.sum(wanders**2)
        return float(np.sqrt(variance))


def _from_here_on(value: Float64[np.ndarray, "n a"]) -> Float64[np.ndarray, "n a"]:
    return np.cumsum(value[::-1], axis=0)[::-1]


def ideal_rates_radps(
    shake: BodyShake, yaw_rad: Float64[np.ndarray, " n"], stamp_ns: Int64[np.ndarray, " n"]
) -> Float64[np.ndarray, "n 3"]:
    """Of the body about its own axes. yaw_rad: the heading that the script turns to."""
    roll, pitch, _ = shake.at(stamp_ns)[:, :3].T
    change = shake.at(stamp_ns + STEP_NS)[:, :3] - shake.at(stamp_ns - STEP_NS)[:, :3]
    roll_rate, pitch_rate, yaw_rate = change.T / (2e-9 * STEP_NS)
    t_s = stamp_ns * 1e-9
    yaw_rate = yaw_rate + CubicSpline(t_s, np.unwrap(yaw_rad))(t_s, 1)
    return np.stack(
        [
            roll_rate - yaw_rate * np.sin(pitch),
            pitch_rate * np.cos(roll) + yaw_rate * np.cos(pitch) * np.sin(roll),
            yaw_rate * np.cos(pitch) * np.cos(roll) - pitch_rate * np.sin(roll),
        ],
        axis=1,
    )
