"""The per-object table of recorded data: every labelled object, and what each pipeline made of it.

A cell holds hit or miss (of a sequence: hits of pairs), the planar error of the position (mean over frames)
and the TPR. An object that is not scored says why. There is a table per fault set, without errors first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from simbench.case import ORACLE, JobResult
from simbench.formats.scene import RecordedScene
from simbench.report.choose import case_of
from simbench.report.words import NONE, fault_words, metres, percent, pipeline_words
from simbench.score.score import ObjectScore

MOST_LINES = 60  # on the page and in the terminal; objects.csv holds all


@dataclass(frozen=True, kw_only=True)
class ObjectCell:
    """One pipeline on one object. `mark`: hit, miss, '12 of 30', or NONE where it was not scored."""

    mark: str
    planar: str
    tpr: str
    good: bool


@dataclass(frozen=True, kw_only=True)
class ObjectLine:
    """One object. `facts`: how far, how many points, how visible. `why`: why it is not scored, else empty."""

    name: str
    facts: str
    why: str
    cells: tuple[ObjectCell, ...]


@dataclass(frozen=True, kw_only=True)
class ObjectTable:
    """All objects under one set of faults. `totals`: hit pairs of all pairs, by pipeline. `left_out`: lines
    beyond MOST_LINES."""

    title: str
    pipelines: tuple[str, ...]
    lines: tuple[ObjectLine, ...]
    totals: tuple[str, ...]
    left_out: int

    @property
    def heads(self) -> tuple[str, ...]:
        return tuple(pipeline_words(name) for name in self.pipelines)


def object_tables(results: Sequence[JobResult]) -> tuple[ObjectTable, ...]:
    """One table per scenario and fault set that has per-object scores, in the order of the results."""
    groups: dict[tuple[str, str], list[JobResult]] = {}
    for result in results:
        if any(case.scores is not None and case.scores.objects for case in result.cases):
            groups.setdefault((result.scenario.name, result.faults.label), []).append(result)
    ordered = sorted(groups.values(), key=lambda group: len(group[0].faults) > 0)
    return tuple(_table(group) for group in ordered)


def _table(results: Sequence[JobResult]) -> ObjectTable:
    first = results[0]
    pipelines = (*dict.fromkeys(name for r in results for name in r.job.pipelines), ORACLE)
    lines, hits, pairs = [], dict.fromkeys(pipelines, 0), dict.fromkeys(pipelines, 0)
    for result in results:
        by_pipeline = {name: _objects(result, name) for name in pipelines}
        known = next((objects for objects in by_pipeline.values() if objects), ())
        for number, one in enumerate(known):
            cells = []
            for name in pipelines:
                its = by_pipeline[name][number] if by_pipeline[name] else None
                cells.append(_cell(its))
                if its is not None:
                    hits[name] += its.hits
                    pairs[name] += its.pairs
            facts = _facts(one, _occlusion_known(result, number))
            lines.append(ObjectLine(name=one.name, facts=facts, why=one.why or "", cells=tuple(cells)))
    faults = fault_words(first.faults) if len(first.faults) else "no injected errors"
    return ObjectTable(
        title=f"{first.scenario.name}, {faults}",
        pipelines=pipelines,
        lines=tuple(lines[:MOST_LINES]),
        totals=tuple(f"{hits[name]} of {pairs[name]}" for name in pipelines),
        left_out=max(0, len(lines) - MOST_LINES),
    )


def _objects(result: JobResult, pipeline: str) -> tuple[ObjectScore, ...]:
    case = case_of(result, pipeline)
    return () if case is None or case.scores is None else case.scores.objects


def _occlusion_known(result: JobResult, number: int) -> bool:
    return not isinstance(result.scenario, RecordedScene) or result.scenario.objects[number].occlusion_known


def _facts(one: ObjectScore, occlusion_known: bool) -> str:
    far = NONE if one.distance_m is None else f"{one.distance_m:.1f} m"
    seen = f"{100 * one.visible_fraction:.0f} % visible" if occlusion_known else "occlusion unknown"
    return f"{far}, {one.points} points, {seen}"


def _cell(one: ObjectScore | None) -> ObjectCell:
    if one is None or not one.pairs:
        return ObjectCell(mark=NONE, planar=NONE, tpr=NONE, good=False)
    if one.pairs == 1:
        mark = "hit" if one.hits else "miss"
    else:
        mark = f"{one.hits} of {one.pairs}"
    return ObjectCell(
        mark=mark, planar=metres(one.planar_m), tpr=percent(one.tpr, 0), good=2 * one.hits > one.pairs
    )


def as_text(table: ObjectTable) -> str:
    """The table for a terminal: hit, planar error in metres, TPR in per cent."""
    names = [*(line.name for line in table.lines), "hit pairs"]
    facts = [*(line.why or line.facts for line in table.lines), ""]
    left, middle = max(map(len, names)) + 2, max(map(len, facts)) + 2
    marks = max((len(c.mark) for line in table.lines for c in line.cells), default=0)
    wide = max(15 + marks, *(len(name) + 2 for name in table.pipelines))
    rows = [
        f"{table.title}: hit, planar error (m), TPR (%)",
        " " * (left + middle) + "".join(f"{name:>{wide}s}" for name in table.pipelines),
    ]
    for line in table.lines:
        cells = [f"{c.mark} {c.planar:>6s} {c.tpr:>4s}" for c in line.cells]
        rows.append(
            f"{line.name:{left}s}{line.why or line.facts:{middle}s}" + "".join(f"{c:>{wide}s}" for c in cells)
        )
    rows.append(f"{'hit pairs':{left + middle}s}" + "".join(f"{t:>{wide}s}" for t in table.totals))
    if table.left_out:
        rows.append(f"{table.left_out} more objects in objects.csv")
    return "\n".join(rows)
