"""What recordings add to `result.json`, as `docs/results.md` describes it; the tables beside it."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fusion.check import digest
from scenarios.describe import describe
from scenarios.scenario import Scenario
from simbench.case import ORACLE, Boxes, Case, Job, JobResult, boxes_of
from simbench.drive import Driven
from simbench.files import write_text
from simbench.formats.scene import as_yaml
from simbench.formats.targets import is_stored
from simbench.isolate.limits import DEFAULT
from simbench.result_file import write_result


def record_of(result: JobResult) -> dict[str, list[dict[str, Any]]]:
    """What one recording adds to `result.json`: its rows, cases and timings."""
    return {
        "rows": [row for case in result.cases for row in _rows(result, case)],
        "cases": [_case(result, case) for case in result.cases],
        "timings": [row for case in result.cases for row in timing_rows(_key(result, case), case)],
    }


def write(results: Sequence[JobResult], out: Path, environment: Mapping[str, object]) -> None:
    """Write result.json, pairs.csv, frames.csv and the resolved scenarios into `out`; objects.csv where every
    object of a recording is scored. Same inputs, same content, but for `timings` and `environment`."""
    write_result(out, map(record_of, results), environment)
    write_text(out / "pairs.csv", _table(results, "pairs"))
    write_text(out / "frames.csv", _table(results, "frames"))
    if any(case.scores is not None and case.scores.objects for r in results for case in r.cases):
        write_text(out / "objects.csv", _table(results, "objects"))
    for result in results:
        name = f"scenario-{result.scenario.name}-{result.job.seed}.yaml"
        write_text(out / name, _text(result))


def reproduce(job: Job, pipelines: Iterable[str]) -> str:
    """The command that makes this case again."""
    words = ["simbench", "run", job.scenario, "--system", job.system]
    for name in pipelines:
        words += ["--pipeline", name]
    if not is_stored(job.scenario):
        words += ["--seeds", str(job.seed)]
    for text in job.faults:
        words += ["--faults", text]
    for text in job.changes:
        words += ["--set", text]
    if job.faults != ("none",):
        words.append("--alone")  # this case only, not the same drive with errors off
    for text in job.off:
        words += ["--off", text]
    if job.boxes is not None:
        words += ["--boxes", job.boxes]
    if job.frames is not None:
        words += ["--frames", f"{job.frames[0]}-{job.frames[1]}"]
    if job.calibration != "true":
        words += ["--calibration", job.calibration]
    if job.size_px is not None:
        words += ["--size", f"{job.size_px[0]}x{job.size_px[1]}"]
    if job.isolate != "users":
        words += ["--isolate", job.isolate]
    for option, given, usual in (
        ("--message-timeout", job.limits.message_s, DEFAULT.message_s),
        ("--case-timeout", job.limits.case_s, DEFAULT.case_s),
        ("--memory", job.limits.memory_mb, DEFAULT.memory_mb),
    ):
        if given != usual:
            words += [option, f"{given:g}" if isinstance(given, float) else str(given)]
    return shlex.join([*words, "--images", job.images])


def scenario_hash(result: JobResult) -> str:
    """SHA-256 of the concrete scenario's text and its faults."""
    text = _text(result) + json.dumps(result.faults.as_data(), sort_keys=True)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def outputs_hash(driven: Driven) -> str:
    """SHA-256 of all that a pipeline gave, whatever time it took."""
    return digest((driven.outputs, driven.trajectories))


def _text(result: JobResult) -> str:
    """What was played, in full; of recorded data what it was and the hash of its files."""
    played = result.scenario
    return describe(played) if isinstance(played, Scenario) else as_yaml(played)


def _key(result: JobResult, case: Case) -> dict[str, Any]:
    return {
        "scenario": result.scenario.name,
        "system": result.job.system,
        "pipeline": case.pipeline,
        "seed": result.job.seed,
        "faults": result.faults.label,
        "calibration": result.job.told,
    }


def _rows(result: JobResult, case: Case) -> Iterable[dict[str, Any]]:
    for row in case.rows:
        entry = {**_key(result, case), "metric": row.metric, "value": row.value, "unit": row.unit}
        entry |= {"better": row.better, "n": row.n, "sd": row.sd}
        yield entry if row.value is not None else {**entry, "why": row.why}


def _case(result: JobResult, case: Case) -> dict[str, Any]:
    pipelines = result.job.pipelines if case.pipeline == ORACLE else (case.pipeline,)
    return {
        **_key(result, case),
        "status": case.status,
        "why": case.why,
        "outputs_sha256": None if case.driven is None else outputs_hash(case.driven),
        "scenario_sha256": scenario_hash(result),
        "fault_specs": result.faults.as_data(),
        "off": list(result.job.off),
        "shake": result.shake,
        "receipts": [dataclasses.asdict(receipt) for receipt in result.receipts],
        "boxes": _boxes(result),
        "command": reproduce(result.job, pipelines),
    }


def _boxes(result: JobResult) -> Boxes:
    """Where detections came from."""
    played = result.scenario
    return boxes_of(result.job, recorded=False) if isinstance(played, Scenario) else played.boxes


def latency_ms(case: Case) -> dict[str, tuple[float, int]]:
    """`latency_ms.p50`, `.p99` per scan and `.<step>.p50`, each with its count. The first scan warms up."""
    if case.driven is None or len(case.driven.scan_ms) < 2:
        return {}
    scans = np.array(case.driven.scan_ms[1:])
    values = {f"latency_ms.p{q}": (float(np.percentile(scans, q)), len(scans)) for q in (50, 99)}
    for step, spent_ns in case.driven.step_ns.items():
        if spent_ns:
            values[f"latency_ms.{step}.p50"] = (float(np.median(spent_ns)) * 1e-6, len(spent_ns))
    return values


def timing_rows(key: Mapping[str, Any], case: Case) -> Iterable[dict[str, Any]]:
    """Entries of `timings` under a case's key."""
    for metric, (value, n) in latency_ms(case).items():
        yield {**key, "metric": metric, "value": value, "unit": "ms", "better": "lower", "n": n}


def _table(results: Sequence[JobResult], what: str) -> str:
    """Per-pair or per-frame values of every case as CSV."""
    lines: list[dict[str, Any]] = []
    for result in results:
        for case in result.cases:
            for item in getattr(case.scores, what, ()) if case.scores is not None else ():
                values = dataclasses.asdict(item)
                lines.append({**_key(result, case), **{k: _flat(v) for k, v in values.items()}})
    text = io.StringIO()
    if lines:
        writer = csv.DictWriter(text, fieldnames=list(lines[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)
    return text.getvalue()


def _flat(value: Any) -> Any:
    if isinstance(value, dict | tuple | list):
        return json.dumps(value)
    return value
