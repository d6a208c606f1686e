"""The share of runs that meet a limit, when it may only fall along the axis: a logistic curve.

logit p = a - b x, b >= 0, by greatest penalised likelihood: weak normal priors on a and b keep both finite
where runs are separated. Asked for by `--assume-monotone`: a dip is smoothed over, so nothing less will do.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64
from scipy.special import expit, stdtrit

from simbench.frontier.curve import GRID, Curve

PRIOR_SD = np.array([10.0, 40.0])  # of a and b
STEPS, LONGEST_STEP, CLOSE = 100, 2.0, 1e-9
QUANTILES = 999


def logistic_curve(levels: Float64[np.ndarray, " k"], met: Bool[np.ndarray, "k n"], least: float) -> Curve:
    """As `share_curve`, on the logit scale. Pivots are Student's with n - 1 degrees of freedom: with the
    error taken at the place itself this is close to the exact tolerance bound of normal thresholds."""
    n = met.shape[1]
    design = np.column_stack([np.ones(len(levels)), -levels])
    passed, penalty = met.sum(axis=1), PRIOR_SD**-2.0
    found, information = np.zeros(2), np.diag(penalty)
    for _ in range(STEPS):
        chance = expit(design @ found)
        slope = design.T @ (passed - n * chance) - penalty * found
        information = (design.T * (n * chance * (1.0 - chance))) @ design + np.diag(penalty)
        step = np.linalg.solve(information, slope)
        step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), CLOSE))
        found = found + step
        if np.abs(step).max() < CLOSE:
            break
    if found[1] < 0.0:  # it rises: flat is the nearest that does not
        return logistic_curve(np.zeros(len(levels)), met, least)
    score = design.T @ (met - expit(design @ found)[:, None])
    score = score - score.mean(axis=1, keepdims=True)
    grid = np.column_stack([np.ones(len(GRID)), -GRID])
    influence = n * (grid @ np.linalg.solve(information, score)).T
    quantiles = stdtrit(max(n - 1, 1), (np.arange(QUANTILES) + 0.5) / QUANTILES)

    def pivots(_: int, __: np.random.Generator) -> Float64[np.ndarray, " b"]:
        return np.asarray(quantiles)

    margin = grid @ found - np.log(least / (1.0 - least))
    return Curve(margin=margin, influence=influence, smooth=np.zeros(len(GRID)), pivots=pivots)
