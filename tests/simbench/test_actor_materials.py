"""Materials that a scenario gives to an actor: they stand, and move no other draw."""

from __future__ import annotations

import numpy as np

from scenarios.palette import materials_of, palette
from scenarios.scenario import Surface
from simbench.world import World, build_world
from tests.simbench.scenes import Stage, staged


def dressed(of: Stage, materials: dict[str, Surface]) -> World:
    actors = dict(of.system.actors)
    actors["rider"] = actors["rider"].model_copy(update={"materials": materials})
    return build_world(of.scenario, of.system.model_copy(update={"actors": actors}), 3)


def rows(world: World, material: str) -> np.ndarray:
    names = [world.model.material(int(world.model.geom_matid[geom])).name for geom in world.geom_model_id]
    return np.array([name == material for name in names])


def test_what_is_given_stands_and_everything_else_is_drawn_as_ever() -> None:
    of = staged("overtake-approach", "car", 3)
    given = {"top": Surface(reflectivity=0.04, colour=(0.1, 0.2, 0.3)), "helmet": Surface(reflectivity=0.05)}
    world = dressed(of, given)
    top, helmet = rows(world, "rider/top"), rows(world, "rider/helmet")
    assert top.sum() == 6 and helmet.sum() == 1
    assert np.all(world.reflectivity[top] == 0.04) and np.all(world.reflectivity[helmet] == 0.05)
    np.testing.assert_allclose(world.looks.colour[top], np.tile([0.1, 0.2, 0.3], (6, 1)), atol=1e-6)
    assert np.array_equal(world.looks.colour[~top], of.world.looks.colour[~top])
    assert np.array_equal(world.reflectivity[~(top | helmet)], of.world.reflectivity[~(top | helmet)])
    assert np.array_equal(world.static_position_m, of.world.static_position_m)


def test_a_colour_alone_leaves_the_reflectivity_to_the_seed() -> None:
    of = staged("overtake-approach", "car", 3)
    world = dressed(of, {"top": Surface(colour=(0.0, 0.0, 0.0))})
    assert np.array_equal(world.reflectivity, of.world.reflectivity)
    assert world.looks.colour[rows(world, "rider/top")].max() == 0.0


def test_others_of_the_same_part_are_not_dressed_alike() -> None:
    of = staged("overtake-two-riders", "car", 3)
    world = dressed(of, {"top": Surface(reflectivity=0.04)})
    friend = rows(world, "friend/top")
    assert friend.any() and np.all(world.reflectivity[friend] >= palette()["top"]["reflectivity"][0])


def test_a_parts_materials_are_those_of_its_geoms() -> None:
    for part in ("car", "van", "escooter_rider", "pedestrian"):
        assert set(materials_of(part)) <= palette().keys() and len(materials_of(part)) >= 4
    assert {"top", "trousers", "shoes", "helmet", "skin"} <= set(materials_of("escooter_rider"))
