"""One case from scenario to record, on one screen. Suites, stress and demo are this, called many times.

A `Job` makes one recording and runs every pipeline on it: a case is a job and a pipeline.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal

from fusion.messages import CategorySize
from scenarios.categories import CATEGORY_SIZES, SIZE_SPREAD
from scenarios.equipment import rig_sensors
from scenarios.errors import Where
from scenarios.fault_set import FaultSet, parse_fault_arguments
from scenarios.load import load_scenario
from scenarios.scenario import Scenario, System
from simbench.capture import Captured, TakePicture, capture, receipts
from simbench.drive import Driven, drive
from simbench.exhibit import PairView, pair_views
from simbench.faults.motion import describe_shake
from simbench.faults.receipt import MISMATCH, Receipt
from simbench.plugins import load_pipeline, reads_images
from simbench.score.contract import ContractError
from simbench.score.metrics import METRICS, Row
from simbench.score.oracle import score_oracle
from simbench.score.score import Scores, score
from simbench.sensors.rig import SensorRig, assemble, resized
from simbench.world import World, build_world

ORACLE = "oracle"
Status = Literal["ok", "pipeline_error", "timeout", "bench_error", "receipt_mismatch"]
CATEGORIES: Mapping[str, CategorySize] = {
    name: CategorySize(mean_m=size, spread=SIZE_SPREAD) for name, size in CATEGORY_SIZES.items()
}


@dataclass(frozen=True, kw_only=True)
class Job:
    """What to record and what to run on it. `faults`: as `--faults` gives them, in place of or on top of the
    scenario's own; empty: just those."""

    scenario: str
    system: str
    seed: int
    pipelines: tuple[str, ...]
    faults: tuple[str, ...] = ()
    images: Literal["none", "gl"] = "none"
    size_px: tuple[int, int] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One pipeline on one recording. `scores` is None unless the status is `ok`."""

    pipeline: str
    status: Status
    why: str | None
    rows: tuple[Row, ...]
    scores: Scores | None
    driven: Driven | None


@dataclass(frozen=True, kw_only=True, eq=False)
class JobResult:
    """All cases of a job, and what its report needs."""

    job: Job
    scenario: Scenario
    faults: FaultSet
    shake: str
    receipts: tuple[Receipt, ...]
    cases: tuple[Case, ...]
    views: tuple[PairView, ...] = ()
    timings_s: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """A job made concrete: the world stands, nothing has moved yet."""

    scenario: Scenario
    system: System
    faults: FaultSet
    rig: SensorRig
    world: World


def effective_faults(job: Job) -> FaultSet:
    """The scenario's own faults with the job's on top."""
    family = load_scenario(job.scenario)
    own = family.fault_set(family.resolve(job.seed))
    return own.override(parse_fault_arguments(job.faults)) if job.faults else own


def stage(job: Job) -> Stage:
    """Resolve scenario, faults and rig of a job and build its world. Raises BadInput."""
    family = load_scenario(job.scenario)
    scenario = family.resolve(job.seed)
    system = family.system(job.system, seed=job.seed)
    faults = effective_faults(job)
    declared = family.rig(system.rig)
    rig = assemble(declared, rig_sensors(declared, family.beside))
    if job.size_px is not None:
        rig = resized(rig, *job.size_px)
    faults.check_cameras(tuple(rig.cameras), Where(file=None) if job.faults else family.where.at("faults"))
    return Stage(
        scenario=scenario,
        system=system,
        faults=faults,
        rig=rig,
        world=build_world(scenario, system, job.seed),
    )


def record(job: Job, staged: Stage, picture: TakePicture | None = None) -> Captured:
    """Run the sensors of a staged job."""
    return capture(staged.system, staged.rig, staged.world, staged.faults, CATEGORIES, job.seed, picture)


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
            cases = tuple(_failed(name, "bench_error", why) for name in (*job.pipelines, ORACLE))
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
        cases.append(_ok(ORACLE, score_oracle(captured.recording), None))
    driven = {case.pipeline: case.driven.outputs for case in cases if case.driven is not None}
    views = pair_views(captured.recording, driven)
    clock.lap("oracle and views")
    bad = [receipt for receipt in found if receipt.status == MISMATCH]
    return JobResult(
        job=job,
        scenario=staged.scenario,
        faults=staged.faults,
        shake=_shake_words(captured, staged),
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
        return _failed(name, "pipeline_error", _last_line(error))
    try:
        return _ok(name, score(recording, driven.outputs, driven.trajectories), driven)
    except ContractError as error:
        return _failed(name, "pipeline_error", str(error))


def _ok(name: str, scores: Scores, driven: Driven | None) -> Case:
    return Case(pipeline=name, status="ok", why=None, rows=scores.rows, scores=scores, driven=driven)


def _failed(name: str, status: Status, why: str) -> Case:
    rows = tuple(
        Row(metric=m.name, value=None, unit=m.unit, better=m.better, n=0, sd=None, why=f"{status}: {why}")
        for m in METRICS
    )
    return Case(pipeline=name, status=status, why=why, rows=rows, scores=None, driven=None)


def _spoiled(case: Case, bad: list[Receipt]) -> Case:
    """A receipt that does not match makes every number of the recording void."""
    names = ", ".join(f"{r.fault} {r.quantity}" for r in bad)
    return _failed(case.pipeline, "receipt_mismatch", f"receipt does not match: {names}")


def _last_line(error: Exception) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} (line {place.lineno} of {place.name})"


def _shake_words(captured: Captured, staged: Stage) -> str:
    """What the body's shake is, in words; empty when it does not shake."""
    drawn = captured.drawn
    if drawn.body_shake is None:
        return ""
    return describe_shake(drawn.body_shake, drawn.profile, staged.system.duration_s)


@contextmanager
def pictures(job: Job, staged: Stage) -> Iterator[TakePicture | None]:
    """Takes pictures for a job whose pipelines read them, else None. Raises `gl.RenderingUnavailable`."""
    if job.images == "none" or not any(reads_images(name) for name in job.pipelines):
        yield None
        return
    from simbench.sensors.render import Renderer

    pinholes = staged.rig.pinholes
    with Renderer(staged.world) as renderer:
        yield lambda motion, camera, t_ns, pose: renderer.rgb(motion, t_ns, pose, pinholes[camera])


class Clock:
    """Seconds between laps."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now
