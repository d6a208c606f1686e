"""Tables II and III and the MAE under one condition: every cell, every pipeline, the oracle, and what the
readings of the measure make of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.case import ORACLE
from simbench.paper import MAE
from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD, PIPELINES, Cell
from simbench.reproduce.collect import Run, mean_over, values_of
from simbench.reproduce.plan import CONDITIONS, Condition
from simbench.reproduce.tables import MaeTable, TprTable, mae_table, missed_few, premise, tpr_table
from simbench.score.metrics import BUDGET_AXES, BUDGET_PARTS, T1_POINTS
from simbench.score.statistics import Summary, summarize

READINGS = ("tpr", "tpr.nonempty", "tpr.pooled", "tpr.centre", "tpr.gnss", "precision")
"""The paper's measure as we read it, and otherwise: pairs without points left out, counts summed first,
around the distance of the centre, of the held GNSS; and the share by exact labels."""


@dataclass(frozen=True, kw_only=True)
class CellTable:
    """One cell. raw, ground: the method against the box as it is, and after ground removal. pipelines: TPR
    over runs. missed_few: Eq. 5, the share of pairs that miss fewer than t1 points. premise: of the pairs
    with TPR above 0.5 the share whose representative point is right, and how many there are. readings: by
    pipeline, then reading, mean over runs. mae_m, mae_gnss_m: by pipeline, against the exact centre and the
    held GNSS fix. budget: signed means [m] of the method's raw positions against the fix, by axis and part;
    the two scenarios of a rig see opposite sides of the target, so that they must not be added up."""

    cell: str
    raw: TprTable
    ground: TprTable
    pipelines: dict[str, Summary]
    missed_few: dict[str, float | None]
    premise: dict[str, tuple[float | None, int]]
    readings: dict[str, dict[str, float | None]]
    mae_m: dict[str, Summary]
    mae_gnss_m: dict[str, Summary]
    budget: dict[str, dict[str, Summary]]


@dataclass(frozen=True, kw_only=True)
class RigTable:
    """One rig over both scenarios. exact: MAE against the exact centre [m] by pipeline."""

    system: str
    mae: MaeTable
    exact: dict[str, Summary]


@dataclass(frozen=True, kw_only=True)
class ConditionTable:
    """Everything under one condition. t1_points: of Eq. 5."""

    condition: Condition
    words: str
    t1_points: int
    cells: tuple[CellTable, ...]
    rigs: tuple[RigTable, ...]


def condition_tables(found: Found, rng: np.random.Generator) -> tuple[ConditionTable, ...]:
    """By condition."""
    return tuple(
        ConditionTable(
            condition=condition,
            words=words,
            t1_points=T1_POINTS,
            cells=tuple(_cell(found, cell, condition, rng) for cell in CELLS),
            rigs=tuple(_rig(found, system, condition, rng) for system in MAE),
        )
        for condition, words in CONDITIONS.items()
    )


def _cell(found: Found, cell: Cell, condition: Condition, rng: np.random.Generator) -> CellTable:
    runs = {name: found.of("tables", cell.name, name, condition) for name in (*PIPELINES, ORACLE)}
    return CellTable(
        cell=cell.name,
        raw=tpr_table(cell.printed, runs[BASELINE], runs[METHOD], rng),
        ground=tpr_table(cell.printed, runs[GROUND], runs[METHOD], rng),
        pipelines={name: summarize(values_of(of, "tpr"), rng) for name, of in runs.items()},
        missed_few={name: missed_few(of, T1_POINTS) for name, of in runs.items()},
        premise={name: premise(of) for name, of in runs.items()},
        readings={
            name: {reading: mean_over(of, reading) for reading in READINGS}
            for name, of in runs.items()
            if name != ORACLE
        },
        mae_m={name: summarize(values_of(of, "mae_m.smooth"), rng) for name, of in runs.items()},
        mae_gnss_m={name: summarize(values_of(of, "mae_m.smooth.gnss"), rng) for name, of in runs.items()},
        budget={
            axis: {
                part: summarize(values_of(runs[METHOD], f"budget_{axis}_m.{part}"), rng)
                for part in BUDGET_PARTS
            }
            for axis in BUDGET_AXES
        },
    )


def _rig(found: Found, system: str, condition: Condition, rng: np.random.Generator) -> RigTable:
    names = [cell.name for cell in CELLS if cell.system == system]

    def both(pipeline: str) -> list[Run]:
        return [run for name in names for run in found.of("tables", name, pipeline, condition)]

    def over(pipeline: str, metric: str) -> Summary:
        return summarize({number: run.metrics.get(metric) for number, run in enumerate(both(pipeline))}, rng)

    return RigTable(
        system=system,
        mae=mae_table(MAE[system], both(METHOD), rng),
        exact={name: over(name, "mae_m.smooth") for name in (*PIPELINES, ORACLE)},
    )
