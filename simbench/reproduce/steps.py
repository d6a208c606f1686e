"""The method with one step or reading changed, beside the method as it is, on the same drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import CELLS, METHOD
from simbench.reproduce.collect import Run, values_of
from simbench.reproduce.variants import NAMES, reference_of, variant_of
from simbench.score.statistics import Paired, paired

METRICS = ("tpr", "precision", "recall", "mae_m.smooth")
SMOOTHER_REMOVED = "no_smoother"


@dataclass(frozen=True, kw_only=True)
class Changed:
    """One variant in one cell: its metric minus that of the method as it is, over runs."""

    name: str
    step: int
    title: str
    what: str
    cell: str
    differences: dict[str, Paired]


def changes(found: Found, rng: np.random.Generator) -> tuple[Changed, ...]:
    """By variant and cell; last the method without its smoother, whose positions are scored anyway."""
    rows = []
    for name in NAMES:
        variant = variant_of(reference_of(name))
        for cell in CELLS:
            before = found.of("variants", cell.name, METHOD)
            after = found.of("variants", cell.name, reference_of(name))
            if before:
                rows.append(
                    Changed(
                        name=name, step=variant.step, title=variant.title, what=variant.what, cell=cell.name,
                        differences={m: _difference(before, after, m, m, rng) for m in METRICS},
                    )
                )  # fmt: skip
    for cell in CELLS:
        before = found.of("variants", cell.name, METHOD)
        if before:
            rows.append(
                Changed(
                    name=SMOOTHER_REMOVED, step=6, title="smoother", what="removed: positions frame by frame",
                    cell=cell.name,
                    differences={
                        "mae_m.smooth": _difference(before, before, "mae_m.smooth", "mae_m.raw", rng)
                    },
                )
            )  # fmt: skip
    return tuple(rows)


def _difference(
    before: tuple[Run, ...], after: tuple[Run, ...], one: str, other: str, rng: np.random.Generator
) -> Paired:
    return paired(values_of(before, one), values_of(after, other), rng)
