"""One case from scenario to record, on one screen. Suites, stress and demo are this, called many times.

A `Job` makes one recording and runs every pipeline on it: a case is a job and a pipeline.
"""

from __future__ import annotations

import time
import traceback

from simbench.capture import Captured
from simbench.case import ORACLE, Case, Job, JobResult, failed, scored
from simbench.drive import drive
from simbench.exhibit import pair_views
from simbench.faults.draw import shake_words
from simbench.faults.proof import receipts
from simbench.faults.receipt import MISMATCH, Receipt
from simbench.plugins import load_pipeline
from simbench.score.contract import ContractError
from simbench.score.oracle import score_oracle
from simbench.score.score import score
from simbench.sensors.pictures import TakePicture
from simbench.stage import Stage, pictures, record, stage


def run_job(job: Job) -> JobResult:
    """Scenario -> world -> motion -> sensors -> recording -> pipelines -> scores.

    Raises BadInput, and gl.RenderingUnavailable where pictures are wanted and nothing can draw. What goes
    wrong in a pipeline becomes the status of its case, what goes wrong in the bench that of all of them.
    """
    clock = Clock()
    staged = stage(job)
    clock.lap("world")
    with pictures(job, staged) as picture:
        try:
            return _record_and_score(job, staged, picture, clock)
        except Exception as error:  # a bug of ours must not end the other jobs, nor pass for a result
            why = _last_line(error)
            cases = tuple(failed(name, "bench_error", why) for name in (*job.pipelines, ORACLE))
            return JobResult(
                job=job, scenario=staged.scenario, faults=staged.faults, shake="", receipts=(), cases=cases
            )


def _record_and_score(job: Job, staged: Stage, picture: TakePicture | None, clock: Clock) -> JobResult:
    captured = record(job, staged, picture)
    clock.lap("sensors")
    found = receipts(captured, staged.rig, staged.faults, staged.system.duration_s)
    clock.lap("receipts")
    cases = [run_case(name, captured) for name in job.pipelines]
    clock.lap("fusion and scores")
    if staged.system.target is not None:
        cases.append(scored(ORACLE, score_oracle(captured.recording), None))
    driven = {case.pipeline: case.driven.outputs for case in cases if case.driven is not None}
    views = pair_views(captured.recording, driven)
    clock.lap("oracle and views")
    bad = [receipt for receipt in found if receipt.status == MISMATCH]
    return JobResult(
        job=job,
        scenario=staged.scenario,
        faults=staged.faults,
        shake=shake_words(captured.drawn, staged.system.duration_s),
        receipts=found,
        cases=tuple(_spoiled(case, bad) if bad else case for case in cases),
        views=views,
        timings_s=clock.laps,
    )


def run_case(name: str, captured: Captured) -> Case:
    """One pipeline on one recording; what it does wrong is its status, never ours."""
    recording = captured.recording
    try:
        pipeline = load_pipeline(name)()
        driven = drive(pipeline, recording.calibration, recording.categories, recording.messages)
    except Exception as error:  # a user's pipeline may raise anything
        return failed(name, "pipeline_error", _last_line(error))
    try:
        return scored(name, score(recording, driven.outputs, driven.trajectories), driven)
    except ContractError as error:
        return failed(name, "pipeline_error", str(error))


def _spoiled(case: Case, bad: list[Receipt]) -> Case:
    """A receipt that does not match makes every number of the recording void."""
    names = ", ".join(f"{r.fault} {r.quantity}" for r in bad)
    return failed(case.pipeline, "receipt_mismatch", f"receipt does not match: {names}")


def _last_line(error: Exception) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} (line {place.lineno} of {place.name})"


class Clock:
    """Seconds between laps."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now
