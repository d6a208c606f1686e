"""How many runs a verdict needs, from the spread that a pilot saw.

Power of the one-sided t-test of paired differences, noncentral t. A pilot's SD is uncertain itself: plan with
the upper limit that 80 % of pilots reach. The numbers hold for differences that look normal; where few runs
carry the losses, a PASS needs two to four times as many (docs/verdict.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy.special import chdtri, nctdtr, ndtr, stdtrit

from simbench.score.statistics import MIN_RUNS
from simbench.verdict.decide import ALPHA

POWER: Final = 0.8
PILOT_LIMIT: Final = 0.8
QUANTILES: Final = (np.arange(4000) + 0.5) / 4000.0
MOST: Final = 1_000_000  # runs beyond which no plan goes


@dataclass(frozen=True, kw_only=True)
class Plan:
    """runs for the `power` to find `aim` if the true loss is what was said. sd: the pilot's; sd_limit: its
    upper limit, which the plan uses.
    """

    runs: int
    aim: Literal["PASS", "REGRESSION"]
    power: float
    sd: float
    sd_limit: float
    pilot_runs: int


def plan(
    pilot: Sequence[float] | np.ndarray, *, margin: float, true_loss: float = 0.0, power: float = POWER,
    alpha: float = ALPHA,
) -> Plan:  # fmt: skip
    """From the paired differences of a pilot (one per run, at least 2). `true_loss`: what the new version
    truly loses, in the metric's unit; below the margin a PASS is aimed at, above it a REGRESSION.
    """
    values = np.asarray(pilot, dtype=np.float64)
    if len(values) < 2 or not np.isfinite(values).all():
        raise ValueError("a pilot needs at least 2 runs with finite differences")
    sd = float(values.std(ddof=1))
    limit = sd_limit(sd, len(values))
    return Plan(
        runs=runs_needed(limit, margin=margin, true_loss=true_loss, power=power, alpha=alpha),
        aim="PASS" if true_loss < margin else "REGRESSION",
        power=power, sd=sd, sd_limit=limit, pilot_runs=len(values),
    )  # fmt: skip


def sd_limit(sd: float, n: int, level: float = PILOT_LIMIT) -> float:
    """One-sided upper limit of the SD of normal values of which n have the sample SD `sd`."""
    if n < 2:
        raise ValueError("an SD needs at least 2 values")
    return sd * float(np.sqrt((n - 1) / chdtri(n - 1, level)))


def runs_needed(
    sd: float, *, margin: float, true_loss: float = 0.0, power: float = POWER, alpha: float = ALPHA
) -> int:
    """Fewest runs (at least 6) with this power, if differences scatter by `sd`. ValueError: what cannot be
    planned, such as a loss equal to the margin, which no number of runs decides.
    """
    if not (np.isfinite(sd) and sd >= 0.0 and np.isfinite(margin) and margin > 0.0):
        raise ValueError("a plan needs a finite SD of at least 0 and a finite margin above 0")
    if not (0.0 < alpha < 0.5 and alpha < power < 1.0):
        raise ValueError("alpha lies between 0 and 0.5, the power between alpha and 1")
    away = abs(margin - true_loss)
    if not np.isfinite(away) or away == 0.0:
        raise ValueError("no number of runs decides a loss that equals the margin")

    def enough(n: int) -> bool:
        return power_of(n, sd=sd, away=away, alpha=alpha) >= power

    if enough(MIN_RUNS):
        return MIN_RUNS
    few, many = MIN_RUNS, 2 * MIN_RUNS
    while not enough(many):
        few, many = many, 2 * many
        if few > MOST:
            raise ValueError(
                f"more than {MOST} runs would be needed: the margin is too small for an SD of {sd:g}"
            )
    while many - few > 1:
        middle = (few + many) // 2
        few, many = (few, middle) if enough(middle) else (middle, many)
    return many


def power_of(n: int, *, sd: float, away: float, alpha: float = ALPHA) -> float:
    """Chance that n runs show on which side of the margin the truth lies, `away` from it."""
    if sd == 0.0:
        return 1.0
    return 1.0 - noncentral_t(stdtrit(n - 1, 1.0 - alpha), n - 1, away / sd * np.sqrt(n))


def noncentral_t(t: float, df: int, shift: float) -> float:
    """Chance that a noncentral t lies at or below t. SciPy's is not a number for some large shifts; there the
    definition is integrated: E[Phi(t s - shift)] over s = sqrt(chi2 / df)."""
    found = float(nctdtr(df, shift, t))
    if np.isfinite(found):
        return found
    return float(ndtr(t * np.sqrt(chdtri(df, QUANTILES) / df) - shift).mean())
