"""The steps of the robust pipeline, one by one: laws, and rows worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fusion.association import AssociationConfig, CandidateSet, associate, contested
from fusion.box_matching import MatchedBox, MatchingConfig, ranked_candidates
from fusion.camera import PinholeCamera
from fusion.candidates import cut, fit_boxes, view_clusters
from fusion.confidence import ConfidenceConfig, confidence
from fusion.deskew import against_motion, deskew, poses_at
from fusion.footprint import FootprintConfig, cluster_from_above
from fusion.geometry import Transform, rotation_rpy
from fusion.kalman import KalmanConfig, correct, local_lines, predict, smooth, smooth_robustly, start
from fusion.local_ground import LocalGround, LocalGroundConfig, fit_local_ground
from fusion.messages import Calibration, CategorySize, Detection, EgoMotion
from fusion.odometry import Odometry, from_odometry, to_odometry
from fusion.pixel_shift import PixelShiftConfig, Vote, vote_shift
from fusion.scene import SceneConfig, build_scene
from fusion.shake import ShakeConfig, yaw_shake_rad
from fusion.surface_to_centre import SurfaceConfig, box_heading, to_centre
from fusion.synthetic import Block, beams, cast
from fusion.working_frame import WorkingFrame, beam_density
from tests.fusion.make import lidar_scan

CAR = CategorySize(mean_m=(4.5, 1.8, 1.5), spread=0.08)
PERSON = CategorySize(mean_m=(0.6, 0.6, 1.75), spread=0.08)
MS = 1_000_000
PINHOLE = PinholeCamera(fx_px=500.0, fy_px=500.0, cx_px=480.0, cy_px=300.0, width_px=960, height_px=600)


def rng(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def motion(
    stamp_ns: int, speed_mps: float = 0.0, yaw_radps: float = 0.0, *, roll_pitch: tuple[float, float] = (0, 0)
) -> EgoMotion:
    return EgoMotion(
        sensor="imu",
        seq=stamp_ns // (10 * MS),
        stamp_ns=stamp_ns,
        arrival_ns=stamp_ns,
        velocity_mps=np.array([speed_mps, 0.0, 0.0]),
        rate_radps=np.array([*roll_pitch, yaw_radps]),
        specific_force_mps2=np.array([0.0, 0.0, 9.81]),
    )


def driven(
    speed_mps: float, yaw_radps: float, *, frame_yaw_rad: float = 0.0, seconds: float = 2.0
) -> Odometry:
    odometry = Odometry(frame_yaw_rad)
    for k in range(int(seconds * 100) + 1):
        odometry.add(motion(10 * MS * k, speed_mps, yaw_radps))
    return odometry


# -- odometry and deskew ----------------------------------------------------------------------------------


@settings(max_examples=20)
@given(speed=st.floats(-20, 20), rate=st.floats(-0.6, 0.6), time_s=st.floats(0, 2.2))
def test_a_steady_turn_is_a_circle(speed: float, rate: float, time_s: float) -> None:
    x, y, yaw = driven(speed, rate).pose(np.array([round(time_s * 1e9)]))[0]
    assert yaw == pytest.approx(rate * time_s, abs=1e-6)
    if abs(rate) > 1e-3:
        radius = speed / rate
        expected = radius * np.array([math.sin(yaw), 1.0 - math.cos(yaw)])
    else:
        expected = np.array([speed * time_s, 0.0])
    np.testing.assert_allclose([x, y], expected, atol=0.003)


def test_the_odometry_turns_with_the_frame_that_is_worked_in() -> None:
    times = np.arange(0, 2_000 * MS, 37 * MS)
    plain, turned = driven(10.0, 0.2).pose(times), driven(10.0, 0.2, frame_yaw_rad=0.7).pose(times)
    c, s = math.cos(0.7), math.sin(0.7)
    np.testing.assert_allclose(turned[:, 0], c * plain[:, 0] + s * plain[:, 1], atol=1e-9)
    np.testing.assert_allclose(turned[:, 1], c * plain[:, 1] - s * plain[:, 0], atol=1e-9)
    np.testing.assert_allclose(turned[:, 2], plain[:, 2], atol=1e-12)


def test_what_is_old_or_not_finite_moves_nothing() -> None:
    odometry, other = driven(5.0, 0.1), driven(5.0, 0.1)
    for bad in (motion(500 * MS, 99.0), motion(2_500 * MS, float("nan")), motion(2_500 * MS, 1.0, np.inf)):
        odometry.add(bad)
    at = np.array([2_400 * MS])
    np.testing.assert_array_equal(odometry.pose(at), other.pose(at))


def test_without_messages_nothing_moves() -> None:
    assert not Odometry().pose(np.array([0, 10**12])).any()
    assert not Odometry().speed_mps().any()


def test_more_messages_than_there_was_room_for_are_kept() -> None:
    assert driven(10.0, 0.0, seconds=12.0).pose(np.array([12_000 * MS]))[0, 0] == pytest.approx(120.0)


@given(seed=st.integers(0, 10**6))
def test_to_and_from_the_odometry_frame_are_inverse(seed: int) -> None:
    r = rng(seed)
    xy_m, pose = r.normal(size=(7, 2)) * 30, r.normal(size=(7, 3)) * 5
    np.testing.assert_allclose(from_odometry(to_odometry(xy_m, pose), pose), xy_m, atol=1e-9)


@pytest.mark.parametrize(("speed", "rate"), [(12.5, 0.0), (12.5, 0.25), (5.0, -0.5)])
def test_the_wall_that_a_driving_ego_sees_curved_is_flat_again(speed: float, rate: float) -> None:
    odometry = driven(speed, rate)
    fire_ns = 1_000 * MS + np.arange(1000) * 100_000  # a sweep of 100 ms
    wall_m = np.stack([np.full(1000, 40.0), np.linspace(-5.0, 20.0, 1000)], axis=1)
    seen_m = from_odometry(wall_m, odometry.pose(fire_ns))
    at_ns = 1_030 * MS
    straight = deskew(seen_m, fire_ns, at_ns, odometry)
    pose = odometry.pose(np.array([at_ns]))
    assert np.abs(to_odometry(straight, pose)[:, 0] - 40.0).max() < 1e-5
    assert np.abs(to_odometry(seen_m, pose)[:, 0] - 40.0).max() > 0.2


@given(speed=st.floats(-15, 15), rate=st.floats(-0.6, 0.6), mount=st.floats(-3, 3), at=st.integers(0, 1_900))
@settings(max_examples=20)
def test_what_stands_still_is_where_the_camera_sees_it_at_any_instant(
    speed: float, rate: float, mount: float, at: int
) -> None:
    T_ego_camera = Transform(rotation=rotation_rpy(0.1, -0.2, 0.5), translation_m=np.array([0.5, 0.1, 1.6]))
    T_ego_lidar = Transform(rotation=rotation_rpy(0, 0, mount), translation_m=np.array([0.0, 0.0, 1.8]))
    calibration = Calibration(
        T_ego_sensor={"lidar": T_ego_lidar, "front": T_ego_camera}, cameras={"front": PINHOLE}
    )
    frame, ego = WorkingFrame(calibration, "lidar"), driven(speed, rate)
    for k in range(201):
        frame.odometry.add(motion(10 * MS * k, speed, rate))
    post_m = np.array([20.0, 3.0, 1.0])  # in the world, which is the ego frame at 0

    def seen_from_ego(stamp_ns: int) -> np.ndarray:
        xy_m = from_odometry(post_m[None, :2], ego.pose(np.array([stamp_ns])))[0]
        return np.array([*xy_m, post_m[2]])

    scan_ns, image_ns = 1_000 * MS, at * MS
    in_scene = frame.T_ego_work.inverse().apply(seen_from_ego(scan_ns))
    T_camera_scene = frame.T_camera_scene("front", image_ns, frame.odometry.pose(np.array([scan_ns])))
    expected = T_ego_camera.inverse().apply(seen_from_ego(image_ns))
    np.testing.assert_allclose(T_camera_scene.apply(in_scene), expected, atol=1e-6)


def test_a_scene_is_as_a_still_world_would_be() -> None:
    """A wall ahead, swept from right to left in 100 ms by an ego that drives towards it."""
    calibration = Calibration(
        T_ego_sensor={"lidar": Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.8]))},
        cameras={},
    )
    frame = WorkingFrame(calibration, "lidar")
    for k in range(201):
        frame.odometry.add(motion(10 * MS * k, 12.5))
    fire_ns = np.arange(1000) * 100_000
    y_m, z_m = np.linspace(-8.0, 8.0, 1000), np.tile([1.2, 2.0], 500) - 1.8
    xyz_m = np.column_stack([30.0 - 12.5 * fire_ns * 1e-9, y_m, z_m])
    scan = lidar_scan(xyz_m, stamp_ns=0, offset_ns=fire_ns)
    scene = build_scene(scan, frame, SceneConfig())
    assert len(scene.points) == 1000
    assert np.ptp(scene.xyz_m[:, 0]) < 1e-3 and np.ptp(scene.xy_odom_m[:, 0]) < 1e-3
    assert np.abs(scene.xyz_m[:, 0] - (30.0 - 12.5 * scene.at_ns * 1e-9)).max() < 1e-3
    bent = build_scene(scan, frame, SceneConfig(deskew=False))
    assert np.ptp(bent.xyz_m[:, 0]) > 1.2


def test_poses_between_the_knots_are_as_good_as_exact() -> None:
    odometry = driven(20.0, 1.0)
    fire_ns = np.arange(0, 100 * MS, 7_919)
    np.testing.assert_allclose(poses_at(odometry, fire_ns), odometry.pose(fire_ns), atol=1e-4)
    assert poses_at(odometry, np.zeros(0, dtype=np.int64)).shape == (0, 3)


def test_the_points_of_a_moving_object_meet_at_one_instant() -> None:
    fire_ns = np.array([0, 10 * MS, 20 * MS])
    path_m = np.array([[0.0, 0.0], [0.1, -0.02], [0.2, -0.04]])
    moved = against_motion(path_m, fire_ns, 10 * MS, np.array([10.0, -2.0]))
    np.testing.assert_allclose(moved, [[0.1, -0.02]] * 3, atol=1e-12)


# -- ground -----------------------------------------------------------------------------------------------


def heights(xyz_m: np.ndarray, config: LocalGroundConfig | None = None) -> np.ndarray:
    xyz = xyz_m.T.astype(np.float32)
    range_m, azimuth_rad = np.hypot(xyz[0], xyz[1]), np.arctan2(xyz[1], xyz[0])
    ground = fit_local_ground(range_m, azimuth_rad, xyz[2], config or LocalGroundConfig())
    assert isinstance(ground, LocalGround)
    return np.asarray(xyz[2] - ground.at(range_m, azimuth_rad))


def sweep_of(blocks: tuple[Block, ...]) -> tuple[np.ndarray, np.ndarray]:
    """A sweep [n 3] of level ground and blocks, z = 0 on the ground; and the block hit (-1: ground)."""
    rays = beams(64, 720, np.deg2rad(16.6))
    range_m, hit = cast(np.array([0.0, 0.0, 1.8]), rays, blocks)
    near = range_m < 50.0
    return rays[near] * range_m[near, None] + np.array([0.0, 0.0, 1.8]), hit[near]


STREET = (
    Block(centre_m=(12.0, 2.0, 0.75), size_m=(4.5, 1.8, 1.5)),
    Block(centre_m=(8.0, -2.0, 0.9), size_m=(0.5, 0.5, 1.8)),
    Block(centre_m=(0.0, 12.0, 2.0), size_m=(40.0, 0.5, 4.0)),
)


def test_level_ground_is_level_and_objects_stand_on_it() -> None:
    xyz_m, hit = sweep_of(STREET)
    height = heights(xyz_m)
    assert np.abs(height[hit < 0]).max() < 0.02
    assert np.abs(height[hit >= 0] - xyz_m[hit >= 0, 2]).max() < 0.06


def test_the_ground_of_a_shaken_sweep_is_found_where_one_plane_fails() -> None:
    xyz_m, hit = sweep_of(STREET)
    azimuth = np.arctan2(xyz_m[:, 1], xyz_m[:, 0])
    pitch = np.deg2rad(1.5) * np.sin(2.0 * azimuth)  # two swings in a sweep
    shaken = xyz_m.copy()
    shaken[:, 2] -= pitch * np.hypot(xyz_m[:, 0], xyz_m[:, 1])
    height, near = heights(shaken), np.hypot(xyz_m[:, 0], xyz_m[:, 1]) < 30.0
    assert np.quantile(np.abs(height[near & (hit < 0)]), 0.99) < 0.1
    flat = xyz_m[hit < 0]
    rows = np.column_stack([flat[:, :2], np.ones(len(flat))])
    plane = np.linalg.lstsq(rows, shaken[hit < 0, 2], rcond=None)[0]
    assert np.quantile(np.abs(shaken[hit < 0, 2] - rows @ plane), 0.9) > 0.2


def test_a_kerb_belongs_to_the_ground() -> None:
    xyz_m, _ = sweep_of(())
    raised = xyz_m.copy()
    raised[np.abs(xyz_m[:, 1]) > 5.0, 2] += 0.15
    assert np.median(heights(raised)[np.abs(xyz_m[:, 1]) > 7.0]) < 0.05


def test_without_points_the_ground_is_level() -> None:
    none = np.zeros(0, dtype=np.float32)
    ground = fit_local_ground(none, none, none, LocalGroundConfig())
    far = np.array([3.0, 55.0, 200.0], dtype=np.float32)
    assert not ground.at(far, np.array([-3.1, 0.0, 3.1], dtype=np.float32)).any()


@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_the_order_of_the_points_does_not_move_the_ground(seed: int) -> None:
    xyz_m, _ = sweep_of(STREET)
    order = rng(seed).permutation(len(xyz_m))
    np.testing.assert_allclose(heights(xyz_m[order]), heights(xyz_m)[order], atol=1e-5)


# -- clusters ---------------------------------------------------------------------------------------------


def test_clusters_are_what_touches_in_the_grid() -> None:
    xy_m = np.array([[0.1, 0.1], [0.3, 0.4], [0.6, 0.6], [2.1, 0.1], [2.2, 0.1], [2.1, 0.2], [9.0, 9.0]])
    height_m = np.array([0.2, 0.5, 1.7, 0.3, 0.4, 0.1, 1.0])
    found = cluster_from_above(np.column_stack([xy_m, height_m - 0.5]), height_m, 0.25, FootprintConfig())
    assert found.label.tolist() == [0, 0, 0, 1, 1, 1, -1]
    assert found.count.tolist() == [3, 3]
    assert [found.points(c).tolist() for c in (0, 1)] == [[0, 1, 2], [3, 4, 5]]
    np.testing.assert_allclose(found.mean_m, [[1 / 3, 1.1 / 3], [6.4 / 3, 0.4 / 3]])
    np.testing.assert_allclose(found.low_m[1], [2.1, 0.1])
    np.testing.assert_allclose(found.high_m[1], [2.2, 0.2])
    assert found.bottom_m.tolist() == [0.2, 0.1] and found.top_m.tolist() == [1.7, 0.4]
    np.testing.assert_allclose(found.ground_m, -0.5)


def test_a_hedge_with_somebody_at_it_is_cut_again() -> None:
    along = np.arange(0.0, 20.0, 0.04)
    hedge = np.column_stack([along, np.zeros_like(along)])
    somebody = np.column_stack([10.0 + 0.3 * np.arange(10) / 10, np.full(10, 0.3)])
    xyz_m, height_m = np.zeros((510, 3)), np.ones(510)
    xyz_m[:, :2] = np.concatenate([hedge, somebody])
    whole = cluster_from_above(xyz_m, height_m, 0.25, FootprintConfig(split_m=50.0))
    cut = cluster_from_above(xyz_m, height_m, 0.25, FootprintConfig())
    assert len(whole.count) == 1
    assert sorted(cut.count.tolist()) == [10, 500]
    assert cut.points(int(np.argmin(cut.count))).tolist() == list(range(500, 510))


def test_no_points_make_no_cluster() -> None:
    none = cluster_from_above(np.zeros((0, 3)), np.zeros(0), 0.25, FootprintConfig())
    assert len(none.count) == 0 and none.mean_m.shape == (0, 2)


@given(seed=st.integers(0, 10**6), count=st.integers(1, 80))
def test_the_order_of_the_points_does_not_change_the_clusters(seed: int, count: int) -> None:
    r = rng(seed)
    xyz_m, height_m = r.uniform(0, 6, (count, 3)), r.uniform(0, 2, count)
    order = r.permutation(count)
    plain = cluster_from_above(xyz_m, height_m, 0.25, FootprintConfig(min_points=2))
    other = cluster_from_above(xyz_m[order], height_m[order], 0.25, FootprintConfig(min_points=2))
    np.testing.assert_array_equal(other.label, plain.label[order])
    np.testing.assert_allclose(other.mean_m, plain.mean_m, atol=1e-12)


def test_the_density_of_the_beams_is_that_of_the_sensor() -> None:
    rays = beams(32, 900, np.deg2rad(16.0))
    scan = replace(lidar_scan(rays * 10.0), ring=(np.arange(len(rays)) % 32).astype(np.int16))
    spacing_sr = np.deg2rad(32.0) / 31 * 2 * np.pi / 900
    assert beam_density(scan) == pytest.approx(1.0 / spacing_sr, rel=0.02)
    assert beam_density(lidar_scan(rays[:50])) is None  # all of one ring
    assert beam_density(lidar_scan()) is None


# -- from the surface to the centre -----------------------------------------------------------------------


def outline(length_m: float, width_m: float, *, visible_from: np.ndarray | None = None) -> np.ndarray:
    """Points on the sides of a rectangle about the origin, those only that face `visible_from`."""
    u, w = np.linspace(-0.5, 0.5, 181) * length_m, np.linspace(-0.5, 0.5, 91) * width_m
    sides = {
        (1.0, 0.0): np.column_stack([np.full_like(w, 0.5 * length_m), w]),
        (-1.0, 0.0): np.column_stack([np.full_like(w, -0.5 * length_m), w]),
        (0.0, 1.0): np.column_stack([u, np.full_like(u, 0.5 * width_m)]),
        (0.0, -1.0): np.column_stack([u, np.full_like(u, -0.5 * width_m)]),
    }
    faces = [
        side
        for normal, side in sides.items()
        if visible_from is None or np.dot(normal, visible_from - side.mean(axis=0)) > 0.0
    ]
    return np.concatenate(faces)


@given(
    bearing=st.floats(-math.pi, math.pi),
    distance=st.floats(6.0, 60.0),
    heading=st.floats(-math.pi, math.pi),
)
def test_the_centre_of_a_box_of_the_mean_size_is_found_from_any_side(
    bearing: float, distance: float, heading: float
) -> None:
    sensor = distance * np.array([math.cos(bearing), math.sin(bearing)])
    seen = outline(4.5, 1.8, visible_from=sensor)
    c, s = math.cos(heading), math.sin(heading)
    turn, away = np.array([[c, -s], [s, c]]), np.array([3.0, -7.0])
    centre = to_centre(seen @ turn.T + away, turn @ sensor + away, heading, CAR, SurfaceConfig(tail=0.0))
    np.testing.assert_allclose(centre, away, atol=1e-9)


def test_a_longer_car_is_centred_once_both_ends_are_seen_and_off_by_half_the_excess_before() -> None:
    exact = SurfaceConfig(tail=0.0)
    behind, beside = np.array([-30.0, 0.0]), np.array([0.0, 4.0])
    from_behind = to_centre(outline(4.9, 1.8, visible_from=behind), behind, 0.0, CAR, exact)
    from_beside = to_centre(outline(4.9, 1.8, visible_from=beside), beside, 0.0, CAR, exact)
    np.testing.assert_allclose(from_behind, [-0.2, 0.0], atol=1e-9)
    np.testing.assert_allclose(from_beside, [0.0, 0.0], atol=1e-9)


def test_a_person_stands_a_little_behind_the_points() -> None:
    points = np.array([[10.0, 0.1], [10.0, -0.1]])
    centre = to_centre(points, np.zeros(2), 1.0, PERSON, SurfaceConfig())
    np.testing.assert_allclose(centre, [10.0 + math.pi / 4 * 0.12, 0.0], atol=1e-12)


def test_a_few_stray_points_do_not_move_the_ends() -> None:
    sensor = np.array([-30.0, 0.0])
    seen = np.concatenate([outline(4.5, 1.8, visible_from=sensor), [[-3.5, 0.0]]])
    np.testing.assert_allclose(to_centre(seen, sensor, 0.0, CAR, SurfaceConfig()), [0.0, 0.0], atol=0.05)


@pytest.mark.parametrize("heading_deg", [-60.0, -30.0, 0.0, 21.0, 45.0])
def test_the_heading_of_a_parked_car_is_read_from_two_of_its_sides(heading_deg: float) -> None:
    heading = math.radians(heading_deg)
    seen = outline(4.5, 1.8, visible_from=np.array([-12.0, 8.0]))
    c, s = math.cos(heading), math.sin(heading)
    found = box_heading(seen @ np.array([[c, s], [-s, c]]), 0.0, CAR)
    assert abs(math.remainder(found - heading, math.pi)) < math.radians(2.0)


# -- the shift of a picture -------------------------------------------------------------------------------


def votes(shift: np.ndarray, boxes: int, seed: int, *, clutter: int = 4) -> list[Vote]:
    """Each box: its own cluster off by the shift (and 1 mrad), and clutter anywhere within 5 degrees."""
    r = rng(seed)
    return [
        Vote(
            track_id=track,
            offset_rad=np.concatenate(
                [shift + r.normal(0, 0.001, (1, 2)), r.uniform(-0.09, 0.09, (clutter, 2))]
            ),
            weight=np.concatenate([[0.9], r.uniform(0.0, 0.9, clutter)]),
        )
        for track in range(boxes)
    ]


@given(
    seed=st.integers(0, 10**6), boxes=st.integers(3, 7), x=st.floats(-0.06, 0.06), y=st.floats(-0.06, 0.06)
)
def test_three_boxes_or_more_find_the_shift(seed: int, boxes: int, x: float, y: float) -> None:
    shift = np.array([x, y])
    found = vote_shift(votes(shift, boxes, seed, clutter=1), PixelShiftConfig())
    if np.linalg.norm(shift) > 0.02:
        assert found is not None
    if found is not None:
        np.testing.assert_allclose(found, shift, atol=0.004)


@given(seed=st.integers(0, 10**6), boxes=st.integers(0, 2))
def test_fewer_boxes_shift_nothing(seed: int, boxes: int) -> None:
    assert vote_shift(votes(np.array([0.05, 0.0]), boxes, seed), PixelShiftConfig()) is None


def test_two_boxes_that_agree_do_not_outvote_the_rest() -> None:
    agree = votes(np.array([0.05, 0.0]), 2, 0, clutter=0)
    alone = [
        Vote(track_id=k, offset_rad=np.array([[-0.05, 0.02 * k]]), weight=np.array([0.5])) for k in (3, 5)
    ]
    assert vote_shift([*agree, *alone], PixelShiftConfig()) is None
    third = replace(agree[0], track_id=9)
    assert vote_shift([*agree, *alone, third], PixelShiftConfig()) is not None


def test_three_votes_of_one_track_are_one_box() -> None:
    (vote,) = votes(np.array([0.05, 0.0]), 1, 0)
    assert vote_shift([vote] * 5, PixelShiftConfig()) is None


def test_a_picture_that_fits_is_left_alone() -> None:
    assert vote_shift(votes(np.zeros(2), 5, 1, clutter=0), PixelShiftConfig(gain=1.2)) is None


def test_boxes_without_candidates_have_no_vote() -> None:
    empty = Vote(track_id=9, offset_rad=np.zeros((0, 2)), weight=np.zeros(0))
    assert vote_shift([empty] * 4, PixelShiftConfig()) is None


# -- association ------------------------------------------------------------------------------------------


def history(seed: int, *, tempting: float) -> list[CandidateSet]:
    """Nine scans: the object at 7 m/s with weight 0.5; something random with weight `tempting`."""
    r = rng(seed)
    return [
        CandidateSet(
            stamp_ns=100 * MS * k,
            xy_m=np.concatenate([[[0.7 * k, 3.0]], r.uniform(-20, 20, (2, 2))]),
            weight=np.array([0.5, tempting, tempting]),
        )
        for k in range(9)
    ]


def test_the_candidate_that_moves_steadily_wins_over_better_ones_that_jump() -> None:
    """Now and then what jumps lies on a line by chance: in a few of a thousand histories."""
    found = [associate(history(seed, tempting=1.0), None, AssociationConfig()) for seed in range(400)]
    steady = [best == 0 and support > 0.4 for best, support in found]
    assert np.mean(steady) > 0.98


def test_alone_the_better_candidate_wins_unless_the_prediction_says_otherwise() -> None:
    (newest,) = history(1, tempting=0.9)[:1]
    assert associate([newest], None, AssociationConfig()) == (1, 0.9)
    assert associate([newest], np.array([0.0, 3.0]), AssociationConfig()) == (0, 0.5)


def test_old_sets_are_forgotten() -> None:
    sets = history(2, tempting=0.9)
    late = CandidateSet(
        stamp_ns=sets[-1].stamp_ns + 2_000 * MS,
        xy_m=sets[-1].xy_m + np.array([14.0, 0.0]),
        weight=sets[-1].weight,
    )
    assert associate([*sets, late], None, AssociationConfig())[0] == 1


def test_two_tracks_do_not_share_a_cluster() -> None:
    numbers = [np.array([7, 9]), np.array([7, 3])]
    score = [np.array([-1.0, -2.0]), np.array([-1.5, -9.0])]
    lost = contested(numbers, score, -16.0)
    assert [each.tolist() for each in lost] == [[True, False], [False, False]]


def test_tracks_without_candidates_contest_nothing() -> None:
    none = np.zeros(0, dtype=np.int64)
    lost = contested([none, np.array([4])], [np.zeros(0), np.array([-3.0])], -16.0)
    assert [each.tolist() for each in lost] == [[], [False]]


# -- the filter -------------------------------------------------------------------------------------------


def noisy_path(seed: int, count: int = 12) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r = rng(seed)
    stamp_ns = np.cumsum(r.integers(40, 200, count)) * MS
    truth = np.column_stack([3.0 + 5.0 * stamp_ns * 1e-9, 1.0 - stamp_ns * 1e-9])
    sd_m = r.uniform(0.05, 0.5, count)
    return stamp_ns, truth + r.normal(size=(count, 2)) * sd_m[:, None], sd_m


@given(seed=st.integers(0, 10**6), gap=st.booleans())
def test_forward_and_backward_give_the_batch_least_squares_solution(seed: int, gap: bool) -> None:
    config = KalmanConfig()
    stamp_ns, position_m, sd_m = noisy_path(seed)
    if gap:
        sd_m[4:6] = np.inf
    states, covariances = smooth(stamp_ns, position_m, sd_m, config)
    count = len(stamp_ns)
    information, vector = np.zeros((2 * count, 2 * count)), np.zeros((2 * count, 2))
    information[1, 1] += config.speed_sd_mps**-2  # the prior: nothing of the place, a wide velocity about 0
    for k in range(count):
        if np.isfinite(sd_m[k]):
            information[2 * k, 2 * k] += sd_m[k] ** -2
            vector[2 * k] += position_m[k] * sd_m[k] ** -2
        if k:
            dt = (stamp_ns[k] - stamp_ns[k - 1]) * 1e-9
            step = np.hstack([-np.array([[1.0, dt], [0.0, 1.0]]), np.eye(2)])
            noise = config.acceleration * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
            rows = slice(2 * k - 2, 2 * k + 2)
            information[rows, rows] += step.T @ np.linalg.solve(noise, step)
    batch = np.linalg.solve(information, vector).reshape(count, 2, 2)
    np.testing.assert_allclose(states, batch, atol=1e-6)
    spread = np.linalg.inv(information)
    for k in range(count):
        block = slice(2 * k, 2 * k + 2)
        np.testing.assert_allclose(covariances[k], spread[block, block], atol=1e-6)


@given(seed=st.integers(0, 10**6))
def test_a_path_filtered_backward_is_the_path_filtered_forward_in_mirrored_time(seed: int) -> None:
    config = KalmanConfig()
    stamp_ns, position_m, sd_m = noisy_path(seed)
    there = start(int(stamp_ns[-1]), position_m[-1], sd_m[-1], config)
    back = start(int(-stamp_ns[-1]), position_m[-1], sd_m[-1], config)
    for k in range(len(stamp_ns) - 2, -1, -1):
        there = correct(predict(there, int(stamp_ns[k]), config), position_m[k], sd_m[k])
        back = correct(predict(back, int(-stamp_ns[k]), config), position_m[k], sd_m[k])
    np.testing.assert_allclose(there.position_m, back.position_m, atol=1e-9)
    np.testing.assert_allclose(there.velocity_mps, -back.velocity_mps, atol=1e-9)


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), share=st.floats(0.0, 0.3))
def test_gross_outliers_even_at_the_start_do_not_bend_the_robust_path(seed: int, share: float) -> None:
    r = rng(seed)
    stamp_ns = np.arange(40) * 100 * MS
    truth = np.column_stack([3.0 + 0.7 * np.arange(40), np.full(40, -2.0)])
    wrong = r.random(40) < share
    wrong[:2] = share > 0.05
    assume(np.convolve(wrong, np.ones(13), mode="valid").max() <= 5)  # of any window less than half
    position_m = truth + r.normal(0, 0.03, (40, 2)) + wrong[:, None] * r.uniform(5, 20, (40, 1))
    states, factor = smooth_robustly(stamp_ns, position_m, np.full(40, 0.05), KalmanConfig())
    off_m = np.linalg.norm(states[:, 0] - truth, axis=1)
    assert off_m[~wrong].max() < 0.3 and off_m.max() < 2.0
    assert (factor[wrong] > 2.0).all()


def test_the_line_through_the_neighbours_is_exact_on_a_line_with_a_third_of_them_wrong() -> None:
    stamp_ns = np.arange(15) * 100 * MS
    truth = np.column_stack([2.0 * np.arange(15), 5.0 - np.arange(15)])
    position_m = truth.copy()
    position_m[[0, 1, 5, 11]] += 30.0
    np.testing.assert_allclose(local_lines(stamp_ns, position_m, 6), truth, atol=1e-9)
    np.testing.assert_array_equal(local_lines(stamp_ns[:2], position_m[:2], 6), position_m[:2])


# -- shake ------------------------------------------------------------------------------------------------


def felt(pitch: float, yaw: float, turn: float = 0.0, hz: float = 4.0) -> tuple[Odometry, np.ndarray]:
    """Five seconds of gyro: amplitudes [rad] of pitch and yaw, besides a steady turn [rad/s]."""
    odometry, w = Odometry(), 2 * math.pi * hz
    for k in range(501):
        t = 0.01 * k
        odometry.add(
            motion(
                10 * MS * k,
                10.0,
                turn + yaw * w * math.cos(w * t),
                roll_pitch=(0.0, pitch * w * math.cos(w * t + 1.0)),
            )
        )
    return odometry, np.arange(500 * MS, 4_500 * MS, 73 * MS)


def test_yaw_that_shakes_less_than_pitch_is_shake() -> None:
    odometry, at_ns = felt(0.02, 0.005, turn=0.2)
    found = yaw_shake_rad(odometry, at_ns, ShakeConfig())
    expected = 0.005 * np.sin(2 * math.pi * 4.0 * at_ns * 1e-9)
    assert np.abs(found - expected).max() < 0.001


@pytest.mark.parametrize(("pitch", "yaw"), [(0.0, 0.0), (0.0, 0.02), (0.01, 0.2)])
def test_yaw_that_shakes_more_than_pitch_is_the_way(pitch: float, yaw: float) -> None:
    odometry, at_ns = felt(pitch, yaw, turn=0.2)
    assert not yaw_shake_rad(odometry, at_ns, ShakeConfig()).any()


def test_without_a_gyro_nothing_shakes() -> None:
    assert not yaw_shake_rad(Odometry(), np.array([0, 5]), ShakeConfig()).any()


# -- confidence -------------------------------------------------------------------------------------------


@given(
    score=st.floats(-40, 0),
    support=st.floats(0, 2),
    points=st.integers(0, 5000),
    sightings=st.integers(1, 100),
)
def test_confidence_is_a_probability_that_rises_with_all_it_is_told(
    score: float, support: float, points: int, sightings: int
) -> None:
    config = ConfidenceConfig()
    here = confidence(score, support, points, sightings, config)
    assert 0.0 <= here <= 1.0
    assert here <= confidence(score + 1.0, support, points, sightings, config)
    assert here <= confidence(score, support + 0.5, points, sightings, config)
    assert here <= confidence(score, support, points + 1, sightings, config)
    assert here <= confidence(score, support, points, sightings + 1, config)


# -- boxes at the border of the image ---------------------------------------------------------------------


def at_the_border(u_px: float, box_px: tuple[float, float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Candidates' numbers and scores of a box for a person 3 m ahead whose middle the LiDAR puts at u_px."""
    config = MatchingConfig()
    right = (u_px - PINHOLE.cx_px) / PINHOLE.fx_px * 3.0
    r = rng(0)
    xyz_m = np.column_stack(
        [3.0 + r.uniform(-0.1, 0.1, 200), -right + r.uniform(-0.25, 0.25, 200), r.uniform(0.2, 1.7, 200)]
    )
    clusters = cluster_from_above(xyz_m, xyz_m[:, 2], 0.25, FootprintConfig())
    optical = Transform(
        rotation=np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
        translation_m=np.array([0.0, 0.0, 1.0]),
    )
    view = view_clusters(clusters, xyz_m, optical.inverse(), PINHOLE, [box_px], 5.0, config.candidates)
    (fit,) = fit_boxes(view, clusters, [box_px], [PERSON], np.zeros((1, 3)), None, config.candidates)
    box = MatchedBox(
        camera="front",
        detection=Detection(track_id=1, category="person", box_px=box_px, confidence=1.0),
        size=PERSON,
        fit=fit,
        sd_rad=(config.sd_rad, config.sd_rad),
        cut=bool(cut(np.array(box_px).reshape(1, 4, 1), PINHOLE, config.candidates)[0, 0]),
    )
    return ranked_candidates([box], {"front": np.zeros(2)}, config)


def test_who_stands_beside_the_image_in_the_sweep_may_be_who_its_border_cuts_in_the_image() -> None:
    _, score = at_the_border(-60.0, (0.0, 150.0, 40.0, 450.0))
    assert len(score) == 1 and score[0] > MatchingConfig().least_score


def test_who_stands_beside_the_image_is_not_who_is_in_its_middle() -> None:
    assert len(at_the_border(-60.0, (440.0, 150.0, 520.0, 450.0))[0]) == 0


def test_a_wheel_at_the_border_may_be_all_that_shows_of_a_person() -> None:
    _, score = at_the_border(930.0, (900.0, 380.0, 960.0, 600.0))
    assert len(score) == 1 and score[0] > MatchingConfig().least_score
    assert len(at_the_border(900.0, (860.0, 380.0, 930.0, 600.0))[0]) == 0  # of one who is wholly in view
