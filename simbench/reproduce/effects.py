"""What the groups of causes cost, alone and together, every one at its physical bound; and what mending one
of them gives back while the others stay.

Taken apart as `simbench explain` does (`explain/attribution.py`) where every set of the groups was run, with
the same seeds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.explain.attribution import Attribution, attribute
from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import METHOD, OURS, PIPELINES
from simbench.reproduce.collect import values_of
from simbench.reproduce.levels import GROUPS
from simbench.reproduce.plan import EVERYTHING
from simbench.score.statistics import Paired, paired

LOSSES = ("tpr", "mae_m.smooth")


@dataclass(frozen=True, kw_only=True)
class Mended:
    """What is gained by mending one thing of a rig on which everything is at its bound: in TPR, and in metres
    of MAE (below 0: less error). what: a group of causes, or `algorithm`: ours in place of the paper's."""

    cell: str
    what: str
    tpr: Paired
    mae_m: Paired


def attributions(found: Found) -> dict[str, tuple[Attribution, ...]]:
    """By cell of which every set was run: every pipeline and metric, as losses."""
    sets = {(ask.cell, ask.point) for ask in found.runs if ask.part == "groups"}
    cells = dict.fromkeys(ask.cell for ask in found.runs if ask.part == "groups")
    return {
        cell: tuple(
            _taken_apart(found, cell, pipeline, metric) for pipeline in PIPELINES for metric in LOSSES
        )
        for cell in cells
        if all((cell, (mask,)) in sets for mask in range(EVERYTHING + 1))
    }


def _taken_apart(found: Found, cell: str, pipeline: str, metric: str) -> Attribution:
    seeds = range(found.size.groups)
    sign = -1.0 if metric == "tpr" else 1.0
    rows = []
    for mask in range(EVERYTHING + 1):
        values = values_of(found.of("groups", cell, pipeline, mask), metric)
        known = [values.get(seed) for seed in seeds]
        rows.append([np.nan if value is None else sign * value for value in known])
    return attribute(np.array(rows), GROUPS, list(seeds), pipeline=pipeline, metric=metric)


def mended(found: Found, rng: np.random.Generator) -> tuple[Mended, ...]:
    """By cell: each group, then the algorithm."""
    rows = []
    for cell in dict.fromkeys(ask.cell for ask in found.runs if ask.part == "groups"):
        before = found.of("groups", cell, METHOD, EVERYTHING)
        after = {
            group: found.of("groups", cell, METHOD, EVERYTHING ^ (1 << i)) for i, group in enumerate(GROUPS)
        } | {"algorithm": found.of("groups", cell, OURS, EVERYTHING)}
        rows += [
            Mended(
                cell=cell, what=what,
                tpr=paired(values_of(before, "tpr"), values_of(runs, "tpr"), rng),
                mae_m=paired(values_of(before, "mae_m.smooth"), values_of(runs, "mae_m.smooth"), rng),
            )
            for what, runs in after.items()
        ]  # fmt: skip
    return tuple(rows)
