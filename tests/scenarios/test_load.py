"""Families and seeds: determinism, independence of draws, default sizes, round trip through text."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.describe import describe
from scenarios.errors import BadInput
from scenarios.faults import TriggerOffset
from scenarios.load import (
    Family,
    list_rigs,
    list_scenarios,
    list_sensors,
    load_rig,
    load_scenario,
    load_sensor,
)
from scenarios.seeding import stream

SEEDS = st.integers(0, 2**63 - 1)
ROOT = Path(__file__).resolve().parents[2]

PLAIN = """\
name: plain
description: Two cars
road: {}
systems:
  car:
    duration_s: 2
    ego: a
    target: b
    rig: car-six-cameras
    actors:
      a: {part: car, category: car, path: {waypoints_m: [[0, 0]], speed_mps: {uniform: [9, 11]}}}
      b: {part: car, category: car, path: {waypoints_m: [[20, 0]], speed_mps: {normal: {mean: 8, sd: 1}}}}
"""


def family(folder: Path, text: str) -> Family:
    path = folder / "plain.yaml"
    path.write_text(text)
    return load_scenario(str(path))


@given(seed=SEEDS)
@settings(max_examples=10)
def test_the_same_seed_gives_the_same_scenario(seed: int) -> None:
    one, other = load_scenario("static-board"), load_scenario("static-board")
    assert one.resolve(seed) == other.resolve(seed) == other.resolve(seed)


def test_the_description_is_short_enough_to_read() -> None:
    text = describe(load_scenario("overtake-approach").resolve(3))
    assert text.startswith("name: overtake-approach\ndescription: A car closes in")
    assert "  area_m: [5.0, 6.0, 75.0, 9.0]\n" in text
    assert len(text.splitlines()) < 150 and max(map(len, text.splitlines())) <= 110


def test_other_seeds_give_other_scenarios() -> None:
    one = load_scenario("overtake-approach")
    assert len({describe(one.resolve(seed)) for seed in range(20)}) == 20


@pytest.mark.parametrize("name", list_scenarios())
@pytest.mark.parametrize("seed", [0, 3])
def test_the_described_scenario_loads_again_to_itself_whatever_the_seed(
    tmp_path: Path, name: str, seed: int
) -> None:
    scenario = load_scenario(name).resolve(seed)
    text = describe(scenario)
    again = family(tmp_path, text)
    assert not again.distributions
    assert again.resolve(seed + 17) == scenario
    assert describe(again.resolve(0)) == text


@given(seed=SEEDS)
@settings(max_examples=15)
def test_a_further_distribution_moves_no_other_draw(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    folder = tmp_path_factory.mktemp("independent")
    one = family(folder, PLAIN).resolve(seed).system("car")
    more = PLAIN.replace("duration_s: 2", "duration_s: {uniform: [1, 2]}").replace(
        "actors:\n",
        "actors:\n      c: {part: car, category: car, path: {waypoints_m: [[{choice: [50, 60]}, 9]]}}\n",
    )
    other = family(folder, more).resolve(seed).system("car")
    assert other.duration_s != one.duration_s
    assert (other.actors["a"], other.actors["b"]) == (one.actors["a"], one.actors["b"])


def test_a_draw_comes_from_the_stream_of_its_path(tmp_path: Path) -> None:
    scenario = family(tmp_path, PLAIN).resolve(5)
    u = stream(5, "scenario", "systems", "car", "actors", "a", "path", "speed_mps").random()
    assert scenario.system("car").actors["a"].path.speed_mps == 9 + 2 * u


def test_a_target_varies_by_eight_percent_and_the_ego_does_not(tmp_path: Path) -> None:
    plain = family(tmp_path, PLAIN)
    scales = np.array([plain.resolve(seed).system("car").actors["b"].scale for seed in range(100)])
    assert 0.92 <= scales.min() < 0.93 and 1.07 < scales.max() <= 1.08
    assert abs(scales.mean() - 1.0) < 4 * 0.16 / np.sqrt(12 * 100)
    assert all(plain.resolve(seed).system("car").actors["a"].scale == 1.0 for seed in range(5))


def test_a_scale_that_is_given_stays(tmp_path: Path) -> None:
    fixed = family(tmp_path, PLAIN.replace("b: {part", "b: {scale: 1.3, part"))
    assert [fixed.resolve(seed).system("car").actors["b"].scale for seed in range(3)] == [1.3] * 3
    drawn = family(tmp_path, PLAIN.replace("a: {part", "a: {scale: {choice: [0.5]}, part"))
    assert drawn.resolve(1).system("car").actors["a"].scale == 0.5


def test_without_distributions_every_seed_is_the_same(tmp_path: Path) -> None:
    text = PLAIN.replace("{uniform: [9, 11]}", "9").replace("{normal: {mean: 8, sd: 1}}", "8")
    fixed = family(tmp_path, text.replace("b: {part", "b: {scale: 1, part"))
    assert fixed.resolve(1) == fixed.resolve(2)


def test_faults_of_the_file_may_be_drawn_too(tmp_path: Path) -> None:
    drawn = family(tmp_path, PLAIN + "faults: {timing.trigger_offset_ms: {uniform: [10, 20]}}\n")
    specs = [drawn.faults(seed).get(TriggerOffset) for seed in range(4)]
    values = {spec.offset_ms for spec in specs if spec is not None}
    assert len(values) == 4 and all(10 <= value <= 20 for value in values)


def test_a_seed_whose_numbers_collide_is_refused_with_the_seed(tmp_path: Path) -> None:
    """Between ends that fit there may be a middle that does not: it is caught when it is drawn."""
    text = PLAIN.replace("[[20, 0]]", "[[{uniform: [-20, 20]}, 0]]")
    colliding = family(tmp_path, text)
    refused = []
    for seed in range(30):
        try:
            colliding.resolve(seed)
        except BadInput as error:
            assert f"as seed {seed} draws it" in str(error) and error.line == 12
            refused.append(seed)
    assert 0 < len(refused) < 30


def test_a_system_is_reached_by_name(tmp_path: Path) -> None:
    plain = family(tmp_path, PLAIN)
    assert plain.system_names == ("car",)
    assert plain.system("car", seed=3) == plain.resolve(3).system("car")
    with pytest.raises(BadInput, match=r"line 4, systems: unknown system 'wearable' \(allowed: car\)"):
        plain.system("wearable", seed=3)


def test_a_family_travels_between_processes() -> None:
    one = load_scenario("overtake-recede")
    assert pickle.loads(pickle.dumps(one)).resolve(4) == one.resolve(4)


def test_everything_in_the_package_loads() -> None:
    assert set(list_rigs()) == {
        "car-six-cameras",
        "car-six-cameras-vlp16",
        "wearable-back",
        "wearable-front",
    }
    for rig in list_rigs():
        assert load_rig(rig) is load_rig(rig)
    for sensor in list_sensors():
        assert load_sensor(sensor).source
    for name in list_scenarios():
        assert load_scenario(name).name == name


def test_loading_pulls_in_neither_the_bench_nor_the_fusion_nor_mujoco() -> None:
    code = (
        "import sys, scenarios.load\n"
        "assert not {'pydantic', 'scipy', 'cv2', 'mujoco', 'numba'} & set(sys.modules), 'slow import'\n"
        "scenarios.load.load_scenario('overtake-approach').faults(1)\n"
        "assert not {'simbench', 'fusion', 'mujoco', 'numba'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
