"""Learning the benchmark shapes: on seeds and sizes apart from evaluation, and repeatable."""

from __future__ import annotations

from typing import Any
from unittest import mock

import pytest

from fusion.shape import parse_benchmark_shapes
from scenarios.load import load_scenario
from simbench.learn import FIRST_SEED, LEARNED, SCALES, learn, resize, unusual
from simbench.world import build_world, part_info


@pytest.mark.parametrize("scale", SCALES)
def test_every_object_that_is_learned_from_has_a_size_that_evaluation_never_draws(scale: float) -> None:
    scenario = resize(load_scenario("overtake-approach").resolve(FIRST_SEED), "car", scale)
    system = scenario.system("car")
    world = build_world(scenario, system, FIRST_SEED)
    sized = zip(world.objects, world.scale, strict=True)
    used = [o for o, scale in sized if o.category in LEARNED and unusual(scale)]
    for info in used:
        part = {"rider": "escooter_rider"}.get(info.name, info.name.rsplit("-", 1)[0])
        assert abs(info.size_m[2] / part_info(part).size_m[2] - 1.0) > 0.08
    assert {"car", "rider"} <= {o.name for o in used}
    assert all(actor.scale == scale for actor in system.actors.values())


def test_objects_of_evaluation_are_not_learned_from() -> None:
    for seed in range(3):
        scenario = load_scenario("overtake-approach").resolve(seed)
        world = build_world(scenario, scenario.system("car"), seed)
        sized = zip(world.objects, world.scale, strict=True)
        assert not [o.name for o, scale in sized if o.category in LEARNED and unusual(scale)]


def test_the_other_system_and_the_order_of_systems_stay() -> None:
    scenario = load_scenario("overtake-approach").resolve(0)
    changed = resize(scenario, "car", 1.14)
    assert changed.system("wearable") == scenario.system("wearable")
    assert set(changed.systems) == set(scenario.systems)


def test_learning_repeats_and_says_what_it_learned_from() -> None:
    def short(scenario: Any, system: str, scale: float) -> Any:
        changed = resize(scenario, system, scale)
        systems = dict(changed.systems)
        systems[system] = systems[system].model_copy(update={"duration_s": 0.8})
        return changed.model_copy(update={"systems": systems})

    with (
        mock.patch("simbench.learn.resize", short),
        mock.patch("simbench.learn.SCENARIOS", (("overtake-recede", "car"),)),
    ):
        first, second = learn([FIRST_SEED]), learn([FIRST_SEED])
    assert first == second
    shapes = parse_benchmark_shapes(first)
    for category in LEARNED:
        assert sum(shapes.of(category)) == pytest.approx(1.0, abs=1e-3)
    assert "overtake-recede (car rig)" in first and f"--seeds {FIRST_SEED}" in first
