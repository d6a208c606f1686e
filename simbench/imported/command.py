"""`simbench run mcap:PATH`: pipelines on a drive that nobody knows the truth of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from fusion.messages import CameraImage, LidarScan
from scenarios.errors import BadInput
from simbench.case import Case, failed
from simbench.drive import Driven
from simbench.environment import environment
from simbench.files import prepare_folder
from simbench.formats.ros2.read import import_ros2, mcap_of
from simbench.formats.ros2.topics import default_map, load_topics
from simbench.formats.targets import MCAP
from simbench.imported.consistency import consistency, period_ns
from simbench.isolate.ask import reads_images
from simbench.isolate.limits import Isolate, Limits
from simbench.log import Log
from simbench.outcome import exit_code
from simbench.result_file import Record, print_result, write_result
from simbench.results import outputs_hash, timing_rows
from simbench.run import driven
from simbench.score.contract import ContractError, check_output, check_trajectories
from simbench.score.metrics import Row

NO_TRUTH = (
    "No truth is known of this drive: these numbers say whether answers agree with each other and with the "
    "boxes, not whether they are right."
)


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What `simbench run mcap:PATH` was asked. topics: a map's file; None: simbench wrote the bag."""

    target: str
    topics: Path | None
    pipelines: tuple[str, ...]
    out: Path
    isolate: Isolate
    limits: Limits
    as_json: bool
    command: str


def run_imported(asked: Asked) -> int:
    """The exit code: 0 all ran, 1 a pipeline failed. Raises BadInput."""
    path = Path(asked.target.removeprefix(MCAP))
    file = mcap_of(path)
    imported = import_ros2(path, default_map(file) if asked.topics is None else load_topics(asked.topics))
    log = imported.log
    if not any(reads_images(name) for name in asked.pipelines):
        kept = tuple(m for m in log.messages if not isinstance(m, CameraImage))
        log = replace(log, messages=kept)
    if not log.messages:
        raise BadInput("holds no message of a sensor that the topic map names", file=str(file))
    prepare_folder(asked.out)
    records, statuses = [], []
    for name in asked.pipelines:
        case, rows = _case(name, log, asked)
        records.append(_record(asked, file.stem, case, rows))
        statuses.append(case.status)
    write_result(asked.out, records, environment("none"), imported={"notes": list(imported.notes)})
    if asked.as_json:
        print_result(asked.out)
    else:
        _print(log, imported.notes, records)
    return exit_code(statuses)


def _case(name: str, log: Log, asked: Asked) -> tuple[Case, tuple[Row, ...]]:
    found = driven(name, log, asked.isolate, asked.limits)
    if isinstance(found, Case):
        return found, ()
    try:
        _check(log, found)
    except ContractError as error:
        return failed(name, "pipeline_error", str(error)), ()
    rows = consistency(log, found.outputs, found.trajectories)
    return Case(pipeline=name, status="ok", why=None, rows=rows, scores=None, driven=found), rows


def _check(log: Log, found: Driven) -> None:
    """ContractError: an answer to no sweep, or one that breaks the contract."""
    scans = {(m.sensor, m.seq): m for m in log.messages if isinstance(m, LidarScan)}
    answered: set[tuple[str, int]] = set()
    for output in found.outputs:
        key = (output.scan_sensor, output.scan_seq)
        if key not in scans:
            raise ContractError(f"There is an output for scan {key}, which was never delivered.")
        check_output(scans[key], output, period_ns=period_ns(log), answered=answered)
        answered.add(key)
    check_trajectories(found.trajectories)


def _record(asked: Asked, name: str, case: Case, rows: Sequence[Row]) -> Record:
    key = {
        "scenario": name, "system": "imported", "pipeline": case.pipeline, "seed": 0, "faults": "none",
        "calibration": "true",
    }  # fmt: skip
    about: Mapping[str, Any] = {
        **key, "status": case.status, "why": case.why,
        "outputs_sha256": None if case.driven is None else outputs_hash(case.driven), "truth": False,
        "command": asked.command,
    }  # fmt: skip
    entries = [
        {
            **key, "metric": row.metric, "value": row.value, "unit": row.unit, "better": row.better,
            "n": row.n, "sd": row.sd, **({} if row.why is None else {"why": row.why}),
        }
        for row in rows
    ]  # fmt: skip
    return {"rows": entries, "cases": [about], "timings": list(timing_rows(key, case))}


def _print(log: Log, notes: Sequence[str], records: Sequence[Record]) -> None:
    sensors = sorted({(message.sensor, type(message).__name__) for message in log.messages})
    for sensor, kind in sensors:
        count = sum(m.sensor == sensor and type(m).__name__ == kind for m in log.messages)
        click.echo(f"{sensor}: {count} {kind}")
    for note in notes:
        click.echo(f"note: {note}")
    for record in records:
        (case,) = record["cases"]
        click.echo(f"\n{case['pipeline']}: {case['status']}{': ' + case['why'] if case['why'] else ''}")
        for row in record["rows"]:
            value = f"{row['value']:.4g} {row['unit']}" if row["value"] is not None else f"- ({row['why']})"
            click.echo(f"  {row['metric']:20s} {value}  (n = {row['n']})")
        for row in record["timings"]:
            click.echo(f"  {row['metric']:20s} {row['value']:.1f} ms")
    click.echo(f"\n{NO_TRUTH}")
