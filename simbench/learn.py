"""Learn the benchmark shapes S* of the shape filter from the bench's own sensors, errors off.

The seeds are far from those of any evaluation, and only objects are used whose size differs by more than 8 %
from their part's: evaluation draws targets within ±8 %.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusion.camera import project_points
from fusion.shape import format_benchmark_shapes, learn_shape
from scenarios.fault_set import FaultSet
from scenarios.load import load_scenario
from scenarios.scenario import Scenario, System
from simbench.capture import capture
from simbench.score.frames import frames_of
from simbench.stage import CATEGORIES, set_stage

FIRST_SEED = 100_000
SCENARIOS = (("overtake-approach", "car"), ("overtake-approach", "wearable"), ("overtake-recede", "car"))
SCALES = (0.86, 0.90, 1.10, 1.14)
LEARNED = ("car", "pedestrian", "rider")
MIN_POINTS = 12


def resize(scenario: Scenario, system: str, scale: float) -> Scenario:
    """The scenario with every actor at `scale` and background sizes spread by ±20 %."""
    changed = scenario.system(system)
    actors = {n: a.model_copy(update={"scale": scale}) for n, a in changed.actors.items()}
    systems: dict[str, System] = {str(name): declared for name, declared in scenario.systems.items()}
    systems[system] = changed.model_copy(update={"actors": actors})
    background = tuple(s.model_copy(update={"scale_spread": 0.2}) for s in scenario.background)
    return scenario.model_copy(update={"systems": systems, "background": background})


def learn(seeds: Sequence[int]) -> str:
    """The text of `fusion/shapes.json`. ValueError for a seed below FIRST_SEED (those are for evaluation)."""
    if any(seed < FIRST_SEED for seed in seeds):
        raise ValueError(f"shapes are learned on seeds from {FIRST_SEED} on; lower ones are for evaluation")
    pixels: dict[str, list[np.ndarray]] = {category: [] for category in LEARNED}
    for seed in seeds:
        for number, (name, system) in enumerate(SCENARIOS):
            _collect(name, system, seed, SCALES[(seed + number) % len(SCALES)], pixels)
    shapes = {category: learn_shape(found, category) for category, found in pixels.items()}
    return format_benchmark_shapes(
        shapes,
        {
            "command": f"simbench learn --seeds {min(seeds)}-{max(seeds)}",
            "scenarios": [f"{name} ({system} rig)" for name, system in SCENARIOS],
            "sizes": "only objects more than 8 % smaller or larger than their part",
            "faults": "none",
            "objects": {category: len(found) for category, found in pixels.items()},
        },
    )


def _collect(
    name: str, system_name: str, seed: int, scale: float, pixels: dict[str, list[np.ndarray]]
) -> None:
    family = load_scenario(name)
    scenario = resize(family.resolve(seed), system_name, scale)
    at = set_stage(family, scenario, system_name, FaultSet(), seed)
    recording = capture(at.system, at.rig, at.world, at.faults, CATEGORIES, seed).recording
    wanted = {
        info.object_id: info.category
        for info, scale in zip(at.world.objects, at.world.scale, strict=True)
        if info.category in LEARNED and unusual(scale)
    }
    for frame in frames_of(recording):
        for camera, view in frame.views.items():
            uv = project_points(
                frame.scan.xyz_m,
                recording.calibration.T_camera_lidar(camera, frame.scan.sensor),
                recording.calibration.cameras[camera],
            )
            for box in view.truth.boxes:
                if box.object_id not in wanted or box.visible_px is None or box.visible_fraction < 0.9:
                    continue
                model = recording.calibration.cameras[camera]
                x0, y0, x1, y1 = box.amodal_px
                if x0 <= 0 or y0 <= 0 or x1 >= model.width_px or y1 >= model.height_px:
                    continue
                found = uv[frame.truth.object_id == box.object_id]
                found = found[np.isfinite(found).all(axis=1)]
                if len(found) >= MIN_POINTS:
                    pixels[wanted[box.object_id]].append(found)


def unusual(scale: float) -> bool:
    """Whether an object's scale is outside what evaluation draws."""
    return abs(scale - 1.0) > 0.08
