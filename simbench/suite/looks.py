"""`--until-decided`: run as many seeds as the verdicts need: 20, 40 or 80, and no other number.

A group stops when all of its metrics are decided; what is decided at a look stays so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from scenarios.errors import BadInput
from simbench.suite.judge import Key, compared
from simbench.suite.plan import Group
from simbench.suite.side import Side
from simbench.verdict.decide import Judgement
from simbench.verdict.sequential import LOOKS

Measure = Callable[[Sequence[tuple[Group, int]]], Side]
"""Runs cases that were not run yet; the side of all cases so far."""


def until_decided(
    groups: Sequence[Group], old: Side, measure: Measure
) -> tuple[Side, dict[Key, Judgement], int]:
    """The side of all that was run, every judgement, and the last look. BadInput: the baseline has fewer runs
    of a group than the first look takes."""
    seeds = {group.name: _shared(group, old) for group in groups}
    settled: dict[Key, Judgement] = {}
    undecided = {group.name for group in groups}
    side, last = None, LOOKS[0]
    for look in LOOKS:
        going = [group for group in groups if group.name in undecided and len(seeds[group.name]) >= look]
        if not going:
            break
        last = look
        side = measure([(group, seed) for group in going for seed in seeds[group.name][:look]])
        names = {group.name for group in going}
        found = compared(side, _trimmed(old, side), look, names)
        for key, judgement in found.items():
            if key not in settled or settled[key].verdict == "INCONCLUSIVE":
                settled[key] = judgement
        undecided = {name for name, _ in settled if settled[name, _].verdict == "INCONCLUSIVE"}
    assert side is not None
    return side, settled, last


def _shared(group: Group, old: Side) -> tuple[int, ...]:
    """The seeds to take, in order: those of the suite, then the others of the baseline."""
    if group.name not in old.groups:
        raise BadInput(f"the baseline has no group {group.name}; --until-decided needs all of them there")
    known = [int(seed) for seed in old.groups[group.name].runs]
    first = [seed for seed in group.seeds if seed in known]
    seeds = (*first, *(seed for seed in known if seed not in first))
    if len(seeds) < LOOKS[0]:
        raise BadInput(
            f"--until-decided looks at {', '.join(map(str, LOOKS))} runs, and the baseline has {len(seeds)} "
            f"of {group.name}; save one of a run with --seeds 0-{LOOKS[-1] - 1}"
        )
    return seeds


def _trimmed(old: Side, new: Side) -> Side:
    """The baseline with the runs that the new side has."""
    groups = {
        name: of.model_copy(update={"runs": {s: r for s, r in of.runs.items() if s in new.groups[name].runs}})
        for name, of in old.groups.items()
        if name in new.groups
    }
    return old.model_copy(update={"groups": groups})
