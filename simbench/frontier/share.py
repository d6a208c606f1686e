"""The share of runs that meet a limit along an axis: a Gaussian process behind a probit link.

Laplace's approximation (Rasmussen & Williams 2006, algorithm 3.1). Runs of one seed at several levels are not
independent: the standard error comes from the seeds' scores (a sandwich, which is what a bootstrap over seeds
tends to), the pivots from resamples of the seeds, each fitted anew.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64
from scipy.special import log_ndtr, ndtri

from simbench.frontier.curve import GRID, Curve
from simbench.frontier.kernel import priors

RESAMPLES = 399
SCALE, CONSTANT, SLOPE = 1.0, 3.0, 4.0  # of the prior, on the probit scale
NUGGET = 1e-6
STEPS, LONGEST_STEP, CLOSE = 15, 3.0, 1e-5
HALF_LOG_2PI = 0.9189385332046727


def share_curve(levels: Float64[np.ndarray, " k"], met: Bool[np.ndarray, "k n"], least: float) -> Curve:
    """levels: rising, from 0 to 1. met: whether a run meets the limit. least: the share that must."""
    n = met.shape[1]
    once = np.ones((1, n))
    prior = priors(scale=SCALE, constant=CONSTANT, slope=SLOPE)
    among = prior.among(levels) + NUGGET * np.eye(len(levels))
    best = _likeliest(among, met.sum(axis=1).astype(np.float64), n, prior.log_prior)
    near, at, k = prior.between(best, GRID, levels), prior.at(best, GRID), among[best]
    latent, influence, smooth = _read(near, at, k, met, once)

    def pivots(place: int, rng: np.random.Generator) -> Float64[np.ndarray, " b"]:
        drawn = rng.integers(0, n, (RESAMPLES, n))
        count = np.stack([np.bincount(row, minlength=n) for row in drawn]).astype(np.float64)
        moved, pull, between = _read(near[place : place + 1], at[place : place + 1], k, met, count)
        variance = (count[:, :, None] * pull**2).sum(axis=1) / (n * (n - 1.0)) + between
        return np.asarray((moved[:, 0] - latent[0, place]) / np.sqrt(variance[:, 0]))

    return Curve(
        margin=latent[0] - float(ndtri(least)), influence=influence[0], smooth=smooth[0], pivots=pivots
    )


def _likeliest(
    among: Float64[np.ndarray, "h k k"], passed: Float64[np.ndarray, " k"], n: int,
    log_prior: Float64[np.ndarray, " h"],
) -> int:  # fmt: skip
    """The candidate of greatest evidence (Laplace) times prior."""
    latent = _mode(among, np.broadcast_to(passed, (len(among), len(passed))), n)
    like, slope, bend, _, _ = _likelihood(latent, passed, n)
    root = np.sqrt(bend)
    inner = np.eye(len(passed)) + root[:, :, None] * among * root[:, None, :]
    evidence = like.sum(axis=1) - 0.5 * (latent * slope).sum(axis=1) - 0.5 * np.linalg.slogdet(inner)[1]
    return int(np.argmax(evidence + log_prior))


def _read(
    near: Float64[np.ndarray, "m k"], at: Float64[np.ndarray, " m"], among: Float64[np.ndarray, "k k"],
    met: Bool[np.ndarray, "k n"], count: Float64[np.ndarray, "b n"],
) -> tuple[Float64[np.ndarray, "b m"], Float64[np.ndarray, "b n m"], Float64[np.ndarray, "b m"]]:  # fmt: skip
    """Latent curve, influence of every seed and variance between the levels, when seed j counts count[:, j]
    times. `near`, `at`: covariance of the places with the levels, and their variance."""
    n = met.shape[1]
    passed = count @ met.T.astype(np.float64)
    latent = _mode(np.broadcast_to(among, (len(count), *among.shape)), passed, n)
    _, slope, bend, if_met, if_not = _likelihood(latent, passed, n)
    inner = np.eye(len(among)) + bend[:, :, None] * among
    pull = np.swapaxes(np.linalg.solve(np.swapaxes(inner, 1, 2), near.T[None]), 1, 2)  # b m k
    score = np.where(met[None], if_met[:, :, None], if_not[:, :, None])  # b k n
    centred = score - ((score * count[:, None, :]).sum(axis=2) / n)[:, :, None]
    influence = n * np.swapaxes(pull @ centred, 1, 2)
    smooth = at - (pull * bend[:, None, :] * near).sum(axis=2) - (pull**2 * bend[:, None, :]).sum(axis=2)
    return slope @ near.T, influence, np.maximum(smooth, 0.0)


def _mode(
    among: Float64[np.ndarray, "b k k"], passed: Float64[np.ndarray, "b k"], n: int
) -> Float64[np.ndarray, "b k"]:
    """Newton's steps to the most probable latent values, all problems at once."""
    latent = np.zeros(passed.shape)
    for _ in range(STEPS):
        _, slope, bend, _, _ = _likelihood(latent, passed, n)
        root = np.sqrt(bend)
        inner = np.eye(among.shape[1]) + root[:, :, None] * among * root[:, None, :]
        right = bend * latent + slope
        moved = root * np.einsum("bij,bj->bi", among, right)
        pull = right - root * np.linalg.solve(inner, moved[..., None])[..., 0]
        step = np.einsum("bij,bj->bi", among, pull) - latent
        latent = latent + np.clip(step, -LONGEST_STEP, LONGEST_STEP)
        if np.abs(step).max() < CLOSE:
            break
    return latent


def _likelihood(
    latent: Float64[np.ndarray, "b k"], passed: Float64[np.ndarray, "*b k"], n: int
) -> tuple[Float64[np.ndarray, "b k"], ...]:
    """Log-likelihood of `passed` of n runs at the latent values, its slope, minus its second derivative; the
    slope of one run that meets the limit, and of one that does not."""
    log_met, log_not = log_ndtr(latent), log_ndtr(-latent)
    log_density = -0.5 * latent**2 - HALF_LOG_2PI
    if_met, if_not = np.exp(log_density - log_met), -np.exp(log_density - log_not)
    failed = n - passed
    return (
        passed * log_met + failed * log_not,
        passed * if_met + failed * if_not,
        passed * if_met * (if_met + latent) + failed * if_not * (if_not + latent),
        if_met,
        if_not,
    )
