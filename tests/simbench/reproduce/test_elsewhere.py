"""Other scenes: what is changed is what the scenarios say, and nothing else; and what is made of the runs."""

from __future__ import annotations

import pytest

from scenarios.load import load_scenario
from simbench.case import Job
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD, Cell
from simbench.reproduce.elsewhere import ANY_DISTANCE, AS_IT_IS, elsewhere
from simbench.reproduce.levels import LEVELS, faults_at
from simbench.reproduce.plan import FULL, asks, strip_levels
from simbench.reproduce.scenes import SCENES, Scene, changes_of
from simbench.run import run_job
from tests.simbench.reproduce.made_up import CLEAN, LOSS, SMALL, made_up
from tests.simbench.reproduce.test_slopes import rng


def waypoint(cell: Cell, changes: tuple[str, ...]) -> tuple[float, float]:
    """Where the rider starts, as one seed has it."""
    system = load_scenario(cell.scenario, changes).system(cell.system, seed=0)
    x, y = system.actors["rider"].path.waypoints_m[0]
    return float(x), float(y)


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: cell.name)
def test_a_scene_moves_the_rider_by_what_it_says(cell: Cell) -> None:
    x_m, y_m = waypoint(cell, ())
    for scene in SCENES:
        changes = changes_of(scene, cell)
        if not changes or scene.bare:
            continue
        x, y = waypoint(cell, changes)
        assert y == -scene.side_m and y_m == pytest.approx(-3.0, abs=0.2)
        assert abs(x - x_m) == scene.farther_m
        assert abs(x) >= abs(x_m)


def test_nothing_is_beside_a_bare_road() -> None:
    bare = next(scene for scene in SCENES if scene.bare)
    assert load_scenario(CELLS[0].scenario, changes_of(bare, CELLS[0])).resolve(0).background == ()


def test_the_scene_as_it_is_asks_for_no_change() -> None:
    assert changes_of(Scene(name="same", title="the same"), CELLS[0]) == ()


def test_rows_are_the_means_of_their_runs_and_differ_from_the_same_seeds() -> None:
    rows = elsewhere(made_up(), rng())
    assert len(rows) == len(CELLS) * (2 + len(SCENES)) * 2
    for one in rows:
        share = {"none": 0.0, "bounds": 1.0}[one.condition] if one.what in (AS_IT_IS, ANY_DISTANCE) else 0.8
        for name in (BASELINE, GROUND, METHOD):
            assert one.tpr[name].n == SMALL.scenes
            assert one.tpr[name].mean == pytest.approx(CLEAN[name] - LOSS[name] * share, abs=0.1)
            if one.what == AS_IT_IS:
                assert one.change[name].difference.points == (0.0,) * SMALL.scenes


@pytest.mark.parametrize("system", list(LEVELS))
def test_every_strip_s_highest_level_is_a_run_that_the_bench_can_make(system: str) -> None:
    """A lens can be bent until it shows no whole picture; that would be a failed run every time."""
    scenario = next(cell.scenario for cell in CELLS if cell.system == system)
    levels = LEVELS[system]
    for number, level in enumerate(levels):
        point = [0.0] * len(levels)
        point[number] = strip_levels(level.bound, level.fault)[-1]
        result = run_job(
            Job(
                scenario=scenario, system=system, seed=0, pipelines=(BASELINE,),
                faults=faults_at(levels, point), changes=(f"systems.{system}.duration_s=0.5",),
            )
        )  # fmt: skip
        assert [case.why for case in result.cases] == [None, None], level.name


def test_scenes_are_run_with_the_boxes_that_they_name() -> None:
    named = {ask.point[0]: ask.job.boxes for ask in asks(FULL) if ask.part == "scenes"}
    assert named == {scene.name: scene.boxes for scene in SCENES}
