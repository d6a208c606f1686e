"""The parts of a sweep, of a frame and of a case, timed one by one."""

from __future__ import annotations

import cProfile
import pstats
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np

from scenarios.scenario import LidarSensor
from scenarios.seeding import stream
from simbench.case import Job
from simbench.run import run_job
from simbench.sensors import lidar
from simbench.sensors.beams import beam_table
from simbench.sensors.lidar import without
from simbench.sensors.shot import aim
from tests.benchmarks import frames
from tests.benchmarks.arithmetic import needed, peak_operations_per_s
from tests.benchmarks.clock import milliseconds, one_core
from tests.benchmarks.rivals import fans_of
from tests.benchmarks.scene import (
    INSTANT_NS,
    SCENARIO,
    SEED,
    SYSTEM,
    catalogue_stage,
    primitives,
    still_motion,
)

ROOT = Path(__file__).resolve().parents[2]
PIPELINES = ("static_projection", "static_projection_ground", "probabilistic")  # the demo's
TURNS = 15


def median_s(call: Callable[[], object], turns: int = TURNS) -> float:
    """Median CPU seconds of a call, after one that does not count."""
    call()
    seconds = []
    for _ in range(turns):
        started = process_time()
        call()
        seconds.append(process_time() - started)
    return float(np.median(seconds))


def sweep_parts() -> list[tuple[str, str]]:
    """A rolling sweep of the catalogue's world, step by step."""
    stage = catalogue_stage()
    motion, name, sensor = still_motion(stage), stage.rig.lidar_name, stage.rig.lidar
    table = beam_table(sensor)
    no_error = np.zeros(table.fire_offset_ns.shape, dtype=np.float32)
    t_ns = INSTANT_NS + table.group_offset_ns
    shot = aim(name, motion, table, INSTANT_NS, no_error, no_error, 0.0)
    narrow = without(sensor, "divergence")

    def whole(which: LidarSensor, noisy: bool) -> Callable[[], object]:
        return lambda: lidar.sweep(
            name, which, motion, INSTANT_NS, 0, stream(SEED, "breakdown") if noisy else None
        )

    return timed(
        [
            ("the sensor's own pose at every column", lambda: motion.sensor(name, t_ns)),
            ("aim: poses of sensor and bodies, bodies to their places", lambda: aim(
                name, motion, table, INSTANT_NS, no_error, no_error, 0.0
            )),
            ("cast 65,536 rays", shot.cast),
            ("whole sweep, ideal sensor", whole(sensor, False)),
            ("whole sweep, all effects but divergence", whole(narrow, True)),
            ("whole sweep, all effects", whole(sensor, True)),
        ]
    )  # fmt: skip


def frame_parts() -> list[tuple[str, str]]:
    """Six 960x600 pictures of one instant, and what each effect adds."""
    plain = frames.set_up(effects=False)
    rows: list[tuple[str, Callable[[], object]]] = [("no effects", partial(six, plain))]
    for name, value in frames.EFFECTS.items():
        cameras = {key: sensor.model_copy(update={name: value}) for key, sensor in plain.cameras.items()}
        session = replace(plain, cameras=cameras, noisy=name == "noise")
        if name == "distortion":
            session = replace(frames.set_up(effects=True), cameras=cameras, noisy=False)
        rows.append((f"with {name}", partial(six, session)))
    every = frames.set_up(effects=True)
    rows.append(("all effects", partial(six, every)))
    return timed(rows, turns=3)


def six(session: frames.Session) -> None:
    """Six pictures, half of the drive gone."""
    for name in session.cameras:
        frames.picture(session, name, 26)


def case_parts() -> list[tuple[str, str]]:
    """A case of the demo without pictures: the clock of `run_job`."""
    job = Job(scenario=SCENARIO, system=SYSTEM, seed=SEED, pipelines=PIPELINES, faults=("demo",))
    run_job(job)
    result = run_job(job)
    return [(name, milliseconds(seconds)) for name, seconds in result.timings_s.items()]


def case_modules(first: int = 14) -> list[tuple[str, str]]:
    """The same case by module: own time, with what it calls outside of the project. By cProfile, which makes
    Python slower and kernels not."""
    job = Job(scenario=SCENARIO, system=SYSTEM, seed=SEED, pipelines=PIPELINES, faults=("demo",))
    run_job(job)
    profile = cProfile.Profile()
    profile.runcall(run_job, job)
    found = own_time_by_module(pstats.Stats(profile))
    total = sum(found.values())
    ranked = sorted(found.items(), key=lambda item: -item[1])[:first]
    return [(name, f"{milliseconds(s)}, {s / total:.0%}") for name, s in ranked]


def own_time_by_module(stats: pstats.Stats) -> dict[str, float]:
    """Seconds by the project's module. Time in foreign functions goes to their callers, by their shares, up
    to the first function that is ours."""
    table = stats.stats  # type: ignore[attr-defined]
    owned: dict[str, float] = defaultdict(float)

    def charge(function: tuple[str, int, str], seconds: float, depth: int) -> None:
        path = Path(function[0])
        if path.is_relative_to(ROOT) and "site-packages" not in path.parts:
            owned[str(path.relative_to(ROOT))] += seconds
            return
        callers = table[function][4]
        total = sum(entry[3] for entry in callers.values())
        if depth == 0 or total <= 0.0:
            owned["(elsewhere)"] += seconds
            return
        for caller, entry in callers.items():
            charge(caller, seconds * entry[3] / total, depth - 1)

    for function, entry in table.items():
        if entry[2] > 1e-4:
            charge(function, entry[2], 12)
    return dict(owned)


def limit(count: int) -> list[tuple[str, str]]:
    """The kernel against what its arithmetic alone would take, with perfect culling by bounding spheres."""
    scene = primitives(count)
    least, peak = needed(scene), peak_operations_per_s()
    kernel_s, limit_s = median_s(fans_of(scene)), least.operations / peak
    return [
        ("rays", f"{least.rays:,}"),
        ("tests that culling by bounding spheres cannot save", f"{least.tests / least.rays:.2f} per ray"),
        ("operations in them", f"{least.operations / least.tests:.1f} per test"),
        ("this core, measured", f"{peak / 1e9:.1f} billion float64 operations/s"),
        ("limit", milliseconds(limit_s)),
        ("kernel", milliseconds(kernel_s)),
        ("kernel / limit", f"{kernel_s / limit_s:.1f}"),
        ("kernel", f"{kernel_s / least.rays * 1e9:.1f} ns per ray"),
    ]


def timed(rows: Iterable[tuple[str, Callable[[], object]]], turns: int = TURNS) -> list[tuple[str, str]]:
    """Each call's median CPU time in words."""
    return [(name, milliseconds(median_s(call, turns))) for name, call in rows]


def show(title: str, rows: Iterable[tuple[str, str]]) -> None:
    """One table in Markdown."""
    print(f"### {title}\n\n| what | |\n|---|---|", flush=True)
    for name, value in rows:
        print(f"| {name} | {value} |", flush=True)
    print(flush=True)


def main() -> None:
    """All tables."""
    with one_core():
        show("A sweep of the OS1-64 among 364 primitives, 24 moving bodies", sweep_parts())
        show("Arithmetic: 65,536 rays, 150 primitives", limit(150))
        show("Arithmetic: 65,536 rays, 600 primitives", limit(600))
        show("Six cameras, 960x600", frame_parts())
        show("A case of the demo, 5.2 s, three pipelines, no pictures (wall)", case_parts())
        show("The same case by module (wall, under the profiler)", case_modules())
