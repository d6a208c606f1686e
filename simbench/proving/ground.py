"""Where faults are proved: one busy drive, measured once, on which every fault acts anew.

The catalogue's overtaking manoeuvre with more people and cars beside the lanes, so that there are boxes to
merge, miss and mistake; a LiDAR of few columns and small pictures, because receipts count points and pixels,
and do not need many.
"""

from __future__ import annotations

import atexit
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from scenarios.fault_set import FaultSet
from scenarios.faults import FaultSpec
from simbench.capture import Captured
from simbench.case import Job
from simbench.faults import trace
from simbench.sensors.detector import perfect
from simbench.sensors.pictures import by_rays
from simbench.stage import Stage, record, stage

SCENARIO, SYSTEM = "overtake-approach", "car"
CROWD = (
    "background.3.count=7",
    "background.4.count=7",
    "background.5.count=24",
    "background.5.area_m=[-10, -24, 95, -9]",
    "background.0.count=4",
)
COLUMNS = 96
SWEEPS_S = 0.8
SIZE_PX = (320, 200)
DURATION_S = 6.0
PICTURES_S = 0.5
GLIMPSE_S = 0.4
SMALL_PX = (160, 100)
LARGE_PX = (960, 600)
SHORT_S = 2.0
LONG_S = 25.0
FEW_COLUMNS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """A drive without faults. staged: with as many columns as were measured."""

    staged: Stage
    captured: Captured


def fault_set(specs: Sequence[FaultSpec]) -> FaultSet:
    """Exactly these, those that are off too."""
    return FaultSet(specs=tuple(specs), label="proved")


def _staged(seed: int, duration_s: float, columns: int, size_px: tuple[int, int], crowd: bool) -> Stage:
    job = Job(
        scenario=SCENARIO, system=SYSTEM, seed=seed, pipelines=(), changes=CROWD if crowd else (),
        size_px=size_px,
    )  # fmt: skip
    whole = stage(job)
    rig = replace(whole.rig, lidar=whole.rig.lidar.model_copy(update={"columns": columns}))
    system = whole.system.model_copy(update={"duration_s": duration_s})
    return replace(whole, rig=rig, system=system)


@lru_cache(maxsize=1)
def measured() -> Ground:
    """Boxes, ego motions and the reference of the drive, and sweeps of few points."""
    staged = _staged(0, DURATION_S, FEW_COLUMNS, SIZE_PX, crowd=True)
    return Ground(staged=staged, captured=record(_job(0), staged))


@lru_cache(maxsize=1)
def swept() -> Ground:
    """A few sweeps of the same drive with many points."""
    staged = _staged(0, SWEEPS_S, COLUMNS, SIZE_PX, crowd=True)
    return Ground(staged=staged, captured=record(_job(0), staged))


@lru_cache(maxsize=1)
def long() -> Ground:
    """A drive that is long enough for outages of the reference; without boxes, and with few points."""
    staged = empty(boxes=False)
    staged = replace(staged, system=staged.system.model_copy(update={"duration_s": LONG_S}))
    return Ground(staged=staged, captured=record(_job(0), staged))


@lru_cache(maxsize=1)
def pictured() -> Ground:
    """The first moments of the same drive with pictures."""
    staged = _staged(0, PICTURES_S, FEW_COLUMNS, SIZE_PX, crowd=True)
    return Ground(staged=staged, captured=record(_job(0), staged, by_rays(staged.rig, 0)))


@lru_cache(maxsize=2)
def empty(boxes: bool = False) -> Stage:
    """The same drive to be measured again and again under faults that act while it is measured; without
    people beside the lanes, and without boxes where those do not matter."""
    staged = _staged(0, SHORT_S, FEW_COLUMNS, LARGE_PX, crowd=False)
    if boxes:
        return staged
    nothing = perfect(staged.rig.rig.detector).model_copy(update={"categories": ()})
    rig = replace(staged.rig, rig=staged.rig.rig.model_copy(update={"detector": nothing}))
    return replace(staged, rig=rig)


@lru_cache(maxsize=1)
def glimpse() -> Stage:
    """A moment of the drive in which people beside the lanes are pictured, by two cameras."""
    whole = _staged(0, GLIMPSE_S, FEW_COLUMNS, SMALL_PX, crowd=True)
    two = tuple(whole.rig.cameras)[:2]
    cameras = {name: whole.rig.cameras[name] for name in two}
    return replace(
        whole, rig=replace(whole.rig, cameras=cameras, pinholes={n: whole.rig.pinholes[n] for n in two})
    )


@lru_cache(maxsize=1)
def a_trace() -> str:
    """A file of a gyro on a body that rolls and pitches, for as long as this process lives."""
    folder = tempfile.TemporaryDirectory(prefix="simbench-trace-")
    atexit.register(folder.cleanup)
    t_s = np.arange(0.0, SHORT_S + 0.02, 0.01)
    roll, pitch = 0.03 * np.cos(9.0 * t_s) + 0.01, 0.06 * np.cos(7.0 * t_s + 1.0)
    rows = np.stack([t_s, roll, pitch, 0.02 * np.sin(4.0 * t_s)], axis=1)
    lines = [",".join(trace.COLUMNS), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    path = Path(folder.name) / "gyro.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def again(staged: Stage, specs: Sequence[FaultSpec], seed: int, pictures: bool) -> Captured:
    """The drive measured under some faults."""
    picture = by_rays(staged.rig, seed) if pictures else None
    return record(_job(seed), replace(staged, faults=fault_set(specs)), picture)


def _job(seed: int) -> Job:
    return Job(scenario=SCENARIO, system=SYSTEM, seed=seed, pipelines=())
