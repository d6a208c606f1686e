"""What several seeds say of a difference that should not be: nothing below six, then Student's interval.

The unit is the run (`score/statistics.py`). Intervals are of 99 %: the seeds are always the same, so a
pipeline for which the relation holds exactly, but for noise, must not be told otherwise for good more than
once in a hundred pipelines.
"""

from __future__ import annotations

from collections.abc import Sequence

from simbench.checks.finding import Finding

LEVEL = 0.99
MIN_RUNS = 6  # as of score/statistics.py


def interval(differences: Sequence[float]) -> tuple[float, float]:
    """Student's interval of the mean of at least `MIN_RUNS` differences."""
    from simbench.score.statistics import t_interval

    return t_interval(differences, LEVEL)


def too_few(differences: Sequence[float], asked: int, what: str) -> Finding | None:
    """`cannot be said` where fewer than `MIN_RUNS` seeds have a difference."""
    if len(differences) >= MIN_RUNS:
        return None
    why = f"{len(differences)} of {asked} seeds have {what}, at least {MIN_RUNS} are needed"
    return Finding(verdict="cannot be said", why=why)
