"""What a posterior says, from its weighted draws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float64
from scipy.special import chdtri

from simbench.reproduce.fit.infer import Posterior


def posterior_means(posterior: Posterior) -> Float64[np.ndarray, " d"]:
    """Of every parameter."""
    return posterior.weights @ posterior.draws


def posterior_covariance(posterior: Posterior) -> Float64[np.ndarray, "d d"]:
    """Of the parameters."""
    off = posterior.draws - posterior_means(posterior)
    return (posterior.weights[:, None] * off).T @ off


def posterior_correlations(posterior: Posterior) -> Float64[np.ndarray, "d d"]:
    """Of every pair of parameters; not a number where one does not vary."""
    covariance = posterior_covariance(posterior)
    variance = np.diag(covariance)
    sd = np.where(variance > 0.0, np.sqrt(variance), np.nan)
    return np.clip(covariance / np.outer(sd, sd), -1.0, 1.0)


def posterior_quantiles(posterior: Posterior, shares: Sequence[float]) -> Float64[np.ndarray, "q d"]:
    """The smallest draw of each parameter below which, or at it, at least each share of the weight lies."""
    return weighted_quantiles(posterior.draws, posterior.weights, shares)


def weighted_quantiles(
    values: Float64[np.ndarray, "m d"], weights: Float64[np.ndarray, " m"], shares: Sequence[float]
) -> Float64[np.ndarray, "q d"]:
    """Of every column; a value that occurs, so that 0/1 stays 0 or 1."""
    order = np.argsort(values, axis=0, kind="stable")
    below = np.cumsum(weights[order], axis=0)
    found = np.empty((len(shares), values.shape[1]))
    for column in range(values.shape[1]):
        place = np.searchsorted(below[:, column], np.asarray(shares) * below[-1, column] - 1e-12)
        found[:, column] = values[order[np.minimum(place, len(values) - 1), column], column]
    return found


def prior_share(posterior: Posterior, mass: float = 0.95) -> float:
    """The share of the prior's draws that hold this mass of the posterior, likeliest first: small where the
    data say much."""
    falling = np.sort(posterior.weights)[::-1]
    held = int(np.searchsorted(np.cumsum(falling), mass - 1e-12)) + 1
    return min(held, len(falling)) / len(falling)


def fitting(posterior: Posterior, level: float = 0.95) -> Bool[np.ndarray, " m"]:
    """The set that fits: draws at which the observed lies in the ellipse that holds this share of what they
    would give. It does not depend on the prior's density, only on what was drawn."""
    return posterior.distance2 <= limit2(posterior.cells, level)


def limit2(cells: int, level: float) -> float:
    """Squared Mahalanobis distance within which this share lies, chi-square."""
    return float(chdtri(cells, 1.0 - level))
