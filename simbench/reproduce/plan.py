"""What has to be run, part by part; the ledger tells what is there already.

| part | what | answers |
|---|---|---|
| board | a calibration with a checkerboard, by rig and seed | Table I |
| tables | every cell, without errors, with all at bounds, and as the numbers are reached | II, III, MAE |
| variants | the method with one step or reading changed | ablation, readings |
| scenes | every cell in other scenes, without errors and with all at bounds | what must differ |
| groups | groups of causes at their bounds: every set in S1, else all and all but one | what to mend first |
| map | trigger offset times body shake | heat map |
| strips | each cause alone, up to far beyond its bound | frontiers |
| fit | levels drawn from the prior, a Sobol sequence | which levels fit |
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np
from jaxtyping import Float64

from scenarios.faults.motion import SHAKERS
from scenarios.seeding import stream
from simbench.case import Job
from simbench.reproduce.cells import BASELINE, CELLS, FAULTS, GROUND, METHOD, PIPELINES, Cell
from simbench.reproduce.levels import GROUPS, LEVELS, NONE_FAULTS, at_bounds, faults_at, prior
from simbench.reproduce.scenes import SCENES, changes_of
from simbench.reproduce.variants import NAMES, reference_of

Part = Literal["tables", "variants", "scenes", "groups", "map", "strips", "fit"]
Condition = Literal["none", "bounds", "reached"]
CONDITIONS: Mapping[Condition, str] = {
    "none": "no error is injected",
    "bounds": "every cause at its physical bound",
    "reached": "found by hand: reaches the paper's first scenario, by brackets that bend unphysically",
}
SCENE_CONDITIONS: tuple[Condition, ...] = ("none", "bounds")
RIGS: Mapping[str, str] = {"car": "car-six-cameras", "wearable": "wearable-front"}
MAP_OFFSETS_MS = (0.0, 50.0, 100.0, 150.0)
MAP_SHAKES_DEG: Mapping[str, tuple[float, ...]] = {
    "car": (0.0, 0.3, 0.55, 1.1),
    "wearable": (0.0, 1.0, 2.0, 3.0),
}
STRIP_TIMES = (0.5, 1.0, 2.0, 4.0)
FIRST_FIT_SEED = 1000
EVERYTHING = (1 << len(GROUPS)) - 1
MENDED = (EVERYTHING, *(EVERYTHING ^ (1 << group) for group in range(len(GROUPS))))
"""Sets of groups, as bits: all of them, and all but one."""
ALONE = ("trigger offset", "spin phase")
"""Causes of which it is asked whether they matter alone."""


@dataclass(frozen=True, kw_only=True)
class Size:
    """How much is run. seeds: of the tables; the other counts: seeds of their parts; claims: seeds of those
    strips that a sentence rests on; fit_points: by rig."""

    name: Literal["quick", "full"]
    seeds: int
    boards: int
    variants: int
    scenes: int
    groups: int
    map: int
    strips: int
    claims: int
    fit_points: int


FULL = Size(
    name="full", seeds=20, boards=3, variants=6, scenes=3, groups=10, map=2, strips=2, claims=6,
    fit_points=128,
)  # fmt: skip
QUICK = Size(
    name="quick", seeds=2, boards=1, variants=1, scenes=0, groups=0, map=0, strips=0, claims=0, fit_points=0
)


@dataclass(frozen=True, kw_only=True)
class Ask:
    """A run. point: what tells it from the others of its part and cell: condition, groups or levels.
    whole: whether every pair and frame is kept."""

    part: Part
    cell: str
    point: tuple[str | float, ...]
    job: Job

    @property
    def whole(self) -> bool:
        return self.part in ("tables", "fit")


@dataclass(frozen=True, kw_only=True)
class BoardAsk:
    """A calibration of a rig."""

    system: str
    rig: str
    seed: int


def asks(size: Size) -> tuple[Ask, ...]:
    """All runs; those that share a drive one after the other (`simbench/reuse.py`)."""
    found = [
        *_tables(size.seeds), *_variants(size.variants), *_scenes(size.scenes),
        *_groups(size.groups), *_map(size.map), *_strips(size.strips, size.claims),
        *_fit(size.fit_points),
    ]  # fmt: skip
    return tuple(sorted(found, key=_drive))


def drives(found: Iterable[Ask]) -> int:
    """How many drives these are: where two parts ask for the same, it is made once."""
    return len({(ask.job, ask.whole) for ask in found})


def board_asks(size: Size) -> tuple[BoardAsk, ...]:
    """All calibrations."""
    return tuple(
        BoardAsk(system=system, rig=rig, seed=seed)
        for system, rig in RIGS.items()
        for seed in range(size.boards)
    )


def condition_faults(cell: Cell, condition: Condition) -> tuple[str, ...]:
    """What `--faults` is given."""
    levels = LEVELS[cell.system]
    if condition == "bounds":
        return faults_at(levels, at_bounds(levels))
    return NONE_FAULTS if condition == "none" else (FAULTS[cell.system],)


def fit_points(system: str, count: int) -> Float64[np.ndarray, "n d"]:
    """Levels of the design, a row a point: a scrambled Sobol sequence through the prior."""
    from scipy.stats import qmc

    levels = LEVELS[system]
    rng = stream(0, "reproduce", "design", system)
    unit = qmc.Sobol(len(levels), rng=rng).random_base2(max(count - 1, 1).bit_length())[:count]
    return prior(levels, unit)


def strip_levels(bound: float, fault: str) -> tuple[float, ...]:
    """Levels of a cause alone: half, once, twice and four times its bound; up to the bound where there is
    nothing beyond (a lag of one frame, half a turn), to twice where no such lens shows a whole picture."""
    if "lag_frames" in fault or "trigger_angle" in fault:
        return tuple(share * bound for share in (0.25, 0.5, 0.75, 1.0))
    if "undistorted_px" in fault:
        return tuple(times * bound for times in (0.5, 1.0, 1.5, 2.0))
    if "stale_frames" in fault:
        return (1.0, 2.0, 3.0, 4.0)
    return tuple(times * bound for times in STRIP_TIMES)


def _tables(seeds: int) -> Iterator[Ask]:
    for cell, condition, seed in product(CELLS, CONDITIONS, range(seeds)):
        job = cell.job(seed, condition_faults(cell, condition), PIPELINES)
        yield Ask(part="tables", cell=cell.name, point=(condition,), job=job)


def _variants(seeds: int) -> Iterator[Ask]:
    pipelines = (METHOD, *(reference_of(name) for name in NAMES))
    for cell, seed in product(CELLS, range(seeds)):
        job = replace(cell.job(seed, condition_faults(cell, "reached"), pipelines), isolate="none")
        yield Ask(part="variants", cell=cell.name, point=(), job=job)


def _scenes(seeds: int) -> Iterator[Ask]:
    for cell, scene, condition, seed in product(CELLS, SCENES, SCENE_CONDITIONS, range(seeds)):
        job = cell.job(seed, condition_faults(cell, condition), (BASELINE, GROUND, METHOD))
        job = replace(job, changes=changes_of(scene, cell), boxes=scene.boxes)
        yield Ask(part="scenes", cell=cell.name, point=(scene.name, condition), job=job)


def _groups(seeds: int) -> Iterator[Ask]:
    first = _first_cells()
    for cell, mask in product(CELLS, range(1 << len(GROUPS))):
        if cell not in first and mask not in MENDED:
            continue
        levels, acting = LEVELS[cell.system], tuple(g for i, g in enumerate(GROUPS) if mask >> i & 1)
        for seed in range(seeds):
            job = cell.job(seed, faults_at(levels, at_bounds(levels, acting)), PIPELINES)
            yield Ask(part="groups", cell=cell.name, point=(mask,), job=job)


def _first_cells() -> tuple[Cell, ...]:
    """The first scenario of either rig."""
    return tuple(next(cell for cell in CELLS if cell.system == system) for system in RIGS)


def _map(seeds: int) -> Iterator[Ask]:
    for cell, seed in product(_first_cells(), range(seeds)):
        for shake_deg, offset_ms in product(MAP_SHAKES_DEG[cell.system], MAP_OFFSETS_MS):
            faults = (
                *NONE_FAULTS, f"motion.vibration_deg={shake_deg:g}", f"timing.trigger_offset_ms={offset_ms:g}"
            )  # fmt: skip
            job = cell.job(seed, faults, PIPELINES)
            yield Ask(part="map", cell=cell.name, point=(offset_ms, shake_deg), job=job)


def _strips(seeds: int, claims: int) -> Iterator[Ask]:
    for cell in _first_cells():
        levels = LEVELS[cell.system]
        for number, level in enumerate(levels):
            for value in strip_levels(level.bound, level.fault):
                point = [0.0] * len(levels)
                point[number] = value
                for seed in range(claims if level.name in ALONE else seeds):
                    job = cell.job(seed, faults_at(levels, point), PIPELINES)
                    yield Ask(part="strips", cell=cell.name, point=(level.name, value), job=job)


def _fit(count: int) -> Iterator[Ask]:
    for cell in CELLS if count else ():
        levels = LEVELS[cell.system]
        for number, point in enumerate(fit_points(cell.system, count).tolist()):
            seed = FIRST_FIT_SEED + number
            job = cell.job(seed, faults_at(levels, point), (BASELINE, GROUND, METHOD))
            yield Ask(part="fit", cell=cell.name, point=(number,), job=job)


_SHAKING = tuple(spec.name for spec in SHAKERS)


def _drive(ask: Ask) -> tuple[str, int, tuple[str, ...], str]:
    job = ask.job
    return ask.cell, job.seed, tuple(text for text in job.faults if text.startswith(_SHAKING)), ask.part


def of_part(found: Sequence[Ask], part: Part, cell: str) -> tuple[Ask, ...]:
    """The runs of a part and cell."""
    return tuple(ask for ask in found if ask.part == part and ask.cell == cell)
