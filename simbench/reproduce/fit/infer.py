"""Which levels bring the bench to what was printed: Bayesian synthetic likelihood over an emulator.

y ~ N(mu(theta), Sigma(theta)), Sigma = run covariance / passes + frame SD² / frames + emulator SD² +
discrepancy SD². Wood, Statistical inference for noisy nonlinear ecological dynamic systems, 2010; Price et
al., Bayesian synthetic likelihood, 2018; the emulator in place of many runs at one level and the discrepancy:
Kennedy & O'Hagan, Bayesian calibration of computer models, 2001. The posterior is held as weights of draws
from the prior: sampling-importance-resampling, Rubin 1988, with systematic resampling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.special import logsumexp

from simbench.reproduce.fit.emulate import Emulator, left_out, predict

ENOUGH = 100.0  # effective draws
LEAST_SHRUNK = 1e-3  # of correlations, so that none is 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Observed:
    """What was printed, by cell: means over some frames of `passes` passes, and the SD of one frame. A frame
    SD of 0 leaves the frame term out. A SD over frames of several passes holds some of the runs' scatter."""

    values: Float64[np.ndarray, " k"]
    frame_sd: Float64[np.ndarray, " k"]
    frames: Float64[np.ndarray, " k"]
    passes: int

    @staticmethod
    def of(
        values: Sequence[float],
        *,
        passes: int = 1,
        frame_sd: Sequence[float] | None = None,
        frames: Sequence[int] | None = None,
    ) -> Observed:
        """ValueError: a frame SD without a number of frames, counts below 1, or lengths that differ."""
        y = np.array(values, dtype=np.float64)
        sd = np.zeros(len(y)) if frame_sd is None else np.array(frame_sd, dtype=np.float64)
        count = np.ones(len(y)) if frames is None else np.array(frames, dtype=np.float64)
        if not len(y) == len(sd) == len(count):
            raise ValueError(f"{len(y)} values, {len(sd)} frame SDs and {len(count)} numbers of frames")
        if passes < 1 or (count < 1.0).any() or (sd < 0.0).any():
            raise ValueError("passes and frames are at least 1, SDs at least 0")
        if frame_sd is not None and frames is None:
            raise ValueError("a frame SD needs a number of frames")
        return Observed(values=y, frame_sd=sd, frames=count, passes=passes)


@dataclass(frozen=True, kw_only=True, eq=False)
class Emulated:
    """k cells at m draws: the mean over runs, and the emulator's SD of it."""

    mean: Float64[np.ndarray, "m k"]
    sd: Float64[np.ndarray, "m k"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Posterior:
    """Weights (sum 1) over draws from the prior. distance2: squared Mahalanobis distance of the observed from
    each draw's mean; ess: Kish's effective number of draws; resampled: rows of draws that stand for the
    posterior, each with the same weight; why: None, or what makes it a poor picture of the posterior."""

    draws: Float64[np.ndarray, "m d"]
    weights: Float64[np.ndarray, " m"]
    log_likelihood: Float64[np.ndarray, " m"]
    distance2: Float64[np.ndarray, " m"]
    ess: float
    log_evidence: float
    resampled: Int64[np.ndarray, " r"]
    cells: int
    why: str | None


def emulated(emulators: Sequence[Emulator], draws: Float64[np.ndarray, "m d"]) -> Emulated:
    """All cells at all draws."""
    pairs = [predict(emulator, draws) for emulator in emulators]
    return Emulated(
        mean=np.column_stack([mean for mean, _ in pairs]), sd=np.column_stack([sd for _, sd in pairs])
    )


def run_covariance(emulators: Sequence[Emulator], *, independent: bool) -> Float64[np.ndarray, "k k"]:
    """Covariance of one run's outputs at one level. independent: no two outputs are of one drive; else the
    correlations are those of the standardised left-out residuals, shrunk towards 0 as n rows allow (by the
    mean squared error of a correlation over its square; Schäfer & Strimmer 2005)."""
    noise = np.array([emulator.noise_sd for emulator in emulators])
    if independent or len(noise) == 1:
        return np.diag(noise**2)
    shared = emulators[0].kept
    for emulator in emulators[1:]:
        shared = np.intersect1d(shared, emulator.kept)
    if len(shared) < 4:
        raise ValueError(f"{len(shared)} runs have all outputs: too few for their correlations")
    parts = []
    for emulator in emulators:
        out = left_out(emulator)
        part = (out.residual / out.sd)[np.searchsorted(emulator.kept, shared)]
        parts.append((part - part.mean()) / max(float(part.std()), 1e-12))
    plain = np.array(parts) @ np.array(parts).T / len(shared)
    off = ~np.eye(len(noise), dtype=bool)
    error = float(((1.0 - plain[off] ** 2) ** 2).sum()) / (len(shared) - 1)
    shrink = float(np.clip(error / max(float((plain[off] ** 2).sum()), 1e-12), LEAST_SHRUNK, 1.0))
    return np.where(off, (1.0 - shrink) * plain, 1.0) * np.outer(noise, noise)


def common_covariance(
    observed: Observed, run_cov: Float64[np.ndarray, "k k"], discrepancy_sd: float | Float64[np.ndarray, " k"]
) -> Float64[np.ndarray, "k k"]:
    """What all draws share of Sigma: runs, frames and discrepancy."""
    own = observed.frame_sd**2 / observed.frames + np.asarray(discrepancy_sd, dtype=np.float64) ** 2
    return run_cov / observed.passes + np.diag(own)


def spread(
    cells: Emulated,
    observed: Observed,
    run_cov: Float64[np.ndarray, "k k"],
    discrepancy_sd: float | Float64[np.ndarray, " k"],
) -> Float64[np.ndarray, "m k"]:
    """SD of each observed cell about each draw's mean."""
    return np.sqrt(np.diag(common_covariance(observed, run_cov, discrepancy_sd)) + cells.sd**2)


def whitening(
    cells: Emulated, common: Float64[np.ndarray, "k k"]
) -> tuple[Float64[np.ndarray, "m k k"], Float64[np.ndarray, " m"]]:
    """By draw: what makes residuals uncorrelated with SD 1, and half the log determinant of Sigma.
    ValueError: some Sigma is singular."""
    sigma = common + cells.sd[:, :, None] ** 2 * np.eye(len(common))
    try:
        factor = np.linalg.cholesky(sigma)
    except np.linalg.LinAlgError:
        raise ValueError("outputs without scatter need a discrepancy above 0") from None
    return np.linalg.inv(factor), np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)


