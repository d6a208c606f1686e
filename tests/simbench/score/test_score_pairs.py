"""Pairing of scans with images, and which pairs are eligible."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.localize import median_point as fusion_median_point
from fusion.messages import Detections
from simbench.score.frames import frames_of, nearest
from simbench.score.pairs import eligible_pairs, held_fix, median_point, planar_range_m
from simbench.truth import GnssReference

MS = 1_000_000


def test_of_two_images_equally_near_the_earlier_is_paired():
    assert nearest(np.array([60, 40, 160]), 50, 50) == 1
    assert nearest(np.array([40, 60, 160]), 50, 50) == 0


def test_an_image_exactly_half_a_period_away_is_paired_and_a_nanosecond_more_is_not():
    assert nearest(np.array([50]), 0, 50.0) == 0
    assert nearest(np.array([51]), 0, 50.0) is None
    assert nearest(np.array([51]), 0, 50.5) is None


def test_without_images_nothing_is_paired():
    assert nearest(np.array([], dtype=np.int64), 0, 50) is None


@given(st.lists(st.integers(-100, 100), min_size=1), st.integers(-100, 100))
def test_no_other_image_is_nearer_than_the_paired_one(stamps, at):
    chosen = nearest(np.array(stamps), at, 1000)
    gaps = [abs(s - at) for s in stamps]
    assert gaps[chosen] == min(gaps)
    assert stamps[chosen] == min(s for s, g in zip(stamps, gaps, strict=True) if g == min(gaps))


def test_pairing_reads_the_claimed_stamp_not_the_capture_time(kit):
    recording = kit.World(frames=3).record()
    moved = tuple(
        replace(m, stamp_ns=m.stamp_ns + 80 * MS) if isinstance(m, Detections) else m
        for m in recording.messages
    )
    frames = frames_of(replace(recording, messages=moved))
    # Stamps 90, 190, 290 ms: the scan at 100 ms takes 90 ms (image 0), that at 0 has none within 50 ms.
    assert [f.views["front"].truth.seq if f.views else None for f in frames] == [None, 0, 1]


def test_a_scan_delivered_twice_is_one_frame(recording):
    twice = replace(recording, messages=recording.messages + recording.messages[:4])
    assert len(frames_of(twice)) == len(frames_of(recording))


def test_a_message_without_truth_is_a_broken_recording(recording):
    broken = replace(recording, truth=replace(recording.truth, scans=recording.truth.scans[1:]))
    with pytest.raises(ValueError, match="has no truth"):
        frames_of(broken)


def test_every_frame_is_eligible_when_the_target_is_in_plain_view(recording):
    pairs = eligible_pairs(recording, frames_of(recording))
    assert [(p.frame, p.camera) for p in pairs] == [(k, "front") for k in range(20)]
    assert all(len(p.points) == 30 for p in pairs)


@pytest.mark.parametrize(("fraction", "count"), [(0.25, 20), (0.2499, 0)])
def test_a_quarter_of_the_target_must_be_visible(kit, fraction, count):
    recording = kit.World(visible_fraction=fraction).record()
    assert len(eligible_pairs(recording, frames_of(recording))) == count


@pytest.mark.parametrize(("kept", "count"), [(5, 1), (4, 0)])
def test_five_points_of_the_target_make_a_pair_and_four_do_not(kit, kept, count):
    recording = kit.World(frames=1).record()
    labels = np.full(65, -1, dtype=np.int32)
    labels[15 : 15 + kept] = 0
    scan = replace(recording.truth.scans[0], object_id=labels)
    recording = replace(recording, truth=replace(recording.truth, scans=(scan,)))
    assert len(eligible_pairs(recording, frames_of(recording))) == count


def test_a_missed_detection_stays_eligible(kit):
    recording = kit.World(missed=frozenset(range(20))).record()
    assert len(eligible_pairs(recording, frames_of(recording))) == 20


def test_neither_calibration_error_nor_range_noise_nor_shake_changes_eligibility(kit):
    plain = kit.World(poses=kit.Poses(shake_rad=0.0)).record()
    bad = kit.World(poses=kit.Poses(shake_rad=0.05), noise_m=0.3, told_yaw_rad=0.3).record()
    for a, b in zip(
        eligible_pairs(plain, frames_of(plain)), eligible_pairs(bad, frames_of(bad)), strict=True
    ):
        assert np.array_equal(a.points, b.points)


def test_a_point_is_eligible_where_its_spot_on_the_target_is_at_the_capture(kit):
    """A target that crosses at 30 m/s is hit 40 ms after the picture was taken.

    The LiDAR hits it well inside the field of view; at the capture, 1.2 m to the right, the image's edge cut
    it. Checked by OpenCV, point by point.
    """
    recording = kit.World(frames=1, poses=kit.Poses(start_m=(8.0, -5.95), velocity_mps=(0.0, 30.0))).record()
    frame = frames_of(recording)[0]
    (pair,) = eligible_pairs(recording, frames_of(recording))
    truth, view = recording.truth, frame.views["front"].truth
    expected = []
    for i in np.flatnonzero(frame.truth.object_id == 0):
        fire = np.array([frame.truth.fire_ns[i]])
        direction = frame.scan.xyz_m[i].astype(float)
        x = direction / np.linalg.norm(direction) * frame.truth.true_range_m[i]
        rotation, position = truth.poses.sensor("lidar", fire)
        world = rotation[0] @ x + position[0]
        world = world + np.array(
            truth.poses.object_centre(0, np.array([view.capture_ns]))[1][0]
            - truth.poses.object_centre(0, fire)[1][0]
        )
        T = view.T_world_camera.inverse()
        camera = truth.calibration.cameras["front"]
        uv = cv2.projectPoints(
            world[None], cv2.Rodrigues(T.rotation)[0], T.translation_m, camera.matrix, np.zeros(5)
        )[0].ravel()
        if 0 <= uv[0] <= 960 and 0 <= uv[1] <= 600:
            expected.append(i)
    assert 5 <= len(expected) < 30
    assert pair.points.tolist() == expected


def test_surface_distance_is_the_median_planar_range_and_the_centre_lies_behind_it(recording):
    pair = eligible_pairs(recording, frames_of(recording))[0]
    assert pair.surface_distance_m == pytest.approx(np.median(np.hypot(*pair.true_xyz_lidar_m[:, :2].T)))
    assert pair.instant_ns == pytest.approx(50 * MS, abs=MS)
    assert pair.centre_distance_m == pytest.approx(np.hypot(20 - 5.2 * 0.05, 3.0), abs=0.01)
    assert 0.7 < pair.centre_distance_m - pair.surface_distance_m < 0.8


@given(st.lists(st.tuples(*[st.integers(-5, 5)] * 3), min_size=1, max_size=9))
def test_the_representative_is_the_one_that_fusion_takes_and_point_order_decides_nothing(points):
    xyz = np.array(points, dtype=np.float32)
    assert median_point(xyz) == fusion_median_point(xyz)
    assert np.array_equal(xyz[median_point(xyz)], xyz[::-1][median_point(xyz[::-1])])
    ranks = np.sort(planar_range_m(xyz))
    assert planar_range_m(xyz)[median_point(xyz)] == ranks[(len(ranks) - 1) // 2]


def test_a_fix_holds_from_when_it_is_available_until_the_next_one_is():
    zeros = np.zeros((2, 3))
    reference = GnssReference(
        fix_ns=np.array([0, 200]),
        available_ns=np.array([20, 220]),
        position_ego_m=zeros,
        centre_ego_m=zeros,
        lever_m=zeros,
        heading_m=zeros,
        noise_m=zeros,
    )
    assert held_fix(reference, np.array([19, 20, 219, 220, 999])).tolist() == [-1, 0, 0, 1, 1]
