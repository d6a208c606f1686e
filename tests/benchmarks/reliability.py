"""Whether `robust`'s confidence means something: of the objects given 0.9, are 90 % right?

    python3 dev.py run python tests/benchmarks/reliability.py [--fit] [--seeds 0-3] [--out FILE.svg]

Right: more than half of the object's points are those of the object behind its box, whichever object that is.
Drives: the overtakes with the shipped detector, without errors and with those of `paper-car` and
`paper-wearable`. `--fit` finds the weights of `fusion/confidence.py` by logistic regression, on seeds 100 and
up; the check takes other seeds. Exit code 0: measured, whatever the numbers.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import patch

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

import numpy as np
from jaxtyping import Float64
from scipy.optimize import minimize

from fusion.confidence import ConfidenceConfig, confidence
from fusion.pipelines.robust import Robust
from simbench.case import Job
from simbench.drive import drive
from simbench.score.frames import frames_of
from simbench.score.identity import identify
from simbench.stage import record, stage

SCENARIOS = (
    "overtake-approach",
    "overtake-recede",
    "overtake-curve",
    "overtake-two-riders",
    "overtake-occluded",
)
FAULTS = {"car": ("none", "paper-car"), "wearable": ("none", "paper-wearable")}
EDGES = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.99, 1.0])
MOST_LOG_ODDS = 30.0


def objects_of(job: Job) -> Float64[np.ndarray, "n 6"]:
    """Of every output object: score, support, log points, log sightings, its confidence, 1 if right."""
    recording = record(job, stage(job)).recording
    asked: dict[float, tuple[float, float, int, int]] = {}

    def noted(score: float, support: float, points: int, sightings: int, config: ConfidenceConfig) -> float:
        chance = confidence(score, support, points, sightings, config)
        asked[chance] = (score, support, points, sightings)
        return chance

    with patch("fusion.pipelines.robust.confidence", noted):
        driven = drive(Robust(), recording.calibration, recording.categories, recording.messages)
    outputs = {(o.scan_sensor, o.scan_seq): o for o in driven.outputs}
    rows = []
    for frame in frames_of(recording):
        for item in identify(frame, outputs.get(frame.key)):
            found = item.found
            score, support, points, sightings = asked[found.confidence]
            on_it = (
                item.object_id >= 0 and np.mean(frame.truth.object_id[found.points] == item.object_id) > 0.5
            )
            rows.append(
                (score, min(support, 1.0), np.log(max(points, 1)), np.log(min(sightings, 10)),
                 found.confidence, float(on_it))
            )  # fmt: skip
    return np.array(rows, dtype=np.float64).reshape(-1, 6)


def jobs(seeds: Sequence[int]) -> Iterator[Job]:
    for scenario in SCENARIOS:
        for system, sets in FAULTS.items():
            for faults in sets:
                for seed in seeds:
                    yield Job(scenario=scenario, system=system, seed=seed, pipelines=(), faults=(faults,))


def fitted(rows: Float64[np.ndarray, "n 6"]) -> Float64[np.ndarray, "5"]:
    """bias and the weights of the first four columns, of greatest likelihood, weakly pulled to 0."""
    x, right = np.column_stack([np.ones(len(rows)), rows[:, :4]]), rows[:, 5]

    def loss(weight: Float64[np.ndarray, "5"]) -> float:
        odds = np.clip(x @ weight, -MOST_LOG_ODDS, MOST_LOG_ODDS)
        return float(np.sum(np.logaddexp(0.0, odds) - right * odds) + 0.5 * np.sum(weight**2))

    return np.asarray(minimize(loss, np.zeros(5), method="BFGS").x)


def table(
    confidence: Float64[np.ndarray, " n"], right: Float64[np.ndarray, " n"]
) -> list[tuple[float, float, int]]:
    """(mean confidence, share right, count) of every filled bin."""
    place = np.clip(np.searchsorted(EDGES, confidence, side="right") - 1, 0, len(EDGES) - 2)
    return [
        (float(confidence[place == b].mean()), float(right[place == b].mean()), int((place == b).sum()))
        for b in range(len(EDGES) - 1)
        if (place == b).any()
    ]


def plot(bins: Sequence[tuple[float, float, int]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2, 3.6), layout="constrained")
    axes = figure.subplots()
    said, right, _ = np.array(bins).T
    axes.plot([0, 1], [0, 1], color="#999999", lw=1)
    axes.plot(said, right, "o-", color="#1f6f8b", lw=1.5)
    for x, y, n in bins:
        axes.annotate(f"{n:,}", (x, y), textcoords="offset points", xytext=(6, -10), fontsize=7)
    axes.set(xlabel="confidence given", ylabel="share that is right", xlim=(-0.02, 1.06), ylim=(-0.02, 1.06))
    figure.savefig(path, metadata={"Date": None})


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="reliability.py", description=__doc__.partition("\n")[0])
    parser.add_argument("--fit", action="store_true", help="find the weights instead of checking them")
    parser.add_argument("--seeds", default=None, help="first-last; default 0-3, with --fit 100-103")
    parser.add_argument("--out", type=Path, help="an SVG of the check")
    options = parser.parse_args(arguments)
    first, last = (options.seeds or ("100-103" if options.fit else "0-3")).split("-")
    planned = list(jobs(range(int(first), int(last) + 1)))
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        rows = np.concatenate(list(pool.map(objects_of, planned)))
    print(f"{len(rows):,} objects of {len(planned)} drives, {rows[:, 5].mean():.1%} right")
    if options.fit:
        names = ("bias", "score", "support", "points", "sightings")
        print(", ".join(f"{name} {weight:.2f}" for name, weight in zip(names, fitted(rows), strict=True)))
        return 0
    bins = table(rows[:, 4], rows[:, 5])
    print(f"{'confidence':>12s}{'right':>8s}{'objects':>9s}")
    for said, right, count in bins:
        print(f"{said:12.3f}{right:8.3f}{count:9,d}")
    sure = rows[:, 4] >= 0.9
    print(f"given 0.9 or more: {rows[sure, 5].mean():.1%} right of {int(sure.sum()):,}")
    if options.out is not None:
        plot(bins, options.out)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
