"""What a report shows of many results: groups of runs, and the one instant that stands for a group.

A group is a scenario, a system, a set of faults and the calibration that is told; its runs are seeds. A run
has up to two sides, the recording without injected errors and the one with them. The instant is a pair (scan,
camera) of one run: the one whose loss (baseline's TPR without errors less with errors) is the median over all
pairs that both sides have; of equal losses the one in the middle by pixel shift. So no picture is picked by
hand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simbench.case import ORACLE, Case, JobResult, Told
from simbench.exhibit import PairView
from simbench.score.mapping import PairScore

BASELINE, METHOD = "static_projection", "probabilistic"
Key = tuple[int, str, int]  # scan sequence number, camera, which of several targets


@dataclass(frozen=True, kw_only=True)
class Run:
    """One seed. `clean`: without injected errors, `faulted`: with; at least one of them."""

    seed: int
    clean: JobResult | None
    faulted: JobResult | None

    def side(self, name: str) -> JobResult | None:
        return self.clean if name == "clean" else self.faulted


@dataclass(frozen=True, kw_only=True)
class Group:
    """Runs that differ by seed only. `faults`: the fault set's label. `baseline`, `method`: names of
    pipelines; the method is None where only one pipeline ran. `told`: which calibration pipelines know."""

    scenario: str
    system: str
    faults: str
    runs: tuple[Run, ...]
    pipelines: tuple[str, ...]
    baseline: str
    method: str | None
    told: Told = "true"

    @property
    def sides(self) -> tuple[str, ...]:
        """'clean', 'faulted', or both: those that a run has."""
        return tuple(s for s in ("clean", "faulted") if any(run.side(s) is not None for run in self.runs))

    @property
    def main_side(self) -> str:
        """The side with errors if there is one."""
        return self.sides[-1]

    def results(self, side: str) -> tuple[tuple[int, JobResult], ...]:
        """(seed, result) of the runs that have this side."""
        return tuple((run.seed, r) for run in self.runs if (r := run.side(side)) is not None)

    def has_target(self) -> bool:
        return any(r.scenario.system(self.system).target is not None for _, r in self.results(self.sides[0]))


def groups_of(results: Sequence[JobResult]) -> tuple[Group, ...]:
    """Groups in the order of the results. A clean result belongs to every set of faults of its scenario,
    system and told calibration; where there is none it makes a group of its own."""
    labels: dict[tuple[str, str, Told], dict[str, None]] = {}
    for r in results:
        found = labels.setdefault((r.scenario.name, r.job.system, r.job.told), {})
        if len(r.faults):
            found[r.faults.label] = None
    return tuple(
        _group(label, [r for r in results if (r.scenario.name, r.job.system, r.job.told) == key])
        for key, by_label in labels.items()
        for label in by_label or {"none": None}
    )


def _group(label: str, ours: Sequence[JobResult]) -> Group:
    first = ours[0]
    clean = {r.job.seed: r for r in ours if not len(r.faults)}
    faulted = {r.job.seed: r for r in ours if len(r.faults) and r.faults.label == label}
    named = list(dict.fromkeys(name for r in ours for name in r.job.pipelines))
    baseline = BASELINE if BASELINE in named else named[0]
    others = [name for name in named if name != baseline]
    method = METHOD if METHOD in others else (others[-1] if others else None)
    return Group(
        scenario=first.scenario.name,
        system=first.job.system,
        faults=label,
        runs=tuple(
            Run(seed=s, clean=clean.get(s), faulted=faulted.get(s)) for s in sorted({*clean, *faulted})
        ),
        pipelines=tuple(named),
        baseline=baseline,
        method=method,
        told=first.job.told,
    )


def case_of(result: JobResult | None, pipeline: str | None) -> Case | None:
    """The case of a pipeline (or 'oracle'); None where it did not run."""
    cases = () if result is None else result.cases
    return next((c for c in cases if c.pipeline == pipeline), None)


def value_of(result: JobResult | None, pipeline: str | None, metric: str) -> float | None:
    """The value of a row; None where there is no such case or the row is null."""
    case = case_of(result, pipeline)
    rows = () if case is None else case.rows
    return next((row.value for row in rows if row.metric == metric), None)


def run_values(group: Group, side: str, pipeline: str | None, metric: str) -> dict[int, float | None]:
    """A metric's value by seed."""
    return {seed: value_of(r, pipeline, metric) for seed, r in group.results(side)}


def mean_of_runs(group: Group, side: str, pipeline: str | None, metric: str) -> float | None:
    """Equal-weight mean over the runs that have a value."""
    known = [v for v in run_values(group, side, pipeline, metric).values() if v is not None]
    return float(np.mean(known)) if known else None


def views_of(result: JobResult | None) -> Mapping[Key, PairView]:
    return {} if result is None else {(v.scan_seq, v.camera, v.target): v for v in result.views}


def pairs_of(result: JobResult | None, pipeline: str | None) -> Mapping[Key, PairScore]:
    """Pair scores; empty where the case has none."""
    case = case_of(result, pipeline)
    if case is None or case.scores is None:
        return {}
    return {(p.scan_seq, p.camera, p.target): p for p in case.scores.pairs}


@dataclass(frozen=True, kw_only=True)
class Instant:
    """One pair of one run. `loss`: TPR that the errors cost the baseline there, None with one side only.
    `of`: among how many pairs it was chosen."""

    run: Run
    key: Key
    loss: float | None
    of: int


def instants(group: Group) -> tuple[Instant, ...]:
    """All pairs of a group that can be shown, from the smallest loss to the largest.

    With one side only they are ordered by the baseline's TPR, best first. Empty without a target.
    """
    both = len(group.sides) == 2
    found = []
    for run in group.runs:
        side = run.side(group.main_side)
        scores, views = pairs_of(side, group.baseline), views_of(side)
        clean = pairs_of(run.clean, group.baseline) if both else scores
        clean_views = views_of(run.clean) if both else views
        for key, view in views.items():
            if key not in scores or key not in clean or key not in clean_views:
                continue
            loss = clean[key].tpr - scores[key].tpr if both else None
            rank = 1.0 - scores[key].tpr if loss is None else loss
            found.append(((round(rank, 9), _none_last(shift_px(view)), run.seed, *key), run, key, loss))
    found.sort(key=lambda item: item[0])
    return tuple(Instant(run=run, key=key, loss=loss, of=len(found)) for _, run, key, loss in found)


def median_and_worst(group: Group) -> tuple[Instant, Instant] | None:
    """The pair in the middle and the last one of `instants`."""
    found = instants(group)
    return (found[(len(found) - 1) // 2], found[-1]) if found else None


def shift_px(view: PairView) -> float | None:
    """From the target's true centre in the image to where its points project; None if either is unknown."""
    length = float(np.hypot(view.told_px[0] - view.true_px[0], view.told_px[1] - view.true_px[1]))
    return length if np.isfinite(length) else None


def _none_last(value: float | None) -> float:
    return float("inf") if value is None else round(value, 6)


__all__ = [
    "BASELINE",
    "METHOD",
    "ORACLE",
    "Group",
    "Instant",
    "Run",
    "case_of",
    "groups_of",
    "instants",
    "mean_of_runs",
    "median_and_worst",
    "pairs_of",
    "run_values",
    "shift_px",
    "value_of",
    "views_of",
]
