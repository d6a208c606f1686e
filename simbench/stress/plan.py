"""Where a stress test measures: the points of a grid, of a Latin hypercube or of a Sobol sequence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

from scenarios.errors import BadInput
from scenarios.seeding import stream
from simbench.case import Job
from simbench.stress.axes import OPTION, Axis, Point, fault_arguments, scenario_changes

Design = Literal["grid", "lhs", "sobol"]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is run: every point with every seed, all pipelines on one recording."""

    axes: tuple[Axis, ...]
    points: tuple[Point, ...]
    design: Design


def grid(axes: Sequence[Axis]) -> Plan:
    """All combinations of the axes' values, the last axis fastest."""
    return Plan(axes=tuple(axes), points=tuple(product(*(axis.values for axis in axes))), design="grid")


def scattered(axes: Sequence[Axis], count: int, design: Design) -> Plan:
    """`count` points that fill the space between the axes' ends: the same ones for the same axes and count.

    BadInput: an axis is a list, which has nothing in between.
    """
    from scipy.stats import qmc

    for axis in axes:
        if not axis.spread:
            raise BadInput(f"{OPTION}: {axis.name} is a list; a {design} needs LOW:HIGH")
    rng = stream(0, "stress", design, *(axis.name for axis in axes), str(count))
    if design == "lhs":
        unit = qmc.LatinHypercube(len(axes), rng=rng).random(count)
    else:
        exponent = max(count - 1, 1).bit_length()
        unit = qmc.Sobol(len(axes), rng=rng).random_base2(exponent)[:count]
    low, high = zip(*(axis.ends for axis in axes), strict=True)
    points = [tuple(float(f"{value:.6g}") for value in row) for row in qmc.scale(unit, low, high).tolist()]
    return Plan(axes=tuple(axes), points=tuple(points), design=design)


def jobs_of(plan: Plan, template: Job, seeds: Sequence[int]) -> tuple[tuple[Point, Job], ...]:
    """Point by point, seed by seed, the template with the point's faults and changes on top of its own."""
    from dataclasses import replace

    return tuple(
        (
            point,
            replace(
                template,
                seed=seed,
                faults=(*template.faults, *fault_arguments(plan.axes, point)),
                changes=(*template.changes, *scenario_changes(plan.axes, point)),
            ),
        )
        for point in plan.points
        for seed in seeds
    )
