"""What a pipeline costs: milliseconds a scan and memory, measured one after the other on one drive.

Times differ from machine to machine and from time to time: they stand beside the reproduction, not in its
ledger, and nothing is decided by them.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusion.pipeline import Pipeline
from simbench.drive import drive
from simbench.plugins import load_pipeline
from simbench.recording import Recording


@dataclass(frozen=True, kw_only=True)
class Cost:
    """scan_ms: median per scan, all its updates; step_ms: the same by step, where the pipeline has a clock.
    peak_mb: the most that Python and NumPy held at a time, beyond the recording."""

    scan_ms: float
    step_ms: Mapping[str, float]
    peak_mb: float


def cost_of(pipeline: str, recording: Recording) -> Cost:
    """Drive it three times: warm, timed, and with its memory counted."""
    log, made = recording.log, load_pipeline(pipeline)

    def again(one: Pipeline) -> Sequence[float]:
        return drive(one, log.calibration, log.categories, log.messages).scan_ms

    again(made())
    timed = drive(made(), log.calibration, log.categories, log.messages)
    tracemalloc.start()
    try:
        again(made())
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return Cost(
        scan_ms=float(np.median(timed.scan_ms)),
        step_ms={step: float(np.median(ns)) * 1e-6 for step, ns in timed.step_ns.items() if len(ns)},
        peak_mb=peak / 1e6,
    )
