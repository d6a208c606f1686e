"""A story told otherwise says the same: by the geometry of camera and frame, not by the code that tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from fusion.check import digest
from fusion.geometry import Transform, rotation_rpy
from fusion.messages import Calibration, CameraImage, Detection, Detections, EgoMotion, LidarScan
from simbench.checks.finding import Story
from simbench.checks.mirror import mirrored
from simbench.checks.permute import another_order, permuted
from simbench.checks.retold import HOUR_NS, later, turned
from simbench.checks.unseen import BLIND, first_other, points_shown, renumbered, with_blind_camera
from tests.fusion.make import lidar_scan

OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
angle = st.floats(-1.0, 1.0)


@st.composite
def stories(draw: st.DrawFn) -> Story:
    """A LiDAR, a distorting camera and an IMU, each in any pose; one message of each kind."""
    mounts = {
        name: Transform(
            rotation=rotation_rpy(draw(angle), draw(angle), draw(angle)) @ base,
            translation_m=np.array([draw(angle), draw(angle), draw(angle)]),
        )
        for name, base in (("lidar", np.eye(3)), ("cam", OPTICAL), ("imu", np.eye(3)))
    }
    lens = PinholeCamera(
        fx_px=300.0, fy_px=310.0, cx_px=draw(st.floats(100, 200)), cy_px=90.0, width_px=320, height_px=200,
        distortion=(0.05, -0.02, draw(st.floats(-0.01, 0.01)), draw(st.floats(-0.01, 0.01)), 0.001),
    )  # fmt: skip
    seed = draw(st.integers(0, 10**6))
    rng = np.random.Generator(np.random.PCG64(seed))
    at = {"seq": 0, "stamp_ns": 5, "arrival_ns": 9}
    boxes = (Detection(track_id=7, category="car", box_px=(10.0, 20.0, 110.0, 60.0), confidence=0.5),)
    return Story(
        calibration=Calibration(T_ego_sensor=mounts, cameras={"cam": lens}),
        messages=(
            lidar_scan(rng.uniform(-20.0, 20.0, (60, 3)), offset_ns=np.arange(60) // 6 * 100),
            Detections(sensor="cam", boxes=boxes, **at),
            CameraImage(sensor="cam", rgb=rng.integers(0, 255, (200, 320, 3)).astype(np.uint8), **at),
            EgoMotion(
                sensor="imu", velocity_mps=rng.normal(size=3), rate_radps=rng.normal(size=3),
                specific_force_mps2=rng.normal(size=3), **at,
            ),
        ),
    )  # fmt: skip


def places_ego_m(story: Story) -> np.ndarray:
    scan = story.messages[0]
    assert isinstance(scan, LidarScan)
    return story.calibration.T_ego_sensor["lidar"].apply(scan.xyz_m.astype(np.float64))


def pixels(story: Story) -> np.ndarray:
    told = story.calibration
    return told.cameras["cam"].project(told.T_ego_sensor["cam"].inverse().apply(places_ego_m(story)))


@given(stories())
def test_in_the_mirror_left_is_right_in_the_ego_frame_and_in_the_picture(story: Story) -> None:
    image = mirrored(story)
    np.testing.assert_allclose(places_ego_m(image), places_ego_m(story) * [1, -1, 1], atol=1e-12)
    u, v = pixels(story).T
    np.testing.assert_allclose(pixels(image), np.stack([320 - u, v], axis=1), rtol=1e-9, atol=1e-7)


@given(stories())
def test_the_mirror_image_of_the_mirror_image_is_the_story(story: Story) -> None:
    twice = mirrored(mirrored(story))
    assert digest(twice.messages[0]) == digest(story.messages[0])
    assert digest(twice.messages[2:]) == digest(story.messages[2:])
    np.testing.assert_allclose(pixels(twice), pixels(story), rtol=1e-9, atol=1e-7)


def test_a_box_a_picture_and_a_left_turn_in_the_mirror_by_hand() -> None:
    lens = PinholeCamera(fx_px=1.0, fy_px=1.0, cx_px=1.0, cy_px=1.0, width_px=4, height_px=1)
    pose = Transform(rotation=OPTICAL, translation_m=np.array([0.0, 0.5, 1.0]))
    at = {"seq": 0, "stamp_ns": 0, "arrival_ns": 0}
    story = Story(
        calibration=Calibration(T_ego_sensor={"cam": pose}, cameras={"cam": lens}),
        messages=(
            Detections(
                sensor="cam",
                boxes=(Detection(track_id=1, category="car", box_px=(0.0, 0.0, 1.0, 1.0), confidence=1.0),),
                **at,
            ),
            CameraImage(sensor="cam", rgb=np.arange(12, dtype=np.uint8).reshape(1, 4, 3), **at),
            EgoMotion(
                sensor="imu", velocity_mps=np.array([5.0, 1.0, 0.0]), rate_radps=np.array([0.1, 0.2, 0.3]),
                specific_force_mps2=np.array([0.0, 2.0, 9.8]), **at,
            ),
        ),
    )  # fmt: skip
    image = mirrored(story)
    seen, picture, motion = image.messages
    assert isinstance(seen, Detections) and isinstance(picture, CameraImage) and isinstance(motion, EgoMotion)
    assert seen.boxes[0].box_px == (3.0, 0.0, 4.0, 1.0)
    assert picture.rgb[0, 0].tolist() == [9, 10, 11]
    assert motion.velocity_mps.tolist() == [5.0, -1.0, 0.0]
    assert motion.rate_radps.tolist() == [-0.1, 0.2, -0.3]  # nodding is the same, rolling and turning are not
    assert motion.specific_force_mps2.tolist() == [0.0, -2.0, 9.8]
    assert image.calibration.T_ego_sensor["cam"].translation_m.tolist() == [0.0, -0.5, 1.0]
    assert image.calibration.cameras["cam"].cx_px == 3.0


@given(stories())
def test_a_turned_lidar_frame_moves_no_point_in_the_ego_frame(story: Story) -> None:
    np.testing.assert_allclose(places_ego_m(turned(story)), places_ego_m(story), atol=1e-12)
    before, after = story.messages[0], turned(story).messages[0]
    assert isinstance(before, LidarScan) and isinstance(after, LidarScan)
    assert np.array_equal(after.xyz_m, np.stack([-before.xyz_m[:, 1], *before.xyz_m[:, [0, 2]].T], axis=1))
    assert digest(turned(story).messages[1:]) == digest(story.messages[1:])


@given(stories())
def test_only_points_of_one_instant_change_places(story: Story) -> None:
    scan = story.messages[0]
    assert isinstance(scan, LidarScan)
    order = another_order(scan)
    assert not np.array_equal(order, np.arange(60))
    assert np.array_equal(np.sort(order), np.arange(60))
    after = permuted(scan, order)
    assert np.array_equal(after.offset_ns, scan.offset_ns)  # firing order is kept
    assert np.array_equal(after.xyz_m, scan.xyz_m[order])


def test_an_hour_later_all_stamps_and_arrivals_are_an_hour_on() -> None:
    scan = lidar_scan([[1.0, 2.0, 3.0]], stamp_ns=17)
    (moved,) = later(Story(calibration=Calibration(T_ego_sensor={}, cameras={}), messages=(scan,))).messages
    assert (moved.stamp_ns, moved.arrival_ns) == (17 + HOUR_NS, scan.arrival_ns + HOUR_NS)
    assert digest(replace(moved, stamp_ns=scan.stamp_ns, arrival_ns=scan.arrival_ns)) == digest(scan)


@pytest.mark.parametrize(
    ("place_m", "shown"),
    [((0.0, 0.0, 5.0), 1), ((0.9, 0.0, 5.0), 1), ((1.1, 0.0, 5.0), 0), ((0.0, 0.0, -5.0), 0)],
    ids=["overhead", "just within 100 of 500 px", "just outside", "under the ground"],
)
def test_the_blind_camera_looks_straight_up(place_m: tuple[float, ...], shown: int) -> None:
    told = Calibration(
        T_ego_sensor={"lidar": Transform(rotation=np.eye(3), translation_m=np.zeros(3))}, cameras={}
    )
    assert (
        points_shown(with_blind_camera(Story(calibration=told, messages=(lidar_scan([place_m]),)))) == shown
    )


@given(stories())
def test_the_blind_camera_speaks_right_before_the_first_camera_of_a_track_of_its_own(story: Story) -> None:
    messages = with_blind_camera(story).messages
    blind, seen = messages[1], messages[2]
    assert isinstance(blind, Detections) and isinstance(seen, Detections)
    assert (blind.sensor, seen.sensor) == (BLIND, "cam")
    assert (blind.stamp_ns, blind.arrival_ns) == (seen.stamp_ns, seen.arrival_ns)
    assert blind.boxes[0].track_id not in {box.track_id for box in seen.boxes}


def test_track_ids_are_numbered_by_first_appearance_and_nothing_else_is_renamed() -> None:
    def seen(*tracks: int) -> Detections:
        boxes = tuple(
            Detection(track_id=i, category="car", box_px=(0.0, 0.0, 1.0, 1.0), confidence=0.5) for i in tracks
        )
        return Detections(sensor="cam", seq=0, stamp_ns=0, arrival_ns=0, boxes=boxes)

    a, b = (seen(70, 5), seen(5, 9)), (seen(1, 8), seen(8, 2))
    assert first_other(renumbered(a), renumbered(b)) is None
    assert first_other(renumbered(a), renumbered((seen(1, 8), seen(1, 2)))) == "Detections 0 of cam"
    assert first_other(renumbered(a), renumbered(a)[:1]) == "2 and 1 of them"
