"""The rows of `fusion.py`: each pipeline over one recording, step by step."""

from __future__ import annotations

import argparse
import json
import os
import time
import tracemalloc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points

import cv2
import numpy as np

from fusion.messages import LidarScan
from fusion.pipeline import Pipeline
from simbench.case import Job
from simbench.plugins import load_pipeline
from simbench.recording import Recording
from simbench.stage import record, stage
from tests.benchmarks.cli import machine

SCENARIO, SYSTEM, SEED = "five-objects", "car", 0
WARM_UP = 3  # sweeps
BASE = "static_projection"  # the raw box: what the ratios are to
MUST_P50_MS = {"probabilistic": 10.0, "robust": 20.0}
MUST_P99_MS = {"probabilistic": 20.0}


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Per sweep: p50_ms, p99_ms; the median of each step; peak_mb: the most that was allocated at a time."""

    p50_ms: float
    p99_ms: float
    steps_ms: Mapping[str, float]
    peak_mb: float
    answers: int


@cache
def recorded(sweeps: int | None) -> Recording:
    """The scenario's drive without pictures; its first `sweeps` sweeps."""
    job = Job(scenario=SCENARIO, system=SYSTEM, seed=SEED, pipelines=())
    recording = record(job, stage(job)).recording
    if sweeps is None:
        return recording
    scans = [m.arrival_ns for m in recording.messages if isinstance(m, LidarScan)]
    end_ns = scans[min(sweeps, len(scans)) - 1]
    kept = tuple(m for m in recording.messages if m.arrival_ns <= end_ns)
    return Recording(
        calibration=recording.calibration, categories=recording.categories, messages=kept,
        truth=recording.truth,
    )  # fmt: skip


def cost(pipeline: Pipeline, recording: Recording) -> Cost:
    """CPU time of one pass over the recording, of all threads on one core, and the memory of another."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    cv2.setNumThreads(1)
    pipeline.reset(recording.calibration, recording.categories)
    spent, running_ns = [], 0
    for message in recording.messages:
        before = time.process_time_ns()
        answer = pipeline.update(message)
        running_ns += time.process_time_ns() - before
        if answer is not None:
            spent.append(running_ns)
            running_ns = 0
    timings: Mapping[str, Sequence[int]] = getattr(pipeline, "timings_ns", dict)()
    steps = {step: float(np.median(ns[WARM_UP:])) * 1e-6 for step, ns in timings.items() if len(ns) > WARM_UP}
    if len(spent) <= WARM_UP:
        raise SystemExit(f"fusion.py: {len(spent)} answers are too few to measure; give more --sweeps")
    per_sweep_ms = np.array(spent[WARM_UP:]) * 1e-6
    return Cost(
        p50_ms=float(np.median(per_sweep_ms)),
        p99_ms=float(np.quantile(per_sweep_ms, 0.99)),
        steps_ms=steps,
        peak_mb=_peak_mb(pipeline, recording),
        answers=len(spent),
    )


def ratio(c: Cost, base: Cost | None) -> float | None:
    """How many times the raw box's median time; None where that was not measured."""
    return None if base is None else c.p50_ms / base.p50_ms


def _peak_mb(pipeline: Pipeline, recording: Recording) -> float:
    tracemalloc.start()
    pipeline.reset(recording.calibration, recording.categories)
    for message in recording.messages[: len(recording.messages) // 3]:
        pipeline.update(message)
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return peak


def table(costs: Mapping[str, Cost]) -> str:
    """Text: a line per pipeline, and its steps below."""
    base = costs.get(BASE)
    lines = [f"{'pipeline':26s}{'p50 ms':>8s}{'p99 ms':>8s}{'x raw box':>11s}{'peak MB':>9s}  must"]
    for name, c in costs.items():
        times = ratio(c, base)
        text = f"{'':11s}" if times is None else f"{times:10.1f}x"
        lines.append(f"{name:26s}{c.p50_ms:8.1f}{c.p99_ms:8.1f}{text}{c.peak_mb:9.1f}  {_verdict(name, c)}")
        lines += [f"    {step:22s}{ms:8.2f}" for step, ms in c.steps_ms.items()]
    return "\n".join(lines)


def _verdict(name: str, c: Cost) -> str:
    said = []
    for value, must, what in ((c.p50_ms, MUST_P50_MS, "p50"), (c.p99_ms, MUST_P99_MS, "p99")):
        if name in must:
            kept = "yes" if value <= must[name] else "NO"
            said.append(f"{what} <= {must[name]:g} ms: {kept}")
    return ", ".join(said)


def main(arguments: Sequence[str]) -> int:
    known = sorted(entry.name for entry in entry_points(group="simbench.pipelines"))
    parser = argparse.ArgumentParser(prog="fusion.py", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one object on stdout")
    parser.add_argument("--only", nargs="+", choices=known, default=known, metavar="PIPELINE")
    parser.add_argument("--sweeps", type=int, default=None, help="only the first ones of the drive")
    options = parser.parse_args(arguments)
    if options.sweeps is not None and options.sweeps < 1:
        parser.error("--sweeps must be at least 1")
    recording = recorded(options.sweeps)
    costs = {name: cost(load_pipeline(name)(), recording) for name in options.only}
    if options.json:
        found: dict[str, object] = {"machine": machine()}
        for name, c in costs.items():
            found[f"{name}_p50_ms"], found[f"{name}_p99_ms"] = round(c.p50_ms, 3), round(c.p99_ms, 3)
            times = ratio(c, costs.get(BASE))
            found[f"{name}_vs_{BASE}"] = None if times is None else round(times, 3)
            found[f"{name}_peak_mb"] = round(c.peak_mb, 2)
            found[f"{name}_steps_ms"] = {step: round(ms, 3) for step, ms in c.steps_ms.items()}
        print(json.dumps(found, indent=2))
        return 0
    print(f"{SCENARIO}, {SYSTEM}, seed {SEED}; CPU time of one core ({machine()['cpu']})\n")
    print(table(costs))
    return 0
