"""What may be to blame: every fault of a run, and what the bench itself does (`switches.py`); and the run
with only some of them.

A cause that is off is as if it had never been mentioned; the others keep every one of their draws, because
each draws from a stream of its own. So the runs of one seed differ by their causes alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from scenarios.errors import BadInput, Where
from scenarios.fault_set import NONE, FaultSet
from scenarios.load import load_scenario
from simbench.case import Boxes, Job
from simbench.stage import faults_of
from simbench.switches import SWITCHES

OPTION = "--cause"


@dataclass(frozen=True, kw_only=True)
class Question:
    """What is explained. `whole`: by seed, the run with every cause on; its faults are spelt out one by one
    after 'none'. causes: those that are switched, in order; all else stays as it is."""

    title: str
    whole: Mapping[int, Job]
    causes: tuple[str, ...]

    @property
    def seeds(self) -> tuple[int, ...]:
        return tuple(self.whole)

    @property
    def pipelines(self) -> tuple[str, ...]:
        return next(iter(self.whole.values())).pipelines

    def job(self, seed: int, active: Sequence[str]) -> Job:
        """The run of a seed with only these of the causes."""
        whole, off = self.whole[seed], [name for name in self.causes if name not in active]
        kept = tuple(text for text in whole.faults if text.partition("=")[0] not in off)
        return replace(
            whole, faults=kept, off=(*whole.off, *(name for name in SWITCHES if name in off))
        )  # fmt: skip


def spelt_out(faults: FaultSet) -> tuple[str, ...]:
    """A set as `--faults` takes it: these faults and no others."""

    def fields(name: str, data: Mapping[str, object]) -> str:
        return f"{name}={json.dumps(data)}"

    return (NONE, *(fields(name, data) for name, data in faults.as_data().items()))


def question_of_scenario(
    scenario: str,
    *,
    system: str | None,
    pipelines: tuple[str, ...],
    faults: tuple[str, ...],
    changes: tuple[str, ...],
    boxes: Boxes | None,
    seeds: Sequence[int],
    chosen: Sequence[str],
) -> Question:
    """Why a scenario's runs are as they are. `chosen`: the causes asked about; empty: all. BadInput."""
    if scenario.startswith("kitti:"):
        raise BadInput("recorded data cannot be explained: what happened then cannot be switched off")
    family = load_scenario(scenario, changes)
    template = Job(
        scenario=scenario, system=system or family.system_names[0], seed=0, pipelines=pipelines,
        faults=faults, boxes=boxes, changes=changes,
    )  # fmt: skip
    if template.system not in family.system_names:
        raise family.where.unknown("system", template.system, family.system_names, ("systems",))
    sets = {seed: faults_of(template, family, family.resolve(seed)) for seed in seeds}
    whole = {seed: replace(template, seed=seed, faults=spelt_out(own)) for seed, own in sets.items()}
    return Question(
        title=f"{family.name}, {template.system}", whole=whole, causes=causes_of(sets.values(), (), chosen)
    )


def causes_of(sets: Iterable[FaultSet], off: Sequence[str], chosen: Sequence[str]) -> tuple[str, ...]:
    """All causes of runs with these faults where `off` is off already, or those `chosen` among them.
    BadInput."""
    found = sorted({spec.name for faults in sets for spec in faults})
    known = (*found, *(name for name in SWITCHES if name not in off))
    for name in chosen:
        if name not in known:
            raise Where(file=OPTION).unknown("cause", name, known)
    return tuple(name for name in known if name in chosen) if chosen else known
