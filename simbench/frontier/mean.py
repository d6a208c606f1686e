"""The mean over runs along an axis, as a Gaussian process through the levels' means.

Seeds are shared by all levels, so most of their scatter moves the whole curve and says nothing about its
shape. What scatters from level to level is found from the runs: every level against the line between its
neighbours, seed by seed. That is the noise of the process; the rest shows in the influence of the seeds.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from simbench.frontier.curve import GRID, Curve
from simbench.frontier.kernel import priors

RESAMPLES = 999
TINY = 1e-12


def mean_curve(levels: Float64[np.ndarray, " k"], margins: Float64[np.ndarray, "k n"]) -> Curve:
    """levels: rising, from 0 to 1, three or more. margins: of every run, by how much it meets the limit."""
    n = margins.shape[1]
    y = margins.mean(axis=1)
    rough = _roughness(levels, margins) / n
    far = float(np.abs(y).max())
    scale = max(float(y.std()), float(np.sqrt(rough.mean())), 0.01 * far, TINY)
    prior = priors(scale=scale, constant=10.0 * scale + far, slope=3.0 * scale)
    noise = rough + 1e-6 * scale**2
    among = prior.among(levels) + np.diag(noise)
    root = np.linalg.cholesky(among)
    white = np.linalg.solve(root, np.broadcast_to(y[:, None], (len(root), len(y), 1)))[..., 0]
    evidence = -0.5 * (white**2).sum(axis=1) - np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    best = int(np.argmax(evidence + prior.log_prior))
    near = prior.between(best, GRID, levels)
    weight = np.linalg.solve(among[best], near.T).T
    smooth = prior.at(best, GRID) - (weight * near).sum(axis=1) - (weight**2) @ noise
    smooth = np.maximum(smooth, 0.0)
    influence = (weight @ (margins - y[:, None])).T

    def pivots(place: int, rng: np.random.Generator) -> Float64[np.ndarray, " b"]:
        drawn = influence[:, place][rng.integers(0, n, (RESAMPLES, n))]
        variance = drawn.var(axis=1, ddof=1) / n + smooth[place]
        return np.asarray(drawn.mean(axis=1) / np.sqrt(np.maximum(variance, TINY**2)))

    return Curve(margin=weight @ y, influence=influence, smooth=smooth, pivots=pivots)


def _roughness(
    levels: Float64[np.ndarray, " k"], margins: Float64[np.ndarray, "k n"]
) -> Float64[np.ndarray, " k"]:
    """Variance over seeds of what a run does at one level alone; no more than all of its variance."""
    n = margins.shape[1]
    if n < 2:
        return np.zeros(len(levels))
    apart = margins - margins.mean(axis=1, keepdims=True)
    right = ((levels[1:-1] - levels[:-2]) / (levels[2:] - levels[:-2]))[:, None]
    off = apart[1:-1] - (1.0 - right) * apart[:-2] - right * apart[2:]
    alone = float(((off**2).sum(axis=1) / (n - 1) / (1.0 + (1.0 - right) ** 2 + right**2)[:, 0]).mean())
    all_of_it = apart.var(axis=1) * n / (n - 1)
    return np.asarray(min(1.0, alone / max(float(all_of_it.mean()), TINY)) * all_of_it)
