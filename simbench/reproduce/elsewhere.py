"""What would have to be different: every cell as it is, with any annotated distance, in other scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import fmean

import numpy as np

from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD, Cell
from simbench.reproduce.collect import Run, values_of
from simbench.reproduce.plan import SCENE_CONDITIONS
from simbench.reproduce.scenes import SCENES
from simbench.score.statistics import Paired, Summary, paired, summarize

AS_IT_IS = "as it is"
ANY_DISTANCE = "any annotated distance: the highest TPR"
Values = Mapping[int, float | None]


@dataclass(frozen=True, kw_only=True)
class Elsewhere:
    """One thing changed in one cell under one condition: TPR over runs by pipeline, and minus that of the
    cell as it is on the same seeds."""

    cell: str
    what: str
    condition: str
    tpr: dict[str, Summary]
    change: dict[str, Paired]


def elsewhere(found: Found, rng: np.random.Generator) -> tuple[Elsewhere, ...]:
    """By cell, change and condition; empty where no other scene was run."""
    return tuple(
        _row(found, cell, what, condition, rng)
        for cell in CELLS
        for what in (AS_IT_IS, ANY_DISTANCE, *(scene.title for scene in SCENES))
        for condition in SCENE_CONDITIONS
        if found.size.scenes
    )


def _row(found: Found, cell: Cell, what: str, condition: str, rng: np.random.Generator) -> Elsewhere:
    names = (BASELINE, GROUND, METHOD)
    before = {name: values_of(_as_it_is(found, cell, name, condition), "tpr") for name in names}
    after = {name: _values(found, cell, name, what, condition) for name in names}
    return Elsewhere(
        cell=cell.name, what=what, condition=condition,
        tpr={name: summarize(after[name], rng) for name in names},
        change={name: paired(before[name], after[name], rng) for name in names},
    )  # fmt: skip


def _values(found: Found, cell: Cell, pipeline: str, what: str, condition: str) -> Values:
    runs = _as_it_is(found, cell, pipeline, condition)
    if what == AS_IT_IS:
        return values_of(runs, "tpr")
    if what == ANY_DISTANCE:
        return {run.seed: fmean(p.tpr_any for p in run.pairs) if run.pairs else None for run in runs}
    scene = next(scene for scene in SCENES if scene.title == what)
    return values_of(found.of("scenes", cell.name, pipeline, scene.name, condition), "tpr")


def _as_it_is(found: Found, cell: Cell, pipeline: str, condition: str) -> tuple[Run, ...]:
    """Of the seeds that the other scenes were run with."""
    runs = found.of("tables", cell.name, pipeline, condition)
    return tuple(run for run in runs if run.seed < found.size.scenes)
