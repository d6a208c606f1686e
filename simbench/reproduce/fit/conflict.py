"""Does the prior agree with what was printed, before any fit: prior-data conflict, and what no level reaches.

P(m(Y) <= m(y)) with m the prior predictive density and Y drawn from it: Evans & Moshonov, Checking for
prior-data conflict, Bayesian Analysis 1, 2006. A small one says that the data lie where the prior has little,
so that a fit would be driven by its tail.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.special import logsumexp, ndtr

from simbench.reproduce.fit.infer import (
    Emulated,
    Observed,
    common_covariance,
    spread,
    whitening,
)

COMPONENTS = 2000  # draws that the predictive density is a mixture of
AT_ONCE = 100  # replicates at a time
BAND = 2.0  # SDs


@dataclass(frozen=True, kw_only=True, eq=False)
class Conflict:
    """joint_p: of all cells together; cell_p: two-sided tail of each alone. replicates: what joint_p was
    counted over; it is at least 1 / (replicates + 1)."""

    joint_p: float
    cell_p: Float64[np.ndarray, " k"]
    replicates: int


@dataclass(frozen=True, kw_only=True)
class Reach:
    """One cell over all draws of the prior. lowest, highest: means over runs; nearest: row of the draw that
    comes nearest, gap: its distance, slack: 2 SDs of runs, frames and discrepancy there. reached: gap
    <= slack. excluded: not even the emulator's doubt lets a draw reach it.
    """

    observed: float
    lowest: float
    highest: float
    nearest: int
    gap: float
    slack: float
    reached: bool
    excluded: bool


def conflict(
    cells: Emulated,
    observed: Observed,
    run_cov: Float64[np.ndarray, "k k"],
    discrepancy_sd: float | Float64[np.ndarray, " k"],
    rng: np.random.Generator,
    *,
    replicates: int = 2000,
) -> Conflict:
    """Half of the draws give the density, the other half the replicates. ValueError: fewer than 2 draws."""
    m = len(cells.mean)
    if m < 2:
        raise ValueError("a prior predictive needs 2 draws or more")
    order = rng.permutation(m)
    density, others = order[: min(m // 2, COMPONENTS)], order[m // 2 :]
    common = common_covariance(observed, run_cov, discrepancy_sd)
    chosen = others[rng.integers(0, len(others), replicates)]
    shared = rng.standard_normal((replicates, len(common))) @ _root(common).T
    own = cells.sd[chosen] * rng.standard_normal((replicates, len(common)))
    part = Emulated(mean=cells.mean[density], sd=cells.sd[density])
    levels = _log_density(part, common, np.vstack([observed.values, cells.mean[chosen] + shared + own]))
    below = ndtr((observed.values - cells.mean) / spread(cells, observed, run_cov, discrepancy_sd)).mean(
        axis=0
    )
    return Conflict(
        joint_p=(1.0 + float((levels[1:] <= levels[0]).sum())) / (replicates + 1.0),
        cell_p=2.0 * np.minimum(below, 1.0 - below),
        replicates=replicates,
    )


def reach(
    cells: Emulated,
    observed: Observed,
    run_cov: Float64[np.ndarray, "k k"],
    discrepancy_sd: float | Float64[np.ndarray, " k"],
) -> tuple[Reach, ...]:
    """Every cell alone."""
    known = np.sqrt(np.diag(common_covariance(observed, run_cov, discrepancy_sd)))
    gaps = np.abs(cells.mean - observed.values)
    doubtful = gaps <= BAND * spread(cells, observed, run_cov, discrepancy_sd)
    found = []
    for k, value in enumerate(observed.values.tolist()):
        nearest = int(gaps[:, k].argmin())
        gap, slack = float(gaps[nearest, k]), BAND * float(known[k])
        found.append(
            Reach(
                observed=value, lowest=float(cells.mean[:, k].min()), highest=float(cells.mean[:, k].max()),
                nearest=nearest, gap=gap, slack=slack, reached=gap <= slack,
                excluded=not bool(doubtful[:, k].any()),
            )
        )  # fmt: skip
    return tuple(found)


def _log_density(
    cells: Emulated, common: Float64[np.ndarray, "k k"], values: Float64[np.ndarray, "r k"]
) -> Float64[np.ndarray, " r"]:
    """Of a mixture of normals, one per draw; up to a constant."""
    white, half_log = whitening(cells, common)
    found = np.empty(len(values))
    for start in range(0, len(values), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        apart = np.einsum("mab,rmb->rma", white, values[some, None, :] - cells.mean[None, :, :])
        found[some] = logsumexp(-0.5 * (apart * apart).sum(axis=2) - half_log, axis=1)
    return found


def _root(covariance: Float64[np.ndarray, "k k"]) -> Float64[np.ndarray, "k k"]:
    """A square root of what may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))
