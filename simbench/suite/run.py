"""Running a suite's cases. A worker gives back what a recording adds to `result.json`, as text, and no more.

The text is the row of the ledger: the same for one worker, for many, and on a cluster, but for its timings.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

from scenarios.load import load_scenario
from simbench.campaign.ledger import Done
from simbench.case import ORACLE, JobResult, Status, failed
from simbench.results import record_of
from simbench.run import run_job
from simbench.stage import faults_of
from simbench.suite.plan import Group, Recording, recordings_of
from simbench.suite.side import Made, Side, side_of

RECORDING_S = "recording_s"
Record = Mapping[str, Sequence[Mapping[str, Any]]]
"""`rows`, `cases` and `timings` of one recording."""


def record_text(recording: Recording) -> str:
    """Run one recording; what it adds to `result.json`, with the block that it belongs to."""
    return _text(recording, run_job(recording.job))


def failed_text(recording: Recording, row: Done) -> str:
    """The record of a recording that no worker could make: a failed case for each of its pipelines."""
    job = recording.job
    family = load_scenario(job.scenario, job.changes)
    scenario = family.resolve(job.seed)
    why, status = row.failure or "no row", "timeout" if row.status == "timeout" else "bench_error"
    cases = tuple(failed(name, cast(Status, status), why) for name in (*job.pipelines, ORACLE))
    faults = faults_of(job, family, scenario)
    return _text(
        recording, JobResult(job=job, scenario=scenario, faults=faults, shake="", receipts=(), cases=cases)
    )


def _text(recording: Recording, result: JobResult) -> str:
    """block, and the fault's name in the suite, in every entry: they tell groups of one scenario apart."""
    mark = {"block": recording.block, "faults": recording.faults}
    record = {name: [{**entry, **mark} for entry in entries] for name, entries in record_of(result).items()}
    first = record["cases"][0]
    timing = {name: first[name] for name in ("block", "scenario", "system", "seed", "faults")}
    seconds = sum(result.timings_s.values())
    record["timings"].append({**timing, "metric": RECORDING_S, "value": seconds, "unit": "s"})
    return json.dumps(record, allow_nan=False)


def made_of(recordings: Sequence[Recording], records: Sequence[Record]) -> dict[str, dict[int, Made]]:
    """The cases by group and seed, with values and latencies; oracles are left out."""
    made: dict[str, dict[int, Made]] = {}
    for recording, record in zip(recordings, records, strict=True):
        values: dict[str, dict[str, float | None]] = {}
        for row in (*record["rows"], *record["timings"]):
            if "pipeline" in row:
                values.setdefault(row["pipeline"], {})[row["metric"]] = row["value"]
        groups = dict(zip(recording.job.pipelines, recording.groups, strict=True))
        for case in record["cases"]:
            if case["pipeline"] != ORACLE:
                one = Made(case=case, values=values.get(case["pipeline"], {}))
                made.setdefault(groups[case["pipeline"]], {})[recording.job.seed] = one
    return made


def in_order(groups: Iterable[Group], made: Mapping[str, Mapping[int, Made]]) -> dict[str, dict[int, Made]]:
    """The same, groups in the order of the suite and runs in the order of their seeds."""
    return {
        group.name: {seed: made[group.name][seed] for seed in sorted(made[group.name])}
        for group in groups
        if group.name in made
    }


def side_of_group(suite: str, group: Group) -> Side:
    """Run all seeds of one group here; its side."""
    recordings = recordings_of([(group, seed) for seed in group.seeds])
    records = [json.loads(record_text(recording)) for recording in recordings]
    made = in_order([group], made_of(recordings, records))
    return side_of(suite, {group.name: group}, made, whole=False)
