"""Lengths, amplitude and noise of a Gaussian process: those of greatest posterior probability.

k(x, y) = c² + b² (x - 1/2)·(y - 1/2) + a² (1 + r + r²/3) exp(-r), r² = 5 Σ_j (x_j - y_j)² / l_j²: a constant
and a slope per input with wide normal priors (a regressed mean), and a Matérn 5/2 bend with a length per
input (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, section 2.7, eq. 4.17 and section
5.4.1). Inputs are from 0 to 1, outputs have mean 0 and SD 1. Priors are log-normal;
that of lengths grows as the distance between places does, with the root of the number of inputs that vary
(Hvarfner et al., Vanilla Bayesian optimization performs great in high dimensions, 2024): many short lengths
look like noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.linalg import cho_solve, cholesky

CONSTANT_SD, SLOPE_SD = 3.0, 2.0
LIKELY_AMPLITUDE, LIKELY_NOISE = 0.7, 0.3
LENGTH_SPREAD, AMPLITUDE_SPREAD, NOISE_SPREAD = 1.0, 1.0, 1.5  # SDs of logarithms
LENGTH_BOUNDS, AMPLITUDE_BOUNDS, NOISE_BOUNDS = (0.05, 20.0), (0.01, 5.0), (1e-3, 3.0)
STARTS = ((0.5, 0.7, 0.3), (1.5, 0.7, 0.1), (0.3, 1.0, 0.6))  # length, amplitude, noise
FEW_STEPS, MANY_STEPS = 12, 150


@dataclass(frozen=True, kw_only=True, eq=False)
class Hyper:
    """lengths: of the bend, one per input; amplitude: its SD; noise: SD of one output about the mean."""

    lengths: Float64[np.ndarray, " d"]
    amplitude: float
    noise: float


def kernel(
    hyper: Hyper, x: Float64[np.ndarray, "n d"], y: Float64[np.ndarray, "m d"]
) -> Float64[np.ndarray, "n m"]:
    """k(x, y), without noise."""
    a, b = x / hyper.lengths, y / hyper.lengths
    square = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1)[None, :] - 2.0 * (a @ b.T)
    r = np.sqrt(5.0 * np.maximum(square, 0.0))
    bend = hyper.amplitude**2 * (1.0 + r + r * r / 3.0) * np.exp(-r)
    return bend + _mean(x, y)


def kernel_at(hyper: Hyper, x: Float64[np.ndarray, "n d"]) -> Float64[np.ndarray, " n"]:
    """k(x, x) of single places."""
    return CONSTANT_SD**2 + SLOPE_SD**2 * ((x - 0.5) ** 2).sum(axis=1) + hyper.amplitude**2


def likeliest(x: Float64[np.ndarray, "n d"], z: Float64[np.ndarray, " n"]) -> Hyper:
    """A few steps from every start, then many from the best of them (L-BFGS-B)."""
    from scipy.optimize import minimize

    d = x.shape[1]
    apart, mean, likely = _apart(x), _mean(x, x), _likely(x)
    bounds = np.log([*[LENGTH_BOUNDS] * d, AMPLITUDE_BOUNDS, NOISE_BOUNDS])

    def climb(start: Float64[np.ndarray, " h"], steps: int) -> tuple[float, Float64[np.ndarray, " h"]]:
        found = minimize(
            lambda u: _loss(u, z, apart, mean, likely), start, jac=True, method="L-BFGS-B", bounds=bounds,
            options={"maxiter": steps},
        )  # fmt: skip
        return float(found.fun), np.asarray(found.x)

    starts = [np.log(np.array([length] * d + [a, s])) for length, a, s in STARTS]
    best = min((climb(start, FEW_STEPS) for start in starts), key=lambda pair: pair[0])[1]
    return _hyper(climb(best, MANY_STEPS)[1])


def loss(
    logs: Float64[np.ndarray, " h"], x: Float64[np.ndarray, "n d"], z: Float64[np.ndarray, " n"]
) -> tuple[float, Float64[np.ndarray, " h"]]:
    """Minus the log posterior of the logarithms of lengths, amplitude and noise; and its gradient."""
    return _loss(logs, z, _apart(x), _mean(x, x), _likely(x))


def _loss(
    logs: Float64[np.ndarray, " h"],
    z: Float64[np.ndarray, " n"],
    apart: Float64[np.ndarray, "d nn"],
    mean: Float64[np.ndarray, "n n"],
    likely: Float64[np.ndarray, " h"],
) -> tuple[float, Float64[np.ndarray, " h"]]:
    hyper, n = _hyper(logs), len(z)
    weights = 5.0 / hyper.lengths**2
    r = np.sqrt(weights @ apart).reshape(n, n)
    fall = hyper.amplitude**2 * np.exp(-r)
    bend = fall * (1.0 + r + r * r / 3.0)
    factor = cholesky(bend + mean + hyper.noise**2 * np.eye(n), lower=True)
    alpha = cho_solve((factor, True), z)
    inverse = cho_solve((factor, True), np.eye(n))
    pull = np.outer(alpha, alpha) - inverse  # the derivative of 2 log p by K
    by_length = weights / 3.0 * (apart @ (pull * fall * (1.0 + r)).ravel())
    slopes = 0.5 * np.array([*by_length, 2.0 * (pull * bend).sum(), 2.0 * hyper.noise**2 * np.trace(pull)])
    d = len(hyper.lengths)
    spread = np.array([LENGTH_SPREAD] * d + [AMPLITUDE_SPREAD, NOISE_SPREAD])
    off = (logs - likely) / spread
    value = 0.5 * float(z @ alpha) + float(np.log(np.diag(factor)).sum()) + 0.5 * float(off @ off)
    return value, off / spread - slopes


def _likely(x: Float64[np.ndarray, "n d"]) -> Float64[np.ndarray, " h"]:
    """Logarithms of the priors' medians."""
    length = max(float((np.ptp(x, axis=0) > 0.0).sum()), 1.0) ** 0.5
    return np.log([length] * x.shape[1] + [LIKELY_AMPLITUDE, LIKELY_NOISE])


def _hyper(logs: Float64[np.ndarray, " h"]) -> Hyper:
    found = np.exp(logs)
    return Hyper(lengths=found[:-2], amplitude=float(found[-2]), noise=float(found[-1]))


def _mean(x: Float64[np.ndarray, "n d"], y: Float64[np.ndarray, "m d"]) -> Float64[np.ndarray, "n m"]:
    return CONSTANT_SD**2 + SLOPE_SD**2 * ((x - 0.5) @ (y - 0.5).T)


def _apart(x: Float64[np.ndarray, "n d"]) -> Float64[np.ndarray, "d nn"]:
    """Squared differences of all pairs, by input."""
    columns = x.T
    return ((columns[:, :, None] - columns[:, None, :]) ** 2).reshape(len(columns), -1)
