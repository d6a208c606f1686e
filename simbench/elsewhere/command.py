"""`simbench score`: write a recording's messages, or score what was computed from them elsewhere."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from simbench import results as result_files
from simbench.case import Case, Job, JobResult, scored
from simbench.drive import Driven
from simbench.elsewhere.messages import messages_as_bytes
from simbench.elsewhere.outputs import read_outputs
from simbench.environment import environment
from simbench.faults.receipt import MISMATCH
from simbench.files import prepare_folder, write_bytes, write_text
from simbench.outcome import exit_code
from simbench.run import Made, recording_of, spoiled
from simbench.score.objects import score_objects

MESSAGES = "messages.sbf"


def write_messages(job: Job, out: Path) -> Path:
    """Write the messages of a job into a folder. Raises BadInput."""
    prepare_folder(out)
    _, _, made = recording_of(job)
    path = out / MESSAGES
    write_bytes(path, messages_as_bytes(made.recording))
    return path


def score_results(job: Job, results: Path, out: Path, command: str) -> tuple[dict[str, Any], int]:
    """Score a file of results on the recording of a job: what is written as OUT/result.json, and the exit
    code. Raises BadInput."""
    prepare_folder(out)
    scenario, faults, made = recording_of(job)
    case = _case(results, made)
    result = JobResult(
        job=job, scenario=scenario, faults=faults, shake=made.shake, receipts=made.receipts, cases=(case,)
    )
    content = result_files.document([result], environment(job.images))
    for entry in content["cases"]:
        entry["command"] = command
    write_text(out / "result.json", json.dumps(content, indent=1, allow_nan=False) + "\n")
    return content, exit_code([case.status])


def _case(results: Path, made: Made) -> Case:
    outputs, trajectories = read_outputs(results, made.recording)
    bad = [receipt for receipt in made.receipts if receipt.status == MISMATCH]
    driven = Driven(outputs=outputs, trajectories=trajectories, scan_ms=(), step_ns={})
    case = scored(results.name, score_objects(made.recording, outputs, trajectories), driven)
    return spoiled(case, bad) if bad else case


def print_rows(content: dict[str, Any]) -> None:
    """One line for each metric; the reason where there is no number."""
    width = max(len(row["metric"]) for row in content["rows"])
    for row in content["rows"]:
        value = f"{row['value']:.6g} {row['unit']}" if row["value"] is not None else f"- ({row['why']})"
        click.echo(f"{row['metric']:{width}s}  {value}")
