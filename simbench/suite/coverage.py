"""Which scenarios and faults a suite exercises, and which it does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.faults import FAULTS
from scenarios.load import list_scenarios, load_scenario
from scenarios.suite import load_suite
from simbench.stage import faults_of
from simbench.suite.plan import Group, described, groups_of

NONE = "none"


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """runs: by (scenario, fault), how many seeds; the fault `none` where a drive has no error. missing: what
    no group has."""

    scenarios: tuple[str, ...]
    faults: tuple[str, ...]
    runs: dict[tuple[str, str], int]
    missing_scenarios: tuple[str, ...]
    missing_faults: tuple[str, ...]


def coverage(groups: Sequence[Group]) -> Coverage:
    """Of all groups; a drive that two pipelines share counts once."""
    runs: dict[tuple[str, str], int] = {}
    seen = set()
    drives: dict[tuple[object, ...], tuple[str, ...]] = {}  # one that many blocks play is read once
    for group in groups:
        drive = (group.block, group.scenario, group.job.system, group.faults)
        if drive in seen:
            continue
        seen.add(drive)
        job = group.job
        played = (job.scenario, job.changes, job.system, job.faults, group.seeds[0])
        if played not in drives:
            family = load_scenario(job.scenario, job.changes)
            found = faults_of(job, family, family.resolve(group.seeds[0]))
            drives[played] = tuple(spec.name for spec in found) or (NONE,)
        for name in drives[played]:
            key = (group.scenario, name)
            runs[key] = runs.get(key, 0) + len(group.seeds)
    scenarios = tuple(dict.fromkeys(scenario for scenario, _ in runs))
    faults = tuple(sorted({fault for _, fault in runs} - {NONE}))
    return Coverage(
        scenarios=scenarios,
        faults=((NONE,) if any(fault == NONE for _, fault in runs) else ()) + faults,
        runs=runs,
        missing_scenarios=tuple(name for name in list_scenarios() if name not in scenarios),
        missing_faults=tuple(name for name in sorted(FAULTS) if name not in faults),
    )


def as_lines(found: Coverage) -> list[str]:
    """A table for a terminal: runs by scenario and fault, then what is not exercised."""
    width = max(len(name) for name in ("fault", *found.faults))
    lines = [" " * width + "  " + "  ".join(found.scenarios)]
    for fault in found.faults:
        cells = [str(found.runs.get((s, fault), "–")).rjust(len(s)) for s in found.scenarios]
        lines.append(f"{fault:{width}s}  " + "  ".join(cells))
    none = "none"
    return [
        *lines, f"scenarios not exercised: {', '.join(found.missing_scenarios) or none}",
        f"faults not exercised ({len(found.missing_faults)} of {len(FAULTS)}): "
        f"{', '.join(found.missing_faults) or none}",
    ]  # fmt: skip


def describe_suite(target: str) -> list[str]:
    """What a suite runs, what its groups must keep, and what it exercises. Raises BadInput."""
    file = load_suite(target)
    groups = groups_of(file)
    lines = [file.suite.description, "", described(file.suite, groups), ""]
    for group in groups:
        limits = ", ".join(limit.text for limit in group.limits) or "no limits"
        tags = f" [{', '.join(group.tags)}]" if group.tags else ""
        lines.append(f"{group.name}{tags}: {len(group.seeds)} seeds, {limits}")
    return [*lines, "", *as_lines(coverage(groups))]
