"""Bounds of a mean over many scenarios, each with its runs: scenarios are drawn again, then their runs.

Runs of one scenario are alike, so that counting them as independent claims too much. Scenario means weigh the
same. Davison & Hinkley, Bootstrap Methods and their Application, 1997, ch. 3.8; studentised by the spread of
the scenario means, which holds what differs between scenarios and what is left of the runs' scatter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from simbench.score.statistics import RESAMPLES
from simbench.verdict.bounds import AT_ONCE, LEAST_SPREAD, Bootstrap

SCENARIOS = 20
"""From so many on they are a sample of more; fewer are fixed, and claims are about these."""


def nested_bounds(values: Sequence[Float64[np.ndarray, " _"]], rng: np.random.Generator) -> Bootstrap:
    """values: of every scenario's runs. ValueError: fewer than 20 scenarios, or one without a run."""
    if len(values) < SCENARIOS or not all(len(one) for one in values):
        raise ValueError(f"scenarios are drawn again from {SCENARIOS} on, each with a run")
    count = np.array([len(one) for one in values])
    table = np.zeros((len(values), count.max()))
    for row, one in zip(table, values, strict=True):
        row[: len(one)] = one
    means = table.sum(axis=1) / count
    mean, spread = float(means.mean()), float(means.std())
    at_once = max(1, AT_ONCE // table.size)
    parts = []
    for done in range(0, RESAMPLES, at_once):
        which = rng.integers(0, len(values), (min(at_once, RESAMPLES - done), len(values)))
        runs = (rng.random((*which.shape, table.shape[1])) * count[which][..., None]).astype(np.int64)
        some = np.arange(table.shape[1]) < count[which][..., None]
        again = np.where(some, table[which[..., None], runs], 0.0).sum(axis=2) / count[which]
        scatter = np.maximum(again.std(axis=1), LEAST_SPREAD * spread)
        moved = again.mean(axis=1) - mean
        parts.append(mean - spread * np.divide(moved, scatter, out=np.zeros_like(moved), where=scatter > 0.0))
    return Bootstrap(candidates=np.sort(np.concatenate(parts)))
