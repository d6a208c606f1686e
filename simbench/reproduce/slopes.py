"""What each cause costs amid all the others: a straight line through the runs of the fit's design, in which
all levels vary at once; and how much passes differ there.

Least squares; standard errors that allow unequal scatter (HC3: MacKinnon & White 1985); intervals are
Student's, widened so that those of a cell hold together (Bonferroni).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.special import stdtrit

from simbench.paper import PASSES
from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD
from simbench.reproduce.collect import values_of
from simbench.reproduce.levels import LEVELS
from simbench.reproduce.plan import fit_points
from simbench.reproduce.protocol import Dependence, dependence
from simbench.reproduce.tables import frames_of

METRICS = ("tpr", "mae_m.smooth")
ERROR_RATE = 0.05


@dataclass(frozen=True, kw_only=True)
class Slope:
    """One cause: what going from none of it to its bound changes, the others anywhere within physics."""

    cause: str
    effect: float
    ci: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Slopes:
    """One pipeline and metric in one cell, over n runs. r2: the share of the variance that straight lines
    explain; none: the value they give where nothing is wrong."""

    cell: str
    pipeline: str
    metric: str
    n: int
    r2: float
    none: float
    causes: tuple[Slope, ...]


def slopes(found: Found) -> tuple[Slopes, ...]:
    """By cell, pipeline and metric; empty where no design was run."""
    return tuple(
        _slopes(found, cell.name, cell.system, pipeline, metric)
        for cell in CELLS
        for pipeline in (BASELINE, GROUND, METHOD)
        for metric in METRICS
        if found.size.fit_points
    )


def varied(found: Found) -> dict[str, Dependence]:
    """By cell: what the paper's frames are worth if its passes differ as those of the design do."""
    return {
        cell.name: dependence(frames_of(before, after), cell.printed.n, PASSES)
        for cell in CELLS
        for before, after in ([found.of("fit", cell.name, name) for name in (BASELINE, METHOD)],)
        if before
    }


def _slopes(found: Found, cell: str, system: str, pipeline: str, metric: str) -> Slopes:
    levels, count = LEVELS[system], found.size.fit_points
    share = fit_points(system, count) / np.array([level.bound for level in levels])
    values = np.full(count, np.nan)
    for number in range(count):
        for value in values_of(found.of("fit", cell, pipeline, number), metric).values():
            values[number] = np.nan if value is None else value
    known = np.isfinite(values)
    line = straight(share[known], values[known], tests=len(levels))
    return Slopes(
        cell=cell, pipeline=pipeline, metric=metric, n=int(known.sum()), r2=line.r2, none=float(line.at[0]),
        causes=tuple(
            Slope(cause=level.name, effect=float(effect), ci=(float(effect - half), float(effect + half)))
            for level, effect, half in zip(levels, line.at[1:], line.half[1:], strict=True)
        ),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """at: intercept and slopes [1 + d]; half: half the width of their intervals."""

    at: Float64[np.ndarray, " k"]
    half: Float64[np.ndarray, " k"]
    r2: float


def straight(x: Float64[np.ndarray, "n d"], y: Float64[np.ndarray, " n"], *, tests: int) -> Line:
    """Fit y = a + b x. tests: how many intervals are to hold at once. ValueError: too few rows."""
    columns = np.column_stack([np.ones(len(x)), x])
    n, k = columns.shape
    if n <= k:
        raise ValueError(f"{n} runs for {k} numbers")
    inverse = np.linalg.pinv(columns.T @ columns)
    at = inverse @ columns.T @ y
    off = y - columns @ at
    leverage = np.einsum("ni,ij,nj->n", columns, inverse, columns)
    scaled = columns * (off / np.maximum(1.0 - leverage, 1e-12))[:, None]
    sd = np.sqrt(np.diag(inverse @ (scaled.T @ scaled) @ inverse))
    total = float(((y - y.mean()) ** 2).sum())
    return Line(
        at=at, half=stdtrit(n - k, 1.0 - 0.5 * ERROR_RATE / tests) * sd,
        r2=1.0 - float(off @ off) / total if total > 0.0 else 0.0,
    )  # fmt: skip
