"""Small results by hand: what a job would give, without running one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from scenarios.fault_set import FaultSet, parse_fault_arguments
from scenarios.load import load_scenario
from scenarios.scenario import Scenario
from simbench.case import ORACLE, Case, Job, JobResult
from simbench.drive import Driven
from simbench.exhibit import PairView
from simbench.faults.receipt import Receipt, judge
from simbench.score.budget import PARTS, Budget
from simbench.score.localization import Fix, FrameScore
from simbench.score.mapping import PairScore
from simbench.score.metrics import METRICS, Row
from simbench.score.score import Scores

PIPELINES = ("static_projection", "static_projection_ground", "probabilistic")
SCENARIO = "overtake-approach"
CAMERA = "cam-front"
GONE = (
    "a-scenario-that-is-not-there-any-more.yaml"  # cannot be staged again: no world is built, tests are fast
)


class Watcher:
    """A pipeline that wants images and finds nothing in them."""

    def reset(self, calibration: object, categories: object) -> None:
        pass

    def update(self, measurement: object) -> None:
        pass

    def trajectories(self) -> tuple[()]:
        return ()


def rng(*words: object) -> np.random.Generator:
    """A generator that belongs to these words."""
    return np.random.Generator(np.random.PCG64(list(repr(words).encode())))


def view(scan: int, shift: float = 0.0, pipelines: Sequence[str] = PIPELINES, n: int = 24) -> PairView:
    """A target of 40 x 100 px at (400, 250) with points on it and around it, told `shift` px to the right."""
    g = rng("view", scan)
    uv = np.stack([g.uniform(360, 480, n), g.uniform(240, 360, n)], axis=1).astype(np.float32)
    on_target = np.arange(n) % 2 == 0
    return PairView(
        scan_seq=scan,
        scan_stamp_ns=scan * 100_000_000,
        camera=CAMERA,
        image_seq=scan,
        capture_ns=scan * 100_000_000 + 20_000_000,
        box_px=(400.0, 250.0, 440.0, 350.0),
        outline_px=(401.0, 251.0, 439.0, 349.0),
        uv_px=uv,
        distance_m=g.uniform(9, 12, n).astype(np.float32),
        on_target=on_target,
        right=on_target & (np.arange(n) % 3 > 0),
        mapped={name: np.arange(n) % (2 + k) == 0 for k, name in enumerate(pipelines)},
        true_px=(420.0, 300.0),
        told_px=(420.0 + shift, 300.0),
    )


def pair_score(scan: int, tpr: float) -> PairScore:
    """A pair whose TPR is `tpr`, in hundredths."""
    return PairScore(
        frame=scan,
        scan_sensor="lidar",
        scan_seq=scan,
        scan_stamp_ns=scan * 100_000_000,
        camera=CAMERA,
        track_id=1,
        visible_fraction=1.0,
        surface_distance_m=10.0,
        n_mapped=100,
        n_window=round(100 * tpr),
        n_window_centre=0,
        n_window_gnss=None,
        n_window_any=100,
        n_correct=50,
        n_true=60,
        n_found=40,
        hit=True,
    )


def frame_score(scan: int, g: np.random.Generator) -> FrameScore:
    """The target 3 m to the right, 5 m to 25 m ahead; positions 0.2 m (1 SD) beside it."""
    x = 25.0 - 0.4 * scan

    def fix() -> Fix:
        dx, dy = g.normal(0, 0.2, 2)
        return Fix(
            stamp_ns=scan * 100_000_000,
            position_ego_m=(x + float(dx), -3.0 + float(dy), 0.8),
            centre_ego_m=(x, -3.0, 0.8),
            gnss_ego_m=None,
        )

    return FrameScore(
        frame=scan,
        scan_sensor="lidar",
        scan_seq=scan,
        scan_stamp_ns=scan * 100_000_000,
        instant_ns=scan * 100_000_000,
        true_centre_ego_m=(x, -3.0, 0.8),
        raw=fix(),
        camera=CAMERA,
        track_id=1,
        hit=True,
        smooth=fix(),
    )


def scores(tpr: Sequence[float], *words: object) -> Scores:
    """Scores with the given TPR per pair; every other metric is drawn from the words."""
    g = rng("scores", *words)
    drawn = {m.name: float(g.uniform(0.01, 0.99)) for m in METRICS} | {"tpr": float(np.mean(tpr))}
    parts = {part: g.normal(0, 0.3, (len(tpr), 3)) for part in PARTS}
    return Scores(
        rows=tuple(
            Row(
                metric=m.name,
                value=drawn[m.name],
                unit=m.unit,
                better=m.better,
                n=len(tpr),
                sd=None,
                why=None,
            )
            for m in METRICS
        ),
        pairs=tuple(pair_score(scan, value) for scan, value in enumerate(tpr)),
        frames=tuple(frame_score(scan, g) for scan in range(len(tpr))),
        budget=Budget(
            frames=tuple(range(len(tpr))), parts_m=parts, total_m=np.sum(list(parts.values()), axis=0)
        ),
    )


def case(pipeline: str, found: Scores) -> Case:
    driven = None
    if pipeline != ORACLE:
        driven = Driven(outputs=(), trajectories=(), scan_ms=(9.0, 2.0, 3.0, 4.0), step_ns={})
    return Case(pipeline=pipeline, status="ok", why=None, rows=found.rows, scores=found, driven=driven)


def crashed(pipeline: str, why: str = "KeyError: 'x' (line 3 of update)") -> Case:
    rows = tuple(
        Row(
            metric=m.name,
            value=None,
            unit=m.unit,
            better=m.better,
            n=0,
            sd=None,
            why=f"pipeline_error: {why}",
        )
        for m in METRICS
    )
    return Case(pipeline=pipeline, status="pipeline_error", why=why, rows=rows, scores=None, driven=None)


def faults(*words: str) -> FaultSet:
    return FaultSet().override(parse_fault_arguments(words)) if words else FaultSet()


def receipt(measured: float | None) -> Receipt:
    return judge(
        fault="timing.trigger_offset_ms",
        quantity="mean delay",
        unit="ms",
        requested=50.0,
        realised=50.0,
        measured=measured,
        estimator_sd=0.1,
        allowed=0.5,
        note="by hand",
    )


@cache
def concrete(scenario: str, seed: int) -> Scenario:
    """The scenario of a seed, resolved once."""
    return load_scenario(scenario).resolve(seed)


def result(
    seed: int = 0,
    *,
    errors: tuple[str, ...] = (),
    system: str = "car",
    scenario: str = GONE,
    pipelines: tuple[str, ...] = PIPELINES,
    tpr: Mapping[str, Sequence[float]] | None = None,
    crash: Sequence[str] = (),
    measured: float | None = 50.1,
    shift: float = 0.0,
    found_in: str | None = None,
) -> JobResult:
    """A result with 12 pairs per case. `tpr`: by pipeline, per pair; else drawn. `found_in`: a file with a
    found calibration."""
    g = rng("tpr", seed, errors, system)
    by_pipeline = {
        name: list((tpr or {}).get(name, np.round(g.uniform(0.1, 0.9, 12), 2)))
        for name in (*pipelines, ORACLE)
    }
    pairs = len(by_pipeline[pipelines[0]])
    cases = tuple(
        crashed(name) if name in crash else case(name, scores(by_pipeline[name], name, seed, errors, system))
        for name in (*pipelines, ORACLE)
    )
    drawn = faults(*errors)
    return JobResult(
        job=Job(
            scenario=scenario,
            system=system,
            seed=seed,
            pipelines=pipelines,
            faults=errors or ("none",),
            calibration="true" if found_in is None else f"found:{found_in}",
            found_in=found_in,
        ),
        scenario=concrete(SCENARIO, seed),
        faults=drawn,
        shake="pitch 1.10 deg RMS: ISO 8608 road class E on this vehicle" if errors else "",
        receipts=(receipt(measured),) if errors else (),
        cases=cases,
        views=tuple(view(scan, shift + scan, pipelines) for scan in range(pairs)),
        timings_s={},
    )


def without_target(seed: int = 0) -> JobResult:
    """An empty road: cases have rows, nothing to map."""
    known = {"false_objects_per_frame": 0.25}
    rows = tuple(
        Row(
            metric=m.name,
            value=known.get(m.name),
            unit=m.unit,
            better=m.better,
            n=12,
            sd=None,
            why=None if m.name in known else "the scenario has no target",
        )
        for m in METRICS
    )
    found = Scores(rows=rows, pairs=(), frames=(), budget=None)
    return JobResult(
        job=Job(scenario="empty-road", system="car", seed=seed, pipelines=PIPELINES, faults=("none",)),
        scenario=concrete("empty-road", seed),
        faults=FaultSet(),
        shake="",
        receipts=(),
        cases=tuple(case(name, found) for name in PIPELINES),
    )
