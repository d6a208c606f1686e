"""The paper's test, for comparison only: N frames drawn at random from a few passes, treated as independent.

Frames of one pass are not independent. How much a draw of them is worth is said beside it: the intra-class
correlation of frames within passes (ICC(1), one-way random effects by analysis of variance, groups of unequal
sizes after Donner 1986), and the effective number of independent frames, n / (1 + (m - 1) ICC) with m the
frames of a pass (Kish's design effect).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.special import stdtr

ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """One value per frame [n] of two pipelines, and the pass (run) that each frame is of."""

    before: Float64[np.ndarray, " n"]
    after: Float64[np.ndarray, " n"]
    run: Int64[np.ndarray, " n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """k draws of the paper's test, an entry each [k], of n frames. t, p_two_sided, p_one_sided: paired t of
    after - before; half_t, half_p: one-sample right-tailed t of after against 0.5. Not a number: no spread,
    or fewer than two frames."""

    n: int
    before: Float64[np.ndarray, " k"]
    before_sd: Float64[np.ndarray, " k"]
    after: Float64[np.ndarray, " k"]
    after_sd: Float64[np.ndarray, " k"]
    t: Float64[np.ndarray, " k"]
    p_two_sided: Float64[np.ndarray, " k"]
    p_one_sided: Float64[np.ndarray, " k"]
    half_t: Float64[np.ndarray, " k"]
    half_p: Float64[np.ndarray, " k"]


@dataclass(frozen=True, kw_only=True)
class Dependence:
    """icc: of frames within passes, of the difference after - before. effective_n: how many independent
    frames tell as much. None: fewer than two passes, or none has two frames."""

    icc: float | None
    effective_n: float | None


def draw(frames: Frames, n: int, rng: np.random.Generator, count: int = 1) -> Drawn:
    """`count` draws of n frames at random without putting back (all, where there are fewer), and their
    tests."""
    total = len(frames.before)
    chosen = chosen_rows(total, n, rng, count)
    before, after = frames.before[chosen], frames.after[chosen]
    t, _ = _t(after - before, 0.0)
    half_t, df = _t(after, 0.5)
    return Drawn(
        n=chosen.shape[1],
        before=before.mean(axis=1), before_sd=_sd(before), after=after.mean(axis=1), after_sd=_sd(after),
        t=t, p_two_sided=2.0 * stdtr(df, -np.abs(t)), p_one_sided=stdtr(df, -t),
        half_t=half_t, half_p=stdtr(df, -half_t),
    )  # fmt: skip


def chosen_rows(total: int, n: int, rng: np.random.Generator, count: int) -> Int64[np.ndarray, "k n"]:
    """Rows of `count` draws without putting back."""
    return np.argsort(rng.random((count, total)), axis=1)[:, :n].astype(np.int64)


def _t(values: Float64[np.ndarray, "k n"], against: float) -> tuple[Float64[np.ndarray, " k"], int]:
    """Student's t of the mean of every row, where the row varies by more than rounding, and its degrees of
    freedom."""
    n = values.shape[1]
    sd = (
        np.where(np.ptp(values, axis=1) > ROUNDING, _sd(values), np.nan)
        if n > 1
        else np.full(len(values), np.nan)
    )
    return (values.mean(axis=1) - against) / (sd / np.sqrt(n)), max(n - 1, 1)


def dependence(frames: Frames, n: int, passes: int) -> Dependence:
    """What n frames are worth that come from so many passes which differ as the passes of these frames do."""
    values = frames.after - frames.before
    icc = intra_class(values, frames.run)
    if icc is None:
        return Dependence(icc=None, effective_n=None)
    return Dependence(icc=icc, effective_n=n / (1.0 + max(n / passes - 1.0, 0.0) * max(icc, 0.0)))


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


def _sd(values: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, " k"]:
    return values.std(axis=1, ddof=1) if values.shape[1] > 1 else np.zeros(len(values))
