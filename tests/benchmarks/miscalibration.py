"""How often the target is hit when all cameras are told to look `yaw` or `pitch` beside where they look.

    python3 dev.py run python tests/benchmarks/miscalibration.py [--seeds 0-5] [--scenarios NAME ...]

Each drive is recorded once and told every calibration in turn. `hit_rate` over all eligible pairs, and over
those whose image holds boxes of at least three tracks: fewer cannot tell a turned camera from a wrong
cluster. Rivals are run on the true calibration: the best of them is what `robust` is held against.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

import numpy as np

from scenarios.fault_set import FaultSet
from scenarios.faults import CalibrationRotation
from simbench.case import Job
from simbench.drive import drive
from simbench.faults.draw import place_of
from simbench.faults.tell import tell
from simbench.plugins import load_pipeline
from simbench.recording import Recording
from simbench.score.frames import frames_of
from simbench.score.objects import score_objects
from simbench.stage import record, stage

SCENARIOS = ("overtake-approach", "overtake-recede", "five-objects")
OURS = ("robust", "static_projection")
RIVALS = (
    "static_projection_ground",
    "probabilistic",
    "shrunken_median",
    "nearest_gap",
    "frustum_dbscan",
    "roi_cluster",
)
TOLD = (("none", 0.0), ("yaw", 1.0), ("yaw", 2.0), ("yaw", 3.0), ("pitch", 1.0), ("pitch", 2.0))
BOXES = 3
Cell = tuple[str, str, str, float, str]  # scenario, system, axis, angle, pipeline
Rates = tuple[float | None, float | None]  # over all pairs; over those with at least BOXES tracks


def rates(recording: Recording, pipeline: str) -> Rates:
    """hit_rate of one pipeline on one recording."""
    driven = drive(load_pipeline(pipeline)(), recording.calibration, recording.categories, recording.messages)
    scores = score_objects(recording, driven.outputs, driven.trajectories)
    views = {frame.scan.seq: frame.views for frame in frames_of(recording)}
    hit = np.array([pair.hit for pair in scores.pairs], dtype=float)
    many = np.array(
        [_tracks(views[pair.scan_seq][pair.camera]) >= BOXES for pair in scores.pairs], dtype=bool
    )
    return (float(hit.mean()) if len(hit) else None, float(hit[many].mean()) if many.any() else None)


def _tracks(view: object) -> int:
    detections = getattr(view, "detections", None)
    return 0 if detections is None else len({box.track_id for box in detections.boxes})


def drive_rates(job: Job) -> Mapping[Cell, Rates]:
    """Every calibration and pipeline on one drive."""
    staged = stage(job)
    true = record(job, staged).recording
    found: dict[Cell, Rates] = {}
    for axis, angle_deg in TOLD:
        told = true
        if angle_deg:
            spec = CalibrationRotation.model_validate({"angle_deg": angle_deg, "axis": axis})
            calibration, _ = tell(FaultSet(specs=(spec,)), place_of(staged.rig, job.seed))
            told = replace(true, calibration=calibration)
        for pipeline in (*OURS, *RIVALS) if angle_deg == 0.0 else OURS:
            found[(job.scenario, job.system, axis, angle_deg, pipeline)] = rates(told, pipeline)
    return found


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="miscalibration.py", description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", default="0-5", help="first-last")
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    options = parser.parse_args(arguments)
    first, last = (int(word) for word in options.seeds.split("-"))
    jobs = [
        Job(scenario=scenario, system=system, seed=seed, pipelines=())
        for scenario in options.scenarios
        for system in (("car",) if scenario == "five-objects" else ("car", "wearable"))
        for seed in range(first, last + 1)
    ]
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    cells: dict[Cell, list[Rates]] = {}
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for found in pool.map(drive_rates, jobs):
            for cell, value in found.items():
                cells.setdefault(cell, []).append(value)
    print("| scenario | rig | told | pipeline | `hit_rate` | where 3 boxes or more | runs |\n|" + "---|" * 7)
    for (scenario, system, axis, angle, pipeline), values in cells.items():
        told = "true" if angle == 0.0 else f"{axis} {angle:g}°"
        both = [_mean([v[i] for v in values]) for i in (0, 1)]
        print(f"| {scenario} | {system} | {told} | {pipeline} | {both[0]} | {both[1]} | {len(values)} |")
    return 0


def _mean(values: Sequence[float | None]) -> str:
    known = [v for v in values if v is not None]
    return f"{np.mean(known):.3f}" if known else "-"


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
