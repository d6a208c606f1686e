"""What the package ships says what the paper and the data sheets say."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from scenarios.categories import CATEGORY_SIZES, SIZE_SPREAD
from scenarios.equipment import cameras_of, rig_sensors
from scenarios.load import list_scenarios, load_rig, load_scenario, load_sensor
from scenarios.scenario import CameraSensor, GnssSensor, LidarSensor, Rig, System

SEEDS = range(8)
PARTS = Path(__file__).resolve().parents[2] / "scenarios" / "parts"


def ride(system: System, name: str, t_s: float) -> tuple[float, float]:
    """Where a straight, steady actor of the catalogue is, by hand."""
    actor = system.actors[name]
    (start,) = actor.path.waypoints_m
    assert isinstance(actor.path.speed_mps, float) and actor.path.heading_deg == 0.0
    return start[0] + actor.path.speed_mps * t_s, start[1]


def target_from_ego(system: System, t_s: float) -> tuple[float, float]:
    assert system.target is not None
    ego, target = ride(system, system.ego, t_s), ride(system, system.target, t_s)
    return target[0] - ego[0], target[1] - ego[1]


@pytest.mark.parametrize("name", ["overtake-approach", "overtake-recede"])
@pytest.mark.parametrize(
    ("system", "duration_s", "car_m", "rider_m"), [("car", 5.2, 65.0, 38.0), ("wearable", 5.8, 60.0, 30.0)]
)
def test_durations_and_distances_are_the_papers(
    name: str, system: str, duration_s: float, car_m: float, rider_m: float
) -> None:
    family = load_scenario(name)
    runs = [family.system(system, seed=seed) for seed in range(40)]
    assert all(run.duration_s == duration_s for run in runs)
    for actor, metres in (("car", car_m), ("rider", rider_m)):
        driven = [ride(run, actor, duration_s)[0] - ride(run, actor, 0.0)[0] for run in runs]
        assert abs(np.mean(driven) - metres) < 0.02 * metres
        assert np.ptp(driven) > 0.01 * metres


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", ["overtake-approach", "overtake-recede"])
def test_the_car_passes_three_metres_to_the_left_of_the_rider(name: str, seed: int) -> None:
    for system in ("car", "wearable"):
        run = load_scenario(name).system(system, seed=seed)
        side = ride(run, "car", 0.0)[1] - ride(run, "rider", 0.0)[1]
        assert 2.8 <= side <= 3.2
        assert run.target == {"car": "rider", "wearable": "car"}[system] != run.ego


@pytest.mark.parametrize("seed", SEEDS)
def test_in_the_approach_the_car_closes_in_from_behind_and_ends_about_level(seed: int) -> None:
    car = load_scenario("overtake-approach").system("car", seed=seed)
    assert 25 < target_from_ego(car, 0.0)[0] < 32 and -1 < target_from_ego(car, 5.2)[0] < 4
    wearable = load_scenario("overtake-approach").system("wearable", seed=seed)
    assert -34 < target_from_ego(wearable, 0.0)[0] < -28 and -4 < target_from_ego(wearable, 5.8)[0] < 1
    assert wearable.rig == "wearable-back"


@pytest.mark.parametrize("seed", SEEDS)
def test_in_the_recession_the_car_starts_level_and_pulls_ahead(seed: int) -> None:
    car = load_scenario("overtake-recede").system("car", seed=seed)
    assert target_from_ego(car, 0.0)[0] == 0 and -30 < target_from_ego(car, 5.2)[0] < -24
    wearable = load_scenario("overtake-recede").system("wearable", seed=seed)
    assert target_from_ego(wearable, 0.0)[0] == 0 and 27 < target_from_ego(wearable, 5.8)[0] < 33
    assert wearable.rig == "wearable-front"


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", list_scenarios())
def test_actors_stay_on_their_lanes(name: str, seed: int) -> None:
    scenario = load_scenario(name).resolve(seed)
    for system in scenario.systems.values():
        for actor in system.actors.values():
            y = actor.path.waypoints_m[0][1]
            half = 0.5 * CATEGORY_SIZES[actor.category][1] * actor.scale
            assert (
                any(y0 <= y - half and y + half <= y1 for y0, y1 in scenario.road.lanes_m)
                or actor.category == "board"
            )


@pytest.mark.parametrize("name", list_scenarios())
def test_the_background_holds_everything_the_paper_names_on_both_sides(name: str) -> None:
    scenario = load_scenario(name).resolve(0)
    counts: dict[str, int] = {}
    sides: dict[str, set[bool]] = {}
    for scatter in scenario.background:
        counts[scatter.part] = counts.get(scatter.part, 0) + scatter.count
        sides.setdefault(scatter.category, set()).add(scatter.area_m[1] > 0)
    assert set(counts) == {"car", "van", "pedestrian", "tree", "post", "building"}
    assert all(sides[category] == {True, False} for category in ("car", "tree", "post", "building"))
    geoms = sum(
        count * (PARTS / f"{part}.xml").read_text().count("<geom name") for part, count in counts.items()
    )
    assert 200 <= geoms <= 350, geoms


def test_nothing_moves_before_the_static_board() -> None:
    scenario = load_scenario("static-board").resolve(0)
    assert all(actor.path.speed_mps == 0 for actor in scenario.system("car").actors.values())
    assert all(scatter.speed_mps == 0 for scatter in scenario.background)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_board_faces_the_car_eight_metres_ahead(seed: int) -> None:
    system = load_scenario("static-board").system("car", seed=seed)
    board = system.actors["board"].path
    x, y = board.waypoints_m[0]
    lidar_x = load_rig(system.rig).ego_origin_m[0]
    assert math.hypot(x - lidar_x, y) == pytest.approx(8.0, abs=0.1)
    assert 165 < board.heading_deg < 195
    assert abs(math.degrees(math.atan2(y, x - lidar_x - 0.55))) < 20 - 5  # inside the 40 degrees of cam-front


def test_the_empty_road_has_an_ego_that_drives_and_no_target() -> None:
    scenario = load_scenario("empty-road").resolve(0)
    assert set(scenario.systems) == {"car", "wearable"}
    for system in scenario.systems.values():
        assert system.target is None and list(system.actors) == [system.ego]


# -- rigs and sensors --------------------------------------------------------------------------------


def views(rig: Rig) -> list[tuple[float, float]]:
    """(yaw, half width) of every camera in degrees."""
    sensors = rig_sensors(rig)
    return [
        (rig.sensors[name].pose.rpy_deg[2], camera.fov_deg / 2)
        for name in cameras_of(rig)
        if isinstance(camera := sensors[name], CameraSensor)
    ]


def seen(rig: Rig, yaw_deg: float) -> bool:
    return any(abs((yaw_deg - yaw + 180) % 360 - 180) <= half for yaw, half in views(rig))


def test_the_car_sees_all_round_with_two_narrow_and_four_wide_cameras() -> None:
    rig = load_rig("car-six-cameras")
    assert sorted(half * 2 for _, half in views(rig)) == [40, 40, 96, 96, 96, 96]
    assert all(seen(rig, yaw) for yaw in range(-180, 180))
    heights = {rig.sensors[name].pose.xyz_m[2] for name in cameras_of(rig)}
    assert heights == {1.62} and rig.sensors["lidar"].pose.xyz_m == (0, 0, 1.85)


@pytest.mark.parametrize(("name", "facing", "ahead"), [("wearable-front", 0, 1), ("wearable-back", 180, -1)])
def test_a_wearable_sees_two_hundred_degrees_to_its_side(name: str, facing: int, ahead: int) -> None:
    rig = load_rig(name)
    assert sum(seen(rig, facing + yaw) for yaw in range(-180, 180)) == pytest.approx(200, abs=1)
    assert all(seen(rig, facing + yaw) for yaw in range(-99, 100))
    assert rig.sensors["lidar"].pose.xyz_m == (0, 0, 1.42)
    assert rig.sensors["lidar"].pose.rpy_deg == (0, 0, facing)
    assert {rig.sensors[camera].pose.xyz_m[2] for camera in cameras_of(rig)} == {1.32}
    assert (rig.ego_origin_m[0] - -0.08) == pytest.approx(0.26 * ahead)  # the torso is 8 cm behind the middle
    for camera in cameras_of(rig):  # each looks away from the rider
        x, y, _ = rig.sensors[camera].pose.xyz_m
        yaw = math.radians(rig.sensors[camera].pose.rpy_deg[2])
        side = math.sin(yaw) * y
        assert camera == "cam-centre" or side > 0.05
        assert camera != "cam-centre" or math.cos(yaw) * x > 0


def test_the_lidar_is_the_data_sheets_os1_64() -> None:
    lidar = load_sensor("os1-64")
    assert isinstance(lidar, LidarSensor)
    elevation, offset = np.array(lidar.elevation_deg), np.array(lidar.azimuth_offset_deg)
    assert len(elevation) == len(offset) == 64 and lidar.columns == 1024 and lidar.rate_hz == 10
    assert elevation.max() == 16.611 and elevation.min() == -16.611
    assert np.allclose(np.diff(elevation), -33.222 / 63, atol=1.1e-3)
    assert np.array_equal(offset, np.tile([3.164, 1.055, -1.055, -3.164], 16))
    assert (lidar.min_range_m, lidar.range_at_10_percent_m, lidar.range_at_80_percent_m) == (0.8, 40, 120)
    assert (lidar.noise.high_m, lidar.noise.medium_m, lidar.noise.low_m) == (0.015, 0.03, 0.10)
    assert (lidar.resolution_m, lidar.angle_noise_deg, lidar.false_positive_rate) == (0.012, 0.01, 1e-4)


def test_the_spin_passes_the_front_a_quarter_turn_after_it_starts() -> None:
    lidar = load_sensor("os1-64")
    assert isinstance(lidar, LidarSensor)
    turn = -1 if lidar.clockwise else 1
    to_front_ms = (turn * (0 - lidar.start_azimuth_deg) % 360) / 360 * 1e3 / lidar.rate_hz
    assert to_front_ms == 25


def test_the_cars_cameras_share_one_pulse_and_the_riders_have_none() -> None:
    for name, trigger in (("car-six-cameras", "lidar_angle"), ("wearable-back", "free_run")):
        rig = load_rig(name)
        cameras = [s for s in rig_sensors(rig).values() if isinstance(s, CameraSensor)]
        shutter, stamp = ("global", "trigger") if trigger == "lidar_angle" else ("rolling", "arrival")
        assert {(c.trigger, c.shutter, c.stamp) for c in cameras} == {(trigger, shutter, stamp)}
        assert rig.pulse_deg == (0.0 if trigger == "lidar_angle" else None)
        assert all(mount.trigger_deg is None for mount in rig.sensors.values())
        assert {(c.width_px, c.height_px) for c in cameras} == {(960, 600)}


def test_gnss_is_rtk_at_five_hertz() -> None:
    for name in ("gnss-rtk", "gnss-rtk-wearable"):
        gnss = load_sensor(name)
        assert isinstance(gnss, GnssSensor) and gnss.rate_hz == 5 and gnss.bias_m == 0.02


def test_category_sizes_are_the_papers_where_it_gives_them() -> None:
    assert max(CATEGORY_SIZES["car"][:2]) == 4.5 and max(CATEGORY_SIZES["rider"][:2]) == 1.5
    assert SIZE_SPREAD == 0.08
    assert all(min(size) > 0 for size in CATEGORY_SIZES.values())
