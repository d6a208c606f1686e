"""What changes along levels: the heat map of trigger offset times body shake, and every cause alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import PIPELINES
from simbench.reproduce.collect import mean_over, values_of
from simbench.reproduce.levels import LEVELS
from simbench.score.statistics import Paired, paired


@dataclass(frozen=True, kw_only=True)
class HeatMap:
    """One pipeline in one cell: the mean TPR over runs, [shake][offset]; None: no run has one. n: runs at
    each place."""

    cell: str
    pipeline: str
    offset_ms: tuple[float, ...]
    shake_deg: tuple[float, ...]
    tpr: tuple[tuple[float | None, ...], ...]
    n: int


@dataclass(frozen=True, kw_only=True)
class Strip:
    """One pipeline in one cell under one cause alone: mean TPR and MAE [m] over n runs at each level, the
    first level 0. change: of the TPR, every level minus no error on the same seeds. bound: the highest level
    that is physical."""

    cell: str
    pipeline: str
    cause: str
    unit: str
    bound: float
    level: tuple[float, ...]
    tpr: tuple[float | None, ...]
    mae_m: tuple[float | None, ...]
    change: tuple[Paired, ...]
    n: int


def heat_maps(found: Found) -> tuple[HeatMap, ...]:
    """By cell and pipeline."""
    maps = []
    for cell in _cells(found, "map"):
        points = sorted({ask.point for ask in found.runs if ask.part == "map" and ask.cell == cell})
        offsets = sorted({float(point[0]) for point in points})
        shakes = sorted({float(point[1]) for point in points})
        for pipeline in PIPELINES:
            runs = {point: found.of("map", cell, pipeline, *point) for point in points}
            maps.append(
                HeatMap(
                    cell=cell, pipeline=pipeline, offset_ms=tuple(offsets), shake_deg=tuple(shakes),
                    tpr=tuple(
                        tuple(mean_over(runs[offset, shake], "tpr") for offset in offsets) for shake in shakes
                    ),
                    n=min(len(at) for at in runs.values()),
                )
            )  # fmt: skip
    return tuple(maps)


def strips(found: Found, rng: np.random.Generator) -> tuple[Strip, ...]:
    """By cell, cause and pipeline; without error as in the tables."""
    rows = []
    for cell in _cells(found, "strips"):
        system = cell.split()[0]
        for level in LEVELS[system]:
            mine = [
                ask
                for ask in found.runs
                if ask.part == "strips" and ask.cell == cell and ask.point[0] == level.name
            ]
            points = sorted({float(ask.point[1]) for ask in mine})
            seeds = {ask.job.seed for ask in mine}
            for pipeline in PIPELINES:
                clean = [r for r in found.of("tables", cell, pipeline, "none") if r.seed in seeds]
                at = [clean, *(found.of("strips", cell, pipeline, level.name, value) for value in points)]
                rows.append(
                    Strip(
                        cell=cell, pipeline=pipeline, cause=level.name, unit=level.unit, bound=level.bound,
                        level=(0.0, *points), tpr=tuple(mean_over(runs, "tpr") for runs in at),
                        mae_m=tuple(mean_over(runs, "mae_m.smooth") for runs in at),
                        change=tuple(
                            paired(values_of(clean, "tpr"), values_of(runs, "tpr"), rng) for runs in at
                        ),
                        n=min(len(runs) for runs in at),
                    )
                )  # fmt: skip
    return tuple(rows)


def _cells(found: Found, part: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(ask.cell for ask in found.runs if ask.part == part))
