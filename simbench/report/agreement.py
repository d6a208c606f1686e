"""Do cameras agree on one object? What the page shows of the curves in `simbench/distances.py`.

Shown where at least two objects were seen by at least two cameras each: for fewer there is nothing to tell
apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbench.case import JobResult
from simbench.distances import Curve, disagreements
from simbench.report.choose import Group, case_of
from simbench.report.words import pipeline_words

FEWEST_OBJECTS = 2
OURS = "robust"


@dataclass(frozen=True, kw_only=True)
class AgreementLine:
    """One pipeline on one side, all runs. `compared`: how often two cameras gave one object a distance in one
    scan. `median_m`: mean over runs of each run's median |difference|; None where nothing was compared.
    `largest_m` of all runs, and of which object it is, when and in which run."""

    words: str
    side: str
    compared: int
    median_m: float | None
    largest_m: float | None
    largest_of: str


def scored_curves(result: JobResult, pipeline: str) -> tuple[Curve, ...]:
    """A pipeline's curves; none of a case without a score."""
    case = case_of(result, pipeline)
    return () if case is None or case.scores is None else result.distances.of(pipeline)


def is_shown(results: Sequence[JobResult], pipelines: Sequence[str]) -> bool:
    """Whether some pipeline of some run has several objects that several cameras see."""
    for result in results:
        for pipeline in pipelines:
            names = [curve.object_name for curve in scored_curves(result, pipeline)]
            if sum(names.count(name) > 1 for name in set(names)) >= FEWEST_OBJECTS:
                return True
    return False


def drawn_pipelines(group: Group) -> tuple[str, ...]:
    """Whose curves are drawn: the method's (the only pipeline's, if there is one), and ours."""
    first = group.baseline if group.method is None else group.method
    return tuple(dict.fromkeys((first, *(name for name in group.pipelines if name == OURS))))


def agreement_lines(group: Group) -> tuple[AgreementLine, ...]:
    """Every pipeline on every side; empty where the figure is not shown."""
    results = [result for side in group.sides for _, result in group.results(side)]
    if not is_shown(results, group.pipelines):
        return ()
    return tuple(_line(group, side, name) for name in group.pipelines for side in group.sides)


def _line(group: Group, side: str, pipeline: str) -> AgreementLine:
    medians: list[float] = []
    compared, largest_m, largest_of = 0, None, ""
    for seed, result in group.results(side):
        found = [d for d in disagreements(scored_curves(result, pipeline)) if len(d.apart_m)]
        if not found:
            continue
        every = np.concatenate([d.apart_m for d in found])
        medians.append(float(np.median(every)))
        compared += len(every)
        for one in found:
            at = int(np.argmax(one.apart_m))
            if largest_m is None or one.apart_m[at] > largest_m:
                largest_m = float(one.apart_m[at])
                largest_of = f"{one.object_name}, {1e-9 * one.t_ns[at]:.1f} s"
                largest_of += f", seed {seed}" if len(group.runs) > 1 else ""
    return AgreementLine(
        words=pipeline_words(pipeline),
        side=side,
        compared=compared,
        median_m=float(np.mean(medians)) if medians else None,
        largest_m=largest_m,
        largest_of=largest_of if largest_m else "",
    )
