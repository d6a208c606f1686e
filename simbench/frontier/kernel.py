"""The prior of a curve along an axis from 0 to 1: a constant, a slope, and a Matérn 5/2 bend around them.

k(x, y) = c² + b² (x - 1/2)(y - 1/2) + a² (1 + r + r²/3) exp(-r), r = sqrt(5) |x - y| / l
(Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, eq. 4.17 and section 2.7). Amplitude a
and length l are those of greatest posterior probability on a fixed grid, under log-normal priors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

LENGTHS = (0.04, 0.06, 0.09, 0.14, 0.2, 0.3, 0.45, 0.7, 1.1)
LIKELY_LENGTH, LENGTH_SPREAD = 0.3, 0.8  # median, and SD of the logarithm
AMPLITUDES = (0.1, 0.3, 1.0, 2.0, 4.0, 8.0)  # of the scale
AMPLITUDE_SPREAD = 1.0  # SD of the logarithm of amplitude / scale


@dataclass(frozen=True, kw_only=True, eq=False)
class Priors:
    """All candidates at once. amplitude, length, log_prior: of each; constant, slope: SDs that all share."""

    amplitude: Float64[np.ndarray, " h"]
    length: Float64[np.ndarray, " h"]
    log_prior: Float64[np.ndarray, " h"]
    constant: float
    slope: float

    def among(self, x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, "h n n"]:
        """k(x, x) under every candidate."""
        r = np.sqrt(5.0) * np.abs(x[:, None] - x[None, :]) / self.length[:, None, None]
        bend = (1.0 + r + r * r / 3.0) * np.exp(-r)
        return self._line(x, x) + self.amplitude[:, None, None] ** 2 * bend

    def between(
        self, which: int, x: Float64[np.ndarray, " n"], y: Float64[np.ndarray, " m"]
    ) -> Float64[np.ndarray, "n m"]:
        """k(x, y) under one candidate."""
        r = np.sqrt(5.0) * np.abs(x[:, None] - y[None, :]) / self.length[which]
        bend = (1.0 + r + r * r / 3.0) * np.exp(-r)
        return np.asarray(self._line(x, y) + self.amplitude[which] ** 2 * bend)

    def at(self, which: int, x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """k(x, x) of single places under one candidate."""
        return np.asarray(self.constant**2 + self.slope**2 * (x - 0.5) ** 2 + self.amplitude[which] ** 2)

    def _line(self, x: Float64[np.ndarray, " n"], y: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, "n m"]:
        return np.asarray(self.constant**2 + self.slope**2 * np.outer(x - 0.5, y - 0.5))


def priors(*, scale: float, constant: float, slope: float) -> Priors:
    """The grid of candidates. scale: a likely amplitude; all three in the units of the curve."""
    lengths, amplitudes = np.meshgrid(LENGTHS, scale * np.array(AMPLITUDES))
    length, amplitude = lengths.ravel(), amplitudes.ravel()
    log_prior = -0.5 * (np.log(length / LIKELY_LENGTH) / LENGTH_SPREAD) ** 2
    log_prior -= 0.5 * (np.log(amplitude / scale) / AMPLITUDE_SPREAD) ** 2
    return Priors(amplitude=amplitude, length=length, log_prior=log_prior, constant=constant, slope=slope)
