"""One cause alone: what a single kind of error does from none to its worst, all others at a reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from simbench.reproduce.fit.describe import limit2
from simbench.reproduce.fit.emulate import Emulator
from simbench.reproduce.fit.infer import (
    Observed,
    common_covariance,
    distance_squared,
    emulated,
    spread,
    whitening,
)

BAND = 2.0  # SDs

Stretches = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Alone:
    """Along one parameter. mean: over runs, sd: the emulator's; spread: of the observed about the mean. fits:
    by cell, stretches of levels at which the observed is within 2 SDs; together: those at which all cells fit
    at once (95 % ellipse). Empty: there is none. Ends are levels of the grid."""

    parameter: int
    levels: Float64[np.ndarray, " g"]
    mean: Float64[np.ndarray, "g k"]
    sd: Float64[np.ndarray, "g k"]
    spread: Float64[np.ndarray, "g k"]
    fits: tuple[Stretches, ...]
    together: Stretches


def grids(draws: Float64[np.ndarray, "m d"], count: int = 101) -> tuple[Float64[np.ndarray, " g"], ...]:
    """Levels over the range of every column of the prior's draws; 0 and 1 for one that holds nothing else."""
    return tuple(
        np.array([0.0, 1.0])
        if np.isin(column, (0.0, 1.0)).all()
        else np.linspace(float(column.min()), float(column.max()), count)
        for column in draws.T
    )


def alone(
    emulators: Sequence[Emulator],
    observed: Observed,
    run_cov: Float64[np.ndarray, "k k"],
    discrepancy_sd: float | Float64[np.ndarray, " k"],
    reference: Float64[np.ndarray, " d"],
    levels: Sequence[Float64[np.ndarray, " _g"]],
) -> tuple[Alone, ...]:
    """Every parameter along its own rising levels."""
    common = common_covariance(observed, run_cov, discrepancy_sd)
    found = []
    for parameter, grid in enumerate(levels):
        places = np.tile(reference, (len(grid), 1))
        places[:, parameter] = grid
        cells = emulated(emulators, places)
        about = spread(cells, observed, run_cov, discrepancy_sd)
        inside = np.abs(cells.mean - observed.values) <= BAND * about
        white, _ = whitening(cells, common)
        all_at_once = distance_squared(cells, observed.values, white) <= limit2(len(common), 0.95)
        found.append(
            Alone(
                parameter=parameter, levels=grid, mean=cells.mean, sd=cells.sd, spread=about,
                fits=tuple(stretches(grid, cell) for cell in inside.T), together=stretches(grid, all_at_once),
            )
        )  # fmt: skip
    return tuple(found)


def stretches(levels: Float64[np.ndarray, " g"], inside: Bool[np.ndarray, " g"]) -> Stretches:
    """First and last level of every run of True."""
    edges = np.diff(np.concatenate([[0], inside.astype(np.int64), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return tuple((float(levels[a]), float(levels[b])) for a, b in zip(starts, ends, strict=True))
