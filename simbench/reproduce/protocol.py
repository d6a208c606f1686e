"""The paper's test, for comparison only: N frames drawn at random from a few passes, treated as independent.

Frames of one pass are not independent. How much a draw of them is worth is said beside it: the intra-class
correlation of frames within passes (ICC(1), one-way random effects by analysis of variance, groups of unequal
sizes after Donner 1986), and the effective number of independent frames, n / (1 + (m - 1) ICC) with m the
frames that a pass gives to the draw (Kish's design effect).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from simbench.score.statistics import TTest, one_sample_t, paired_t


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """One value per frame [n] of two pipelines, and the pass (run) that each frame is of."""

    before: Float64[np.ndarray, " n"]
    after: Float64[np.ndarray, " n"]
    run: Int64[np.ndarray, " n"]


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """One draw of the paper's test. two_sided, one_sided: paired t of after - before; half: one-sample right-
    tailed t of after against 0.5. None: no spread, or fewer than two frames."""

    n: int
    before: float
    before_sd: float
    after: float
    after_sd: float
    two_sided: TTest | None
    one_sided: TTest | None
    half: TTest | None


@dataclass(frozen=True, kw_only=True)
class Dependence:
    """icc: of frames within passes, of the difference after - before. effective_n: of a draw of n frames.
    None: fewer than two passes, or none has two frames."""

    icc: float | None
    effective_n: float | None


def draw(frames: Frames, n: int, rng: np.random.Generator) -> Drawn:
    """n frames at random without putting back (all, where there are fewer), and their tests."""
    chosen = rng.permutation(len(frames.before))[:n]
    before, after = frames.before[chosen], frames.after[chosen]
    count = len(chosen)
    spread = _varies(after - before)
    return Drawn(
        n=count,
        before=float(before.mean()),
        before_sd=_sd(before),
        after=float(after.mean()),
        after_sd=_sd(after),
        two_sided=paired_t(before, after) if spread else None,
        one_sided=paired_t(before, after, "greater") if spread else None,
        half=one_sample_t(float(after.mean()), _sd(after), count, 0.5) if _varies(after) else None,
    )


def dependence(frames: Frames, n: int) -> Dependence:
    """How much a draw of n of these frames is worth."""
    values = frames.after - frames.before
    icc = intra_class(values, frames.run)
    if icc is None:
        return Dependence(icc=None, effective_n=None)
    passes = len(np.unique(frames.run))
    each = min(n, len(values)) / passes
    return Dependence(icc=icc, effective_n=min(n, len(values)) / (1.0 + max(each - 1.0, 0.0) * max(icc, 0.0)))


def intra_class(values: Float64[np.ndarray, " n"], group: Int64[np.ndarray, " n"]) -> float | None:
    """ICC(1): the share of the variance that is between groups; by chance it may be a little below 0. None:
    fewer than two groups, no group of two, or no variance."""
    groups = [values[group == g] for g in np.unique(group)]
    k, n = len(groups), len(values)
    if k < 2 or n <= k:
        return None
    sizes = np.array([len(g) for g in groups], dtype=np.float64)
    means = np.array([g.mean() for g in groups])
    between = float((sizes * (means - values.mean()) ** 2).sum()) / (k - 1)
    within = float(sum(((g - g.mean()) ** 2).sum() for g in groups)) / (n - k)
    size = (n - float((sizes**2).sum()) / n) / (k - 1)
    total = between + (size - 1.0) * within
    return (between - within) / total if total > 0.0 else None


def _varies(values: Float64[np.ndarray, " n"]) -> bool:
    """More than rounding does."""
    return len(values) > 1 and float(np.ptp(values)) > 1e-12


def _sd(values: Float64[np.ndarray, " n"] | Sequence[float]) -> float:
    array = np.asarray(values)
    return float(array.std(ddof=1)) if len(array) > 1 else 0.0
