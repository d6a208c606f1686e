"""`simbench score`: write a recording's messages, or score what was computed from them elsewhere."""

from __future__ import annotations

from pathlib import Path

import click

from simbench.case import Case, Job, JobResult, scored
from simbench.drive import Driven
from simbench.elsewhere.messages import messages_as_bytes
from simbench.elsewhere.outputs import read_outputs
from simbench.elsewhere.positions import score_positions
from simbench.elsewhere.ros2 import read_detections3d
from simbench.elsewhere.table import read_table
from simbench.environment import environment
from simbench.files import prepare_folder, write_bytes
from simbench.formats.ros2.read import mcap_of
from simbench.outcome import exit_code
from simbench.result_file import Record, write_result
from simbench.results import record_of
from simbench.run import Made, mismatch, recording_of, spoiled
from simbench.score.objects import score_objects

MESSAGES = "messages.sbf"


def write_messages(job: Job, out: Path) -> Path:
    """Write the messages of a job into a folder. Raises BadInput."""
    prepare_folder(out)
    _, _, made = recording_of(job)
    path = out / MESSAGES
    write_bytes(path, messages_as_bytes(made.recording))
    return path


def score_results(job: Job, results: Path, out: Path, command: str) -> tuple[Record, int]:
    """Score a file of results on the recording of a job: what OUT/result.json is written of, and the exit
    code. Raises BadInput."""
    prepare_folder(out)
    scenario, faults, made = recording_of(job)
    case = _case(results, made)
    result = JobResult(
        job=job, scenario=scenario, faults=faults, shake=made.shake, receipts=made.receipts, cases=(case,)
    )
    record = record_of(result)
    for entry in record["cases"]:
        entry["command"] = command
    write_result(out, [record], environment(job.images))
    return record, exit_code([case.status])


def _case(results: Path, made: Made) -> Case:
    if results.suffix.lower() == ".csv":
        scores = score_positions(made.recording, read_table(results), str(results))
        case = scored(results.name, scores, None)
    elif results.suffix.lower() == ".mcap" or results.is_dir():
        file = mcap_of(results)
        scores = score_positions(made.recording, read_detections3d(file, made.recording), str(file))
        case = scored(results.name or file.name, scores, None)
    else:
        outputs, trajectories = read_outputs(results, made.recording)
        driven = Driven(outputs=outputs, trajectories=trajectories, scan_ms=(), step_ns={})
        case = scored(results.name, score_objects(made.recording, outputs, trajectories), driven)
    why = mismatch(made.receipts)
    return spoiled(case, why) if why else case


def print_rows(record: Record) -> None:
    """One line for each metric; the reason where there is no number."""
    width = max(len(row["metric"]) for row in record["rows"])
    for row in record["rows"]:
        value = f"{row['value']:.6g} {row['unit']}" if row["value"] is not None else f"- ({row['why']})"
        click.echo(f"{row['metric']:{width}s}  {value}")
