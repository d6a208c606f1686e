"""A question about the folder of an earlier run: its scenario, seeds, faults and pipelines, as they were."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenarios.errors import Where
from scenarios.fault_set import parse_faults
from simbench.case import ORACLE, Job
from simbench.explain.causes import Question, causes_of, spelt_out
from simbench.timeline import cases_of_run


def question_of_run(
    folder: Path,
    *,
    system: str | None,
    pipelines: tuple[str, ...],
    seeds: Sequence[int] | None,
    chosen: Sequence[str],
) -> Question:
    """Why the runs in a folder are as they are: of one scenario and system (the first, or the given system)
    under one set of faults (the first that is not empty). pipelines, seeds: some of the run's own; empty or
    None: all of them. BadInput: it holds no such cases, or was told a calibration that was found.
    """
    where = Where(file=str(folder / "result.json"))
    cases = [case for case in cases_of_run(folder) if case.get("pipeline") != ORACLE]
    fitting = [case for case in cases if system in (None, case["system"])]
    first = next((case for case in fitting if case["fault_specs"]), fitting[0] if fitting else None)
    if first is None:
        had = ", ".join(sorted({case["system"] for case in cases}))
        raise where.error(f"holds no case of {system or 'any system'}", allowed=had or "none")
    if first.get("calibration", "true") != "true":
        raise where.error(
            "was told a calibration that was found; explain takes runs that are told the true one"
        )
    mine = [case for case in fitting if _key(case) == _key(first)]
    had_seeds = sorted({case["seed"] for case in mine})
    had_pipelines = tuple(dict.fromkeys(str(case["pipeline"]) for case in mine))
    for name in pipelines:
        if name not in had_pipelines:
            raise where.unknown("pipeline", name, had_pipelines)
    for seed in seeds or ():
        if seed not in had_seeds:
            raise where.error(f"holds no case of seed {seed}", allowed=", ".join(map(str, had_seeds)))
    by_seed = {case["seed"]: case for case in mine}
    asked = had_seeds if seeds is None else list(seeds)
    sets = {
        seed: parse_faults(by_seed[seed]["fault_specs"], where.at("cases"), label=first["faults"])
        for seed in asked
    }
    off = tuple(first.get("off", ()))
    whole = {
        seed: Job(
            scenario=str(folder / f"scenario-{first['scenario']}-{seed}.yaml"),
            system=first["system"],
            seed=seed,
            pipelines=pipelines or had_pipelines,
            faults=spelt_out(sets[seed]),
            boxes=first.get("boxes"),
            off=off,
        )
        for seed in asked
    }
    return Question(
        title=f"{first['scenario']}, {first['system']}",
        whole=whole,
        causes=causes_of(sets.values(), off, chosen),
    )


def _key(case: dict[str, Any]) -> tuple[str, str, str, str]:
    return case["scenario"], case["system"], case["faults"], case.get("calibration", "true")
