"""Does the fit find known levels as often as it says: simulation-based calibration on the bench's own runs.

Every design point in turn is the truth and its own run the data; the emulators do not know the point (folds,
hyper-parameters of the whole). Ranks of the truth among draws of the posterior are uniform if all is well:
Talts et al., Validating Bayesian inference algorithms with simulation-based calibration, 2018. The log
likelihood is ranked like a parameter: it shows scatter stated too small or too large where single parameters
are hardly identified (Modrák et al., Simulation-based calibration checking, Bayesian Analysis, 2023). The
design must be of the same prior as the draws; one that fills it evenly makes the test a little lenient.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.special import betaincinv, chdtrc

from simbench.reproduce.fit.emulate import Emulator, fit_emulator, without
from simbench.reproduce.fit.infer import (
    ENOUGH,
    Emulated,
    Posterior,
    distance_squared,
    emulated,
    run_covariance,
    weigh,
    whitening,
)

BINS = (20, 10, 5, 4, 2)
EXPECTED = 4.0  # truths per bin, at least
FEW = 100  # truths; with 64, scatter stated at half its size is found in a quarter of trials
SIGNIFICANT = 0.05
LEVELS = (0.5, 0.9)


@dataclass(frozen=True, kw_only=True, eq=False)
class Coverage:
    """Share of truths in their central interval of a nominal share, by parameter; low, high: 95 % interval of
    that share (Clopper-Pearson)."""

    nominal: float
    share: Float64[np.ndarray, " d"]
    low: Float64[np.ndarray, " d"]
    high: Float64[np.ndarray, " d"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """ranks: of every truth, 0 to `of`; the last column is the log likelihood. p: of uniform ranks (by
    chi-square over bins), holm_p: the same, adjusted for their number (Holm 1979); passed: all holm_p above
    0.05.

    truths: used; dropped: without all outputs; poor: with too few effective draws, their ranks are coarse;
    why: None, or what the check cannot say.
    """

    ranks: Int64[np.ndarray, "t q"]
    of: int
    bins: int
    p: Float64[np.ndarray, " q"]
    holm_p: Float64[np.ndarray, " q"]
    passed: bool
    coverage: tuple[Coverage, ...]
    truths: int
    dropped: int
    poor: int
    why: str | None


def calibrate(
    design: Float64[np.ndarray, "n d"],
    outputs: Float64[np.ndarray, "n k"],
    draws: Float64[np.ndarray, "m d"],
    rng: np.random.Generator,
    *,
    emulators: Sequence[Emulator] | None = None,
    run_cov: Float64[np.ndarray, "k k"] | None = None,
    folds: int = 8,
    of: int = 99,
) -> Calibration:
    """Check the fit of k outputs over a design. emulators: of the outputs, fitted here if not given; run_cov:
    of one run (the emulators' noise on the diagonal if not given). ValueError: no row has all outputs.
    """
    fitted = [fit_emulator(design, column) for column in outputs.T] if emulators is None else list(emulators)
    covariance = run_covariance(fitted, independent=True) if run_cov is None else run_cov
    truths = np.flatnonzero(np.isfinite(outputs).all(axis=1))
    if not len(truths):
        raise ValueError("no row of the design has all outputs")
    ranks, poor = [], 0
    for fold in np.array_split(rng.permutation(truths), min(folds, len(truths))):
        others = [without(emulator, fold) for emulator in fitted]
        cells, own = emulated(others, draws), emulated(others, design[fold])
        white, own_white = whitening(cells, covariance), whitening(own, covariance)
        for i, row in enumerate(fold.tolist()):
            posterior = weigh(draws, cells, outputs[row], white, rng, keep=1)
            true = _log_likelihood(own, own_white, i, outputs[row])
            ranks.append(_ranks(posterior, np.append(design[row], true), of, rng))
            poor += posterior.ess < ENOUGH
    return summary_of(np.array(ranks), of, dropped=len(design) - len(truths), poor=poor)


def summary_of(ranks: Int64[np.ndarray, "t q"], of: int, *, dropped: int = 0, poor: int = 0) -> Calibration:
    """What ranks (0 to `of`) say; the last column is no parameter."""
    truths = len(ranks)
    bins = next((b for b in BINS if (of + 1) % b == 0 and truths / b >= EXPECTED), BINS[-1])
    p = uniform_p(ranks, of, bins)
    adjusted = holm(p)
    return Calibration(
        ranks=ranks, of=of, bins=bins, p=p, holm_p=adjusted, passed=bool((adjusted > SIGNIFICANT).all()),
        coverage=tuple(coverage(ranks[:, :-1], of, level) for level in LEVELS), truths=truths,
        dropped=dropped, poor=poor, why=_doubt(truths, poor),
    )  # fmt: skip


def uniform_p(ranks: Int64[np.ndarray, "t q"], of: int, bins: int) -> Float64[np.ndarray, " q"]:
    """By column, the chi-square p of ranks 0 to `of` that are uniform."""
    which = ranks * bins // (of + 1)
    counts = np.array([np.bincount(column, minlength=bins) for column in which.T])
    expected = len(ranks) / bins
    return np.asarray(chdtrc(bins - 1, ((counts - expected) ** 2 / expected).sum(axis=1)))


def holm(p: Float64[np.ndarray, " q"]) -> Float64[np.ndarray, " q"]:
    """p adjusted for their number by Holm's steps."""
    order = np.argsort(p)
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    found = np.empty(len(p))
    found[order] = np.minimum(stepped, 1.0)
    return found


def coverage(ranks: Int64[np.ndarray, "t d"], of: int, nominal: float) -> Coverage:
    """A truth is in the central interval if its rank is among the middle ones. nominal x (of + 1) and what is
    left on a side must be whole numbers."""
    side = round(0.5 * (1.0 - nominal) * (of + 1))
    inside = ((side <= ranks) & (ranks <= of - side)).sum(axis=0).astype(np.float64)
    n = float(len(ranks))
    low = np.where(inside > 0, betaincinv(np.maximum(inside, 1.0), n - inside + 1.0, 0.025), 0.0)
    high = np.where(inside < n, betaincinv(inside + 1.0, np.maximum(n - inside, 1.0), 0.975), 1.0)
    return Coverage(nominal=nominal, share=inside / n, low=low, high=high)


def _log_likelihood(
    own: Emulated,
    white: tuple[Float64[np.ndarray, "f k k"], Float64[np.ndarray, " f"]],
    i: int,
    values: Float64[np.ndarray, " k"],
) -> float:
    """Of one truth's own levels."""
    one = Emulated(mean=own.mean[[i]], sd=own.sd[[i]])
    squared = float(distance_squared(one, values, white[0][[i]])[0])
    return -0.5 * squared - float(white[1][i]) - 0.5 * len(values) * float(np.log(2.0 * np.pi))


def _ranks(
    posterior: Posterior, truth: Float64[np.ndarray, " q"], of: int, rng: np.random.Generator
) -> Int64[np.ndarray, " q"]:
    """Among independent draws of the posterior; ties at random."""
    ends = np.cumsum(posterior.weights)
    chosen = np.minimum(np.searchsorted(ends, rng.random(of) * ends[-1], side="right"), len(ends) - 1)
    values = np.column_stack([posterior.draws[chosen], posterior.log_likelihood[chosen]])
    ties = (values == truth).sum(axis=0)
    return (values < truth).sum(axis=0) + rng.integers(0, ties + 1)


def _doubt(truths: int, poor: int) -> str | None:
    said = []
    if truths < FEW:
        said.append(f"{truths} truths are few: only gross faults of the fit would show")
    if poor:
        said.append(f"{poor} of {truths} posteriors have fewer than {ENOUGH:.0f} effective draws")
    return "; ".join(said) or None
