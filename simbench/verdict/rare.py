"""The second gate: failures too rare for a mean to show.

With 20 runs, a failure in one run of 20 is not seen at all in 36 % of comparisons, and no interval on a mean
knows of what it did not see. So the share of runs with any gross failure is judged by itself: Clopper &
Pearson's exact bounds (0 of K allow about 3 / K), McNemar's exact test for failures that are new, and a limit
on the share where one is declared.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.special import bdtrc, betaincinv

from simbench.score.statistics import MIN_RUNS
from simbench.verdict.decide import ALPHA, Verdict
from simbench.verdict.differences import runs

Failures: TypeAlias = Mapping[Hashable, bool | None]
"""Whether a run has any gross failure; None: it cannot be said."""


@dataclass(frozen=True, kw_only=True)
class Share:
    """`failed` of `n` runs, and the one-sided Clopper-Pearson bounds of the share, each at alpha."""

    failed: int
    n: int
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class FailureJudgement:
    """old, new: shares over the runs that both have. began, ended: runs that fail in the new version only, or
    in the old one only. p_new: McNemar's one-sided p of "as many end as begin". limit: on the new share.
    """

    verdict: Verdict
    alpha: float
    limit: float | None
    old: Share | None
    new: Share | None
    began: tuple[Hashable, ...]
    ended: tuple[Hashable, ...]
    p_new: float | None
    note: str | None


def share(failed: int, n: int, alpha: float = ALPHA) -> Share:
    """Clopper & Pearson, Biometrika 26, 1934. ValueError: not 0 <= failed <= n, n > 0."""
    if not 0 <= failed <= n or n == 0:
        raise ValueError(f"{failed} of {n} is no share")
    low = float(betaincinv(failed, n - failed + 1, alpha)) if failed > 0 else 0.0
    high = float(betaincinv(failed + 1, n - failed, 1.0 - alpha)) if failed < n else 1.0
    return Share(failed=failed, n=n, low=low, high=high)


def mcnemar(began: int, ended: int) -> float:
    """Exact one-sided p: how often a fair coin shows at least `began` heads in `began + ended` throws."""
    if began < 0 or ended < 0:
        raise ValueError("counts are at least 0")
    return 1.0 if began == 0 else float(bdtrc(began - 1, began + ended, 0.5))


def judge_failures(
    old: Failures, new: Failures, *, alpha: float = ALPHA, limit: float | None = None
) -> FailureJudgement:
    """REGRESSION: significantly more failures begin than end, or the share's lower bound lies above the
    limit. PASS: no such sign, and with a limit the share's upper bound does not exceed it. ERROR: no runs, or
    a run of which the old version could be said to fail or not and the new one cannot.
    """
    if not 0.0 < alpha < 0.5:
        raise ValueError(f"alpha lies between 0 and 0.5, not {alpha}")
    if limit is not None and not 0.0 <= limit <= 1.0:
        raise ValueError(f"a limit on a share lies between 0 and 1, not {limit}")
    blank = FailureJudgement(
        verdict="ERROR",
        alpha=alpha,
        limit=limit,
        old=None,
        new=None,
        began=(),
        ended=(),
        p_new=None,
        note=None,
    )
    lost = [run for run in old if run in new and old[run] is not None and new[run] is None]
    if lost:
        return replace(blank, note=f"{runs(lost)} cannot be said to fail or not any more")
    both = [run for run in old if old[run] is not None and new.get(run) is not None]
    if not both:
        return replace(blank, note="no samples: no run is known on both sides")
    began = tuple(run for run in both if new[run] and not old[run])
    ended = tuple(run for run in both if old[run] and not new[run])
    told = replace(
        blank, old=share(sum(bool(old[run]) for run in both), len(both), alpha),
        new=share(sum(bool(new[run]) for run in both), len(both), alpha),
        began=began, ended=ended, p_new=mcnemar(len(began), len(ended)),
    )  # fmt: skip
    verdict, note = _verdict(told)
    return replace(told, verdict=verdict, note=note)


def _verdict(told: FailureJudgement) -> tuple[Verdict, str | None]:
    new, p_new, limit = told.new, told.p_new, told.limit
    assert new is not None and p_new is not None
    begin = f"{runs(told.began)} fail that did not (p {p_new:.3g})" if told.began else None
    if new.n < MIN_RUNS:
        return "INCONCLUSIVE", f"n = {new.n} run{'' if new.n == 1 else 's'}: illustration"
    if p_new <= told.alpha:
        return "REGRESSION", begin
    if limit is None:
        return "PASS", begin
    shown = f"{new.failed} of {new.n} runs fail"
    if new.low > limit:
        return "REGRESSION", f"limit failed: {shown}, at least {new.low:.3f} of all, limit {limit:g}"
    if new.high > limit:
        need = (
            f", {_runs_for(limit, told.alpha)} runs without a failure would do"
            if new.failed == 0 < limit
            else ""
        )
        return "INCONCLUSIVE", f"{shown}, up to {new.high:.3f} of all, limit {limit:g}{need}"
    return "PASS", begin


def _runs_for(limit: float, alpha: float) -> int:
    """Runs without any failure that show a share of at most `limit`."""
    return int(np.ceil(np.log(alpha) / np.log1p(-limit)))
