"""What one run is asked for and what it gives: a `Job`, its `Case`s, its `JobResult`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from scenarios.fault_set import FaultSet
from scenarios.scenario import Scenario
from simbench.distances import Distances
from simbench.drive import Driven
from simbench.exhibit import PairView
from simbench.faults.receipt import Receipt
from simbench.formats.scene import RecordedScene
from simbench.isolate.limits import DEFAULT, Isolate, Limits
from simbench.score.metrics import METRICS, Row
from simbench.score.score import Scores

ORACLE = "oracle"
Images = Literal["none", "raycast", "gl"]
Boxes = Literal["labels", "model"]
Told = Literal["true", "found"]
Status = Literal["ok", "pipeline_error", "timeout", "bench_error", "receipt_mismatch"]


@dataclass(frozen=True, kw_only=True)
class Job:
    """What to record and what to run on it. `faults`: as `--faults` gives them, in place of or on top of the
    scenario's own; empty: just those.

    `boxes`: where detections come from, None: as `boxes_of` says. Of recorded data (`kitti:PATH`) the seed is
    the number of the recording, and `frames` are those of a sequence that are played (None: all)."""

    scenario: str
    system: str
    seed: int
    pipelines: tuple[str, ...]
    faults: tuple[str, ...] = ()
    images: Images = "none"
    size_px: tuple[int, int] | None = None
    boxes: Boxes | None = None
    frames: tuple[int, int] | None = None
    changes: tuple[str, ...] = ()  # of the scenario file, as `--set` gives them
    calibration: str = "true"  # as `--calibration` gives it
    off: tuple[str, ...] = ()  # what the bench leaves out (`switches.py`)
    found_in: str | None = None  # the file of the found calibration that the pipelines are told
    isolate: Isolate = "users"  # which pipelines run in a process of their own
    limits: Limits = DEFAULT  # of each of these processes

    @property
    def told(self) -> Told:
        """Which calibration the pipelines are told; the recording's own one counts as true."""
        return "true" if self.found_in is None else "found"


def boxes_of(job: Job, recorded: bool) -> Boxes:
    """`labels`: the exact visible box of every object; `model`: what the detector model makes of them. What a
    job does not say: labels of recorded data, the model of a simulated drive."""
    return job.boxes or ("labels" if recorded else "model")


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
    scenario: Scenario | RecordedScene
    faults: FaultSet
    shake: str
    receipts: tuple[Receipt, ...]
    cases: tuple[Case, ...]
    views: tuple[PairView, ...] = ()
    distances: Distances = field(default_factory=Distances)
    timings_s: Mapping[str, float] = field(default_factory=dict)


def scored(pipeline: str, scores: Scores, driven: Driven | None) -> Case:
    """A case that went well."""
    return Case(pipeline=pipeline, status="ok", why=None, rows=scores.rows, scores=scores, driven=driven)


def failed(pipeline: str, status: Status, why: str) -> Case:
    """A case without a score: every metric is null and says why."""
    rows = tuple(
        Row(metric=m.name, value=None, unit=m.unit, better=m.better, n=0, sd=None, why=f"{status}: {why}")
        for m in METRICS
    )
    return Case(pipeline=pipeline, status=status, why=why, rows=rows, scores=None, driven=None)
