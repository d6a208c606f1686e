"""The short drives that a pipeline is asked about: a few seconds with the paper's car rig, no images.

The car closes in on an e-scooter rider, from 28 m behind to 18 m (the first 2 s of `overtake-approach`).
Recordings are kept, since every relation and every pipeline asks for some of the same.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from scenarios.fault_set import FaultSet
from scenarios.faults import TriggerOffset
from scenarios.scenario import Scatter
from simbench.case import Boxes, Job
from simbench.checks.finding import Story
from simbench.recording import Recording
from simbench.stage import record, stage
from simbench.world import build_world

SCENARIO, SYSTEM = "overtake-approach", "car"
DURATION_S = 2.0
COLUMNS = 512  # of a sweep: half of what the sensor has
NOBODY = Scatter(  # 2 km behind, where no sensor reaches; last, so that all others keep their places
    part="pedestrian", category="pedestrian", count=1, area_m=(-2010.0, 0.0, -2000.0, 10.0), speed_mps=1.2
)


@lru_cache(maxsize=48)
def recorded(
    seed: int,
    *,
    columns: int = COLUMNS,
    background: bool = True,
    boxes: Boxes = "model",
    offset_ms: float = 0.0,
    unseen: bool = False,
) -> Recording:
    """A drive. background: with all that stands and walks around. boxes: of the detector model, or exact.
    offset_ms: how much later the cameras expose than they say. unseen: with one more pedestrian, far off.
    """
    job = Job(scenario=SCENARIO, system=SYSTEM, seed=seed, pipelines=(), boxes=boxes)
    at = stage(job)
    system = at.system.model_copy(update={"duration_s": DURATION_S})
    things = (*(at.scenario.background if background else ()), *((NOBODY,) if unseen else ()))
    scenario = at.scenario.model_copy(update={"background": things})
    if things != at.scenario.background:
        at = replace(at, scenario=scenario, world=build_world(scenario, at.system, seed))
    faults = FaultSet(specs=(TriggerOffset(offset_ms=offset_ms),) if offset_ms else (), label="check")
    rig = replace(at.rig, lidar=at.rig.lidar.model_copy(update={"columns": columns}))
    return record(job, replace(at, rig=rig, system=system, faults=faults)).recording


def told(recording: Recording) -> Story:
    """What a pipeline is told of a recording."""
    return Story(calibration=recording.calibration, messages=recording.messages)
