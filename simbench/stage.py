"""A job made concrete: scenario, faults and rig resolved, the world built; and how to take its pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path as FilePath

from fusion.messages import CategorySize
from scenarios.categories import CATEGORY_SIZES, SIZE_SPREAD
from scenarios.equipment import rig_sensors
from scenarios.errors import BadInput, Where
from scenarios.fault_set import FaultSet, parse_fault_arguments
from scenarios.faults import MotionBlur, Trace
from scenarios.load import Family, load_scenario
from scenarios.scenario import Scenario, System
from simbench.calibration.file import read_calibration, told
from simbench.capture import Captured, capture
from simbench.case import Job, boxes_of
from simbench.faults.delivery import Sweep
from simbench.faults.refit import Refit, refit
from simbench.faults.trace import trace_shake
from simbench.isolate.ask import reads_images
from simbench.recording import Recording
from simbench.reuse import Kept, world_of
from simbench.sensors.detector import perfect
from simbench.sensors.pictures import TakePicture, by_gl, by_rays
from simbench.sensors.render import Renderer
from simbench.sensors.rig import SensorRig, assemble, resized
from simbench.switches import check_switches, scored_without, switched
from simbench.world import World

SWEEPS: Kept[tuple[Sweep, ...]] = Kept(1)
"""Of the drive that was recorded last."""

CATEGORIES: Mapping[str, CategorySize] = {
    name: CategorySize(mean_m=size, spread=SIZE_SPREAD) for name, size in CATEGORY_SIZES.items()
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """A job made concrete: the world stands, nothing has moved yet.

    `rig` measures; `refits`: what faults made of it, one by one.
    """

    scenario: Scenario
    system: System
    faults: FaultSet
    rig: SensorRig
    world: World
    refits: tuple[Refit, ...] = ()


def stage(job: Job) -> Stage:
    """Resolve scenario, faults and rig of a job and build its world. Raises BadInput."""
    check_switches(job.off)
    family = load_scenario(job.scenario, job.changes)
    scenario = family.resolve(job.seed)
    faults = faults_of(job, family, scenario)
    staged = set_stage(family, scenario, job.system, faults, job.seed, job.size_px)
    where = Where(file=None) if job.faults else family.where.at("faults")
    faults.check(tuple(staged.rig.cameras), where)
    if (recorded := faults.get(Trace)) is not None:
        trace_shake(recorded, staged.system.duration_s)  # bad input is said before anything is measured
    return replace(staged, rig=switched(staged.rig, job.off)) if job.off else staged


def faults_of(job: Job, family: Family, scenario: Scenario) -> FaultSet:
    """The scenario's own faults with the job's on top."""
    own = family.fault_set(scenario)
    if not job.faults:
        return own
    body = family.rig(scenario.system(job.system).rig).body
    return own.override(parse_fault_arguments(job.faults, "car" if body == "vehicle" else "rider"))


def set_stage(
    family: Family,
    scenario: Scenario,
    system_name: str,
    faults: FaultSet,
    seed: int,
    size_px: tuple[int, int] | None = None,
) -> Stage:
    """Build the world of a concrete scenario's system and read its rig. Raises BadInput."""
    if system_name not in family.system_names:
        raise family.where.unknown("system", system_name, family.system_names, ("systems",))
    system = scenario.system(system_name)
    declared = family.rig(system.rig)
    built = assemble(declared, rig_sensors(declared, family.beside))
    rig, refits = refit(built if size_px is None else resized(built, *size_px), faults)
    return Stage(
        scenario=scenario,
        system=system,
        faults=faults,
        rig=rig,
        world=world_of(scenario, system, seed),
        refits=refits,
    )


def record(job: Job, staged: Stage, picture: TakePicture | None = None) -> Captured:
    """Run the sensors of a staged job."""
    rig = staged.rig
    if boxes_of(job, recorded=False) == "labels":
        declared = rig.rig.model_copy(update={"detector": perfect(rig.rig.detector)})
        rig = replace(rig, rig=declared)
    captured = capture(
        staged.system, rig, staged.world, staged.faults, CATEGORIES, job.seed, picture, kept=SWEEPS
    )
    return replace(captured, recording=scored_without(captured.recording, job.off)) if job.off else captured


def as_told(job: Job, staged: Stage, recording: Recording) -> Recording:
    """The same recording with the calibration that the job's pipelines are told: the true one, or a found
    one with whatever a fault does to it on top. The receipts prove the fault before. Raises BadInput."""
    if job.found_in is None:
        return recording
    true = staged.rig.calibration
    found = read_calibration(FilePath(job.found_in), staged.rig)
    return replace(recording, calibration=told(recording.calibration, true, found))


@contextmanager
def pictures(job: Job, staged: Stage) -> Iterator[TakePicture | None]:
    """Takes pictures for a job whose pipelines read them, else None. Raises as `camera_of`."""
    if job.images == "none" or not any(reads_images(name) for name in job.pipelines):
        yield None
        return
    with camera_of(job, staged) as picture:
        yield picture


@contextmanager
def camera_of(job: Job, staged: Stage) -> Iterator[TakePicture | None]:
    """Takes the pictures that a job asks for, None: it asks for none. Raises `gl.RenderingUnavailable` for
    images by OpenGL where nothing can draw."""
    if job.images == "none":
        yield None
        return
    if job.images == "raycast":
        yield by_rays(staged.rig, job.seed)
        return
    if staged.faults.get(MotionBlur) is not None:
        raise BadInput(f"OpenGL draws one instant and cannot do {MotionBlur.name}; take --images raycast")
    with Renderer(staged.world) as renderer:
        yield by_gl(staged.rig, renderer)