def infer(
    draws: Float64[np.ndarray, "m d"],
    cells: Emulated,
    observed: Observed,
    run_cov: Float64[np.ndarray, "k k"],
    discrepancy_sd: float | Float64[np.ndarray, " k"],
    rng: np.random.Generator,
    *,
    keep: int = 2000,
) -> Posterior:
    """Weigh draws of the prior by what was observed. ValueError: an observed value is not finite."""
    white = whitening(cells, common_covariance(observed, run_cov, discrepancy_sd))
    return weigh(draws, cells, observed.values, white, rng, keep=keep)


def weigh(
    draws: Float64[np.ndarray, "m d"],
    cells: Emulated,
    values: Float64[np.ndarray, " k"],
    white: tuple[Float64[np.ndarray, "m k k"], Float64[np.ndarray, " m"]],
    rng: np.random.Generator,
    *,
    keep: int = 2000,
) -> Posterior:
    """As `infer`, with Sigma taken apart already."""
    if not np.isfinite(values).all():
        raise ValueError("an observed value is not finite: leave its cell out")
    distance2 = distance_squared(cells, values, white[0])
    log_likelihood = -0.5 * distance2 - white[1] - 0.5 * len(values) * np.log(2.0 * np.pi)
    total = float(logsumexp(log_likelihood))
    weights = np.exp(log_likelihood - total)
    weights /= weights.sum()
    ess = 1.0 / float((weights**2).sum())
    return Posterior(
        draws=draws, weights=weights, log_likelihood=log_likelihood, distance2=distance2, ess=ess,
        log_evidence=total - float(np.log(len(draws))), resampled=resample(weights, keep, rng),
        cells=len(values), why=_doubt(ess, len(draws)),
    )  # fmt: skip


def resample(
    weights: Float64[np.ndarray, " m"], count: int, rng: np.random.Generator
) -> Int64[np.ndarray, " r"]:
    """Systematic resampling: every row within one of count x its weight times."""
    ends = np.cumsum(weights)
    places = (np.arange(count) + rng.random()) / count * ends[-1]
    return np.minimum(np.searchsorted(ends, places, side="right"), len(weights) - 1)


def distance_squared(
    cells: Emulated, values: Float64[np.ndarray, " k"], white: Float64[np.ndarray, "m k k"]
) -> Float64[np.ndarray, " m"]:
    """Squared Mahalanobis distance of values from each draw's mean."""
    apart = np.einsum("mab,mb->ma", white, values - cells.mean)
    return (apart * apart).sum(axis=1)


def _doubt(ess: float, draws: int) -> str | None:
    if ess >= ENOUGH:
        return None
    return (
        f"only {ess:.0f} of {draws} draws carry the posterior: it lies where the prior has few, draw more or "
        "doubt its details"
    )
