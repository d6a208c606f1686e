"""A bent road against Fresnel's integrals, its circle, and finite differences of the motion along it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import fresnel

from scenarios.errors import BadInput
from scenarios.scenario import Bend, Path, Scatter
from simbench import scatter
from simbench.bend import BentRoad
from simbench.path import Track, make_track

S = 1_000_000_000


def ns(t_s: float | list[float] | np.ndarray) -> np.ndarray:
    return np.round(np.atleast_1d(np.asarray(t_s, dtype=np.float64)) * S).astype(np.int64)


def bend(**changes: object) -> Bend:
    fields = {"at_m": 10.0, "length_m": 80.0, "radius_m": 50.0, "turn": "left", "transition_m": 12.0}
    return Bend.model_validate({**fields, **changes})


bends = st.builds(
    bend,
    at_m=st.floats(-50.0, 50.0),
    length_m=st.floats(40.0, 100.0),
    radius_m=st.floats(50.0, 150.0),
    turn=st.sampled_from(["left", "right"]),
    transition_m=st.floats(1.0, 20.0),
)


def on(along_m: np.ndarray | list[float], left_m: float = 0.0) -> np.ndarray:
    along = np.asarray(along_m, dtype=np.float64)
    return np.column_stack([along, np.full(len(along), left_m)])


# -- the map -----------------------------------------------------------------------------------------------


def test_before_the_bend_road_and_world_are_the_same() -> None:
    points = np.array([[-30.0, 4.0], [0.0, -7.0], [10.0, 2.5]])
    np.testing.assert_allclose(BentRoad(bend()).to_world(points), points, atol=1e-12)
    np.testing.assert_allclose(BentRoad(bend()).heading_rad(points[:, 0]), 0.0, atol=1e-15)


def test_the_bend_starts_as_the_clothoid_of_fresnels_integrals() -> None:
    along = np.linspace(0.0, 12.0, 50)
    scale = np.sqrt(np.pi * 50.0 * 12.0)  # curvature s / (R T): angle s^2 / (2 R T)
    sine, cosine = fresnel(along / scale)
    found = BentRoad(bend()).to_world(on(10.0 + along))
    np.testing.assert_allclose(found, np.column_stack([10.0 + scale * cosine, scale * sine]), atol=1e-9)


@given(which=bends)
def test_between_the_clothoids_the_road_is_a_circle_of_its_radius(which: Bend) -> None:
    road, side = BentRoad(which), 1.0 if which.turn == "left" else -1.0
    along = np.linspace(which.at_m + which.transition_m, which.at_m + which.length_m - which.transition_m, 40)
    centre = road.to_world(on(along, side * which.radius_m))  # a radius to the inner side: always one point
    np.testing.assert_allclose(centre - centre[0], 0.0, atol=1e-8)
    np.testing.assert_allclose(road.curvature_1pm(along), side / which.radius_m, rtol=1e-9)


@given(which=bends)
def test_after_the_bend_it_is_straight_and_has_turned_by_its_length_less_a_transition(which: Bend) -> None:
    road, end = BentRoad(which), which.at_m + which.length_m
    turned = (which.length_m - which.transition_m) / which.radius_m * (1.0 if which.turn == "left" else -1.0)
    xy = road.to_world(on([end, end + 10.0, end + 40.0]))
    ahead = np.array([np.cos(turned), np.sin(turned)])
    np.testing.assert_allclose(xy[1:] - xy[0], np.outer([10.0, 40.0], ahead), atol=1e-8)


@given(which=bends, along=st.floats(-60.0, 160.0), left=st.floats(-30.0, 30.0))
def test_a_right_bend_is_the_mirror_of_a_left_one(which: Bend, along: float, left: float) -> None:
    other = which.model_copy(update={"turn": "right" if which.turn == "left" else "left"})
    (x, y), (mx, my) = (
        BentRoad(which).to_world(on([along], left))[0],
        BentRoad(other).to_world(on([along], -left))[0],
    )
    assert (mx, my) == pytest.approx((x, -y), abs=1e-12)


@given(which=bends, along=st.floats(-60.0, 160.0), left=st.floats(-30.0, 30.0))
def test_distances_across_the_road_are_kept(which: Bend, along: float, left: float) -> None:
    road = BentRoad(which)
    ((x, y),) = road.to_world(on([along], left)) - road.to_world(on([along]))
    heading = float(road.heading_rad(np.array([along]))[0])
    assert (x, y) == pytest.approx((-left * np.sin(heading), left * np.cos(heading)), abs=1e-9)


# -- paths on it -------------------------------------------------------------------------------------------


def velocity(track: Track, t_s: np.ndarray, h_s: float = 1e-3) -> np.ndarray:
    return (track.at(ns(t_s + h_s))[0] - track.at(ns(t_s - h_s))[0]) / (2.0 * h_s)


@settings(max_examples=40)
@given(
    which=bends,
    x=st.floats(-40.0, 120.0),
    y=st.floats(-20.0, 20.0),
    heading=st.floats(-20.0, 20.0) | st.floats(160.0, 200.0),
    speed=st.floats(2.0, 20.0),
)
def test_a_path_keeps_its_speed_over_ground_heads_where_it_goes_and_starts_at_its_waypoint(
    which: Bend, x: float, y: float, heading: float, speed: float
) -> None:
    road = BentRoad(which)
    try:
        track = make_track(Path(waypoints_m=((x, y),), heading_deg=heading, speed_mps=speed), road)
    except BadInput:  # 20 degrees across lead to the centre of a tight bend
        return
    assert track.at(ns(0.0))[0] == pytest.approx(road.to_world(np.array([[x, y]])), abs=1e-5)
    t = np.linspace(-0.5, 6.0, 66)
    v = velocity(track, t)
    np.testing.assert_allclose(np.hypot(*v.T), speed, rtol=1e-4)
    _, found = track.at(ns(t))
    turn = np.angle(np.exp(1j * (found - np.arctan2(v[:, 1], v[:, 0]))))
    np.testing.assert_allclose(turn, 0.0, atol=2e-4)


def test_parallel_paths_stay_as_far_apart_as_declared() -> None:
    road = BentRoad(bend(radius_m=60.0))
    car = make_track(Path(waypoints_m=((0.0, 0.0),), speed_mps=12.5), road)
    rider = make_track(Path(waypoints_m=((28.5, -3.0),), speed_mps=7.3), road)
    way, _ = car.at(ns(np.arange(-1.0, 9.0, 1e-3)))
    there, _ = rider.at(ns(np.linspace(0.0, 5.0, 11)))
    gap = np.hypot(*(there[:, None] - way).transpose(2, 0, 1)).min(axis=1)
    np.testing.assert_allclose(gap, 3.0, atol=1e-4)


def test_on_the_circle_a_path_outside_the_centre_line_has_the_larger_radius() -> None:
    track = make_track(Path(waypoints_m=((30.0, -3.0),), speed_mps=10.0), BentRoad(bend(radius_m=50.0)))
    t = np.array([0.5, 1.0, 2.0])
    turn_radps = (track.at(ns(t + 0.01))[1] - track.at(ns(t - 0.01))[1]) / 0.02
    np.testing.assert_allclose(turn_radps, 10.0 / 53.0, rtol=1e-6)


def test_two_waypoints_are_the_line_through_them_along_the_road() -> None:
    road = BentRoad(bend())
    one = make_track(Path(waypoints_m=((20.0, 2.0),), heading_deg=180.0, speed_mps=5.0), road)
    two = make_track(Path(waypoints_m=((20.0, 2.0), (15.0, 2.0)), speed_mps=5.0), road)
    t_ns = ns(np.linspace(-3.0, 8.0, 23))
    for a, b in zip(one.at(t_ns), two.at(t_ns), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_who_stands_is_turned_with_the_road_and_who_crosses_it_walks_straight() -> None:
    road = BentRoad(bend())
    along = np.array([40.0])
    stands = make_track(Path(waypoints_m=((40.0, 20.0),), heading_deg=30.0), road)
    xy, heading = stands.at(ns([0.0, 5.0]))
    np.testing.assert_allclose(xy, np.tile(road.to_world(on(along, 20.0)), (2, 1)), atol=1e-12)
    np.testing.assert_allclose(heading, float(road.heading_rad(along)[0]) + np.pi / 6, atol=1e-12)
    crosses = make_track(Path(waypoints_m=((40.0, -6.0),), heading_deg=90.0, speed_mps=1.5), road)
    np.testing.assert_allclose(crosses.at(ns(4.0))[0], road.to_world(on(along, 0.0)), atol=1e-9)


def test_a_path_into_the_centre_of_the_bend_is_one_sentence() -> None:
    with pytest.raises(BadInput, match=r"^a path comes to \d+ m beside the road, .* of a bend of 50 m\.$"):
        make_track(Path(waypoints_m=((0.0, 0.0),), heading_deg=60.0, speed_mps=5.0), BentRoad(bend()))


# -- background on it --------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(which=bends, seed=st.integers(0, 2**31))
def test_background_beside_a_bend_touches_nothing_in_the_world_while_it_walks(which: Bend, seed: int) -> None:
    road, radius = BentRoad(which), {"car": 2.4, "pedestrian": 0.4}
    groups = (
        Scatter(part="car", category="car", count=6, area_m=(0.0, -30.0, 100.0, 30.0), align_deg=0.0),
        Scatter(
            part="pedestrian",
            category="pedestrian",
            count=14,
            area_m=(10.0, 3.0, 60.0, 30.0),
            align_deg=180.0,
            speed_mps=1.2,
        ),
    )
    t_ns = ns(np.linspace(0.0, 6.0, 25))
    drive, _ = make_track(Path(waypoints_m=((0.0, 16.0),), speed_mps=12.0), road).at(t_ns)
    circles = np.column_stack([drive, np.full(len(drive), 2.4)])
    placed = scatter.place(groups, radius, ((-1.7, 1.7),), circles, 6.0, np.random.default_rng(seed), road)
    ways = []
    for item in placed:
        end = (item.xy_m[0] + np.cos(item.heading_rad), item.xy_m[1] + np.sin(item.heading_rad))
        ways.append(
            make_track(Path(waypoints_m=(item.xy_m, end), speed_mps=item.speed_mps), road).at(t_ns)[0]
        )
    reach = [radius[item.part] * item.scale for item in placed]
    for i, way in enumerate(ways):
        assert np.hypot(*(way - drive).T).min() > reach[i] + 2.4
        for k in range(i):
            assert np.hypot(*(way - ways[k]).T).min() > reach[i] + reach[k]


def test_on_the_inner_side_of_a_bend_a_walk_is_kept_free_over_all_its_length() -> None:
    """7.2 m of the world are 18 m of the centre line where 30 of 50 m of radius are left out."""
    road, walk_s = BentRoad(bend(radius_m=50.0, length_m=120.0)), 6.0
    walker = Scatter(
        part="pedestrian",
        category="pedestrian",
        count=1,
        area_m=(40.0, 30.0, 40.01, 30.01),
        align_deg=0.0,
        speed_mps=1.2,
    )
    end = make_track(Path(waypoints_m=((40.0, 30.0),), speed_mps=1.2), road).at(ns(walk_s))[0]
    np.testing.assert_allclose(end, road.to_world(on([58.0], 30.0)), atol=1e-3)
    for along_m, free in ((52.0, False), (57.0, False), (62.0, True)):
        post = np.column_stack([road.to_world(on([along_m], 30.0)), [0.4]])
        try:
            scatter.place((walker,), {"pedestrian": 0.4}, (), post, walk_s, np.random.default_rng(0), road)
        except BadInput:
            assert not free, along_m
        else:
            assert free, along_m
