"""Running a suite's cases. A worker gives back what a recording adds to `result.json`, as text, and no more.

The text is the row of the ledger: the same for one worker, for many, and on a cluster, but for its timings.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import cast

from scenarios.load import load_scenario
from simbench.campaign.ledger import Done
from simbench.case import ORACLE, JobResult, Status, failed
from simbench.result_file import Record
from simbench.results import record_of
from simbench.run import run_job
from simbench.stage import faults_of
from simbench.suite.plan import Group, Recording, recordings_of
from simbench.suite.side import Ran, Side, ran_of, side_of

RECORDING_S = "recording_s"


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


def runs_of(recording: Recording, record: Record, groups: Mapping[str, Group]) -> dict[str, Ran]:
    """What gates read of one recording, by the name of the group; oracles are left out."""
    values: dict[str, dict[str, float | None]] = {}
    for row in (*record["rows"], *record["timings"]):
        if "pipeline" in row:
            values.setdefault(row["pipeline"], {})[row["metric"]] = row["value"]
    names = dict(zip(recording.job.pipelines, recording.groups, strict=True))
    return {
        names[case["pipeline"]]: ran_of(
            groups[names[case["pipeline"]]], case, values.get(case["pipeline"], {})
        )
        for case in record["cases"]
        if case["pipeline"] != ORACLE
    }


def seconds_of(record: Record) -> float:
    """How long a recording took to make, with all of its pipelines."""
    return sum(timing["value"] for timing in record["timings"] if timing["metric"] == RECORDING_S)


def side_of_group(suite: str, group: Group) -> Side:
    """Run all seeds of one group here; its side."""
    ran = {}
    for recording in recordings_of([(group, seed) for seed in group.seeds]):
        record = json.loads(record_text(recording))
        ran[recording.job.seed] = runs_of(recording, record, {group.name: group})[group.name]
    return side_of(suite, [group], {group.name: ran}, whole=False)
