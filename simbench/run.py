"""One case from scenario to record, on one screen. Suites, stress and demo are this, called many times.

A `Job` makes one recording and runs every pipeline on it: a case is a job and a pipeline.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet
from scenarios.scenario import Scenario
from simbench.case import ORACLE, Case, Job, JobResult, failed, scored
from simbench.distances import Distances, distances
from simbench.drive import Driven, drive
from simbench.exhibit import PairView, pair_views
from simbench.faults.draw import shake_words
from simbench.faults.proof import receipts
from simbench.faults.receipt import MISMATCH, Receipt
from simbench.formats.jobs import play_job
from simbench.formats.recorded import Recorded
from simbench.formats.scene import RecordedScene
from simbench.formats.targets import is_recorded
from simbench.isolate.ask import runs_apart
from simbench.isolate.drive import drive_isolated
from simbench.isolate.limits import DEFAULT, Failed, Isolate, Limits, TimedOut
from simbench.log import Log
from simbench.plugins import last_line, load_pipeline
from simbench.recording import Recording
from simbench.score.contract import ContractError
from simbench.score.objects import score_objects, score_oracles
from simbench.score.pairs import frames_and_pairs
from simbench.sensors.pictures import TakePicture
from simbench.stage import Stage, as_told, camera_of, pictures, record, stage


def run_job(job: Job) -> JobResult:
    """Scenario -> world -> motion -> sensors -> recording -> pipelines -> scores. Of recorded data
    (`kitti:PATH`): files -> recording -> pipelines -> scores.

    Raises BadInput, and gl.RenderingUnavailable where pictures are wanted and nothing can draw. What goes
    wrong in a pipeline becomes the status of its case, what goes wrong in the bench that of all of them.
    """
    clock = Clock()
    if is_recorded(job.scenario):
        played = play_job(job)
        clock.lap("files")
        result = _guarded(job, played.scene, played.faults, lambda: _whole(played), clock)
        frames_and_pairs.cache_clear()  # a sequence may be large: none is kept beside the next
        return result
    staged = stage(job)
    clock.lap("world")
    with pictures(job, staged) as picture:
        return _guarded(
            job, staged.scenario, staged.faults, lambda: _record(job, staged, picture, clock), clock
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """A recording, simulated or read, and what proves its faults."""

    recording: Recording
    receipts: tuple[Receipt, ...]
    shake: str


def _whole(played: Recorded) -> Made:
    """BadInput: a part of the recording is missing. No number is ever made of the rest."""
    if played.missing:
        raise BadInput(f"INCOMPLETE: {'; '.join(played.missing)}")
    return Made(recording=played.recording, receipts=played.receipts, shake=played.shake)


def _record(job: Job, staged: Stage, picture: TakePicture | None, clock: Clock) -> Made:
    captured = record(job, staged, picture)
    clock.lap("sensors")
    found = receipts(captured, staged.rig, staged.faults, staged.system.duration_s, staged.refits)
    clock.lap("receipts")
    shake = shake_words(captured.drawn, staged.faults, staged.system.duration_s)
    recording = as_told(job, staged, captured.recording)
    return Made(recording=recording, receipts=found, shake=shake)


def recording_of(
    job: Job, beside: Callable[[TakePicture], TakePicture] = lambda take: take
) -> tuple[Scenario | RecordedScene, FaultSet, Made]:
    """What a job records, for whoever runs no pipeline here; with pictures (or the recorded ones) unless
    `images` is `none`. `beside` may do something with every picture that is taken. Raises BadInput, and as
    `stage.camera_of`."""
    if is_recorded(job.scenario):
        played = play_job(job, images=job.images != "none")
        return played.scene, played.faults, _whole(played)
    staged = stage(job)
    with camera_of(job, staged) as take:
        picture = None if take is None else beside(take)
        return staged.scenario, staged.faults, _record(job, staged, picture, Clock())


def _guarded(
    job: Job, scenario: Scenario | RecordedScene, faults: FaultSet, make: Callable[[], Made], clock: Clock
) -> JobResult:
    try:
        made = make()
        cases, views, curves = judge(job, made, _others(scenario, job.system), clock)
        return JobResult(
            job=job, scenario=scenario, faults=faults, shake=made.shake, receipts=made.receipts, cases=cases,
            views=views, distances=curves, timings_s=clock.laps,
        )  # fmt: skip
    except Exception as error:  # a bug of ours must not end the other jobs, nor pass for a result
        why = str(error) if isinstance(error, BadInput) else last_line(error)
        bad = tuple(failed(name, "bench_error", why) for name in (*job.pipelines, ORACLE))
        return JobResult(job=job, scenario=scenario, faults=faults, shake="", receipts=(), cases=bad)


def _others(scenario: Scenario | RecordedScene, system: str) -> tuple[str, ...]:
    """The actors around the ego: whose distances are kept. None of recorded data, where one camera sees."""
    if isinstance(scenario, RecordedScene):
        return ()
    played = scenario.system(system)
    return tuple(name for name in played.actors if name != played.ego)


def judge(
    job: Job, made: Made, others: tuple[str, ...], clock: Clock
) -> tuple[tuple[Case, ...], tuple[PairView, ...], Distances]:
    """All pipelines and the oracle on a recording: no scores where a receipt does not match. `others`: whose
    distances are kept."""
    cases = [run_case(name, made, job.isolate, job.limits) for name in job.pipelines]
    clock.lap("fusion and scores")
    if made.recording.truth.target_id is not None:
        cases.append(scored(ORACLE, score_oracles(made.recording), None))
    answers = {case.pipeline: case.driven.outputs for case in cases if case.driven is not None}
    views = pair_views(made.recording, answers)
    curves = distances(made.recording, answers, others)
    clock.lap("oracle and views")
    why = mismatch(made.receipts)
    return tuple(spoiled(case, why) if why else case for case in cases), views, curves


@runtime_checkable
class HasRecording(Protocol):
    """Whatever holds a recording."""

    @property
    def recording(self) -> Recording: ...


def run_case(name: str, made: HasRecording, isolate: Isolate = "users", limits: Limits = DEFAULT) -> Case:
    """One pipeline on one recording; what it does wrong is its status, never ours."""
    recording = made.recording
    found = driven(name, recording.log, isolate, limits)
    if isinstance(found, Case):
        return found
    try:
        return scored(name, score_objects(recording, found.outputs, found.trajectories), found)
    except ContractError as error:
        return failed(name, "pipeline_error", str(error))


def driven(name: str, log: Log, isolate: Isolate = "users", limits: Limits = DEFAULT) -> Driven | Case:
    """What a pipeline answers to a drive, or the case that failed."""
    return _driven_apart(name, log, limits) if runs_apart(name, isolate) else _driven_here(name, log)


def _driven_here(name: str, log: Log) -> Driven | Case:
    try:
        return drive(load_pipeline(name)(), log.calibration, log.categories, log.messages)
    except Exception as error:  # a pipeline may raise anything
        return failed(name, "pipeline_error", last_line(error))


def _driven_apart(name: str, log: Log, limits: Limits) -> Driven | Case:
    try:
        return drive_isolated(name, log.calibration, log.categories, log.messages, limits)
    except TimedOut as error:
        return failed(name, "timeout", str(error))
    except Failed as error:
        return failed(name, "pipeline_error", str(error))


def mismatch(receipts: Iterable[Receipt]) -> str | None:
    """Which receipts do not match, in a sentence; None: all do."""
    names = ", ".join(f"{r.fault} {r.quantity}" for r in receipts if r.status == MISMATCH)
    return f"receipt does not match: {names}" if names else None


def spoiled(case: Case, why: str) -> Case:
    """A receipt that does not match makes every number of the recording void."""
    return failed(case.pipeline, "receipt_mismatch", why)


class Clock:
    """Seconds between laps."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now
