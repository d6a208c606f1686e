"""What a pipeline may answer."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest

from fusion.messages import FusionOutput, LidarScan, LocalizedObject, Trajectory
from simbench.score.contract import ContractError, check_output, check_trajectories

MS = 1_000_000


@pytest.fixture(scope="module")
def scan():
    return LidarScan(
        sensor="lidar",
        seq=3,
        stamp_ns=300 * MS,
        arrival_ns=400 * MS,
        xyz_m=np.ones((10, 3), dtype=np.float32),
        intensity=np.ones(10, dtype=np.float32),
        offset_ns=np.arange(10, dtype=np.int32) * 9 * MS,
        ring=np.zeros(10, dtype=np.int16),
    )


GOOD = LocalizedObject(
    track_id=7,
    category="rider",
    sensor="front",
    stamp_ns=350 * MS,
    points=np.array([1, 2, 9]),
    position_ego_m=np.array([10.0, -3.0, 0.8]),
    distance_m=10.4,
    azimuth_rad=-0.3,
    confidence=0.5,
)


def broken(good, **changes):
    """A message that no type checker saw: the tests' own refuses some of these before the contract can."""
    bad = copy.copy(good)
    for name, value in changes.items():
        object.__setattr__(bad, name, value)
    return bad


def output(*objects, **changes):
    values = dict(scan_sensor="lidar", scan_seq=3, objects=objects)
    return FusionOutput(**{**values, **changes})


def test_a_good_output_passes(scan):
    check_output(scan, output(GOOD))
    check_output(scan, output())
    check_output(scan, output(replace(GOOD, points=np.array([], dtype=np.int64))))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stamp_ns": 300 * MS - 1}, "outside its sweep"),
        ({"stamp_ns": 381 * MS + 1}, "outside its sweep"),
        ({"stamp_ns": 350.5 * MS}, "stamp_ns must be an integer"),
        ({"track_id": "seven"}, "track_id must be an integer"),
        ({"points": np.array([0, 10])}, "indices in 0..9"),
        ({"points": np.array([-1])}, "indices in 0..9"),
        ({"points": np.array([2, 5, 2])}, "twice"),
        ({"points": np.array([[1, 2]])}, "shape"),
        ({"position_ego_m": np.array([1.0, 2.0])}, "shape"),
        ({"position_ego_m": np.array([[1.0, 2.0, 3.0]])}, "shape"),
        ({"position_ego_m": np.array([1.0, np.nan, 3.0])}, "not finite"),
        ({"distance_m": float("inf")}, "not finite"),
        ({"azimuth_rad": float("nan")}, "not finite"),
        ({"confidence": float("nan")}, "not finite"),
    ],
)
def test_a_broken_object_is_refused_in_one_sentence(scan, change, words):
    with pytest.raises(ContractError, match=words) as caught:
        check_output(scan, output(broken(GOOD, **change)))
    text = str(caught.value)
    assert text.endswith(".") and "\n" not in text


@pytest.mark.parametrize("stamp", [300 * MS, 381 * MS])
def test_both_ends_of_the_sweep_belong_to_it(scan, stamp):
    check_output(scan, output(replace(GOOD, stamp_ns=stamp)))


def test_with_a_period_the_sweep_lasts_that_long_even_if_nothing_returned(scan):
    check_output(scan, output(replace(GOOD, stamp_ns=400 * MS)), period_ns=100 * MS)
    with pytest.raises(ContractError, match="outside"):
        check_output(scan, output(replace(GOOD, stamp_ns=400 * MS + 1)), period_ns=100 * MS)


def test_a_second_output_for_a_scan_is_refused(scan):
    with pytest.raises(ContractError, match="second output"):
        check_output(scan, output(GOOD), answered={("lidar", 3)})
    check_output(scan, output(GOOD), answered={("lidar", 2), ("other", 3)})


def test_an_output_for_another_scan_is_refused(scan):
    with pytest.raises(ContractError, match="names scan"):
        check_output(scan, output(GOOD, scan_seq=4))


def test_one_camera_may_name_a_track_once_and_two_cameras_may_share_it(scan):
    check_output(scan, output(GOOD, replace(GOOD, sensor="left")))
    with pytest.raises(ContractError, match="only once"):
        check_output(scan, output(GOOD, replace(GOOD, confidence=0.1)))


def test_something_that_is_no_output_is_refused(scan):
    with pytest.raises(ContractError, match="must return a FusionOutput"):
        check_output(scan, [GOOD])
    with pytest.raises(ContractError, match="must be LocalizedObject"):
        check_output(scan, broken(output(), objects=({"track_id": 7},)))


TRACK = Trajectory(
    track_id=7,
    stamp_ns=np.array([1, 2, 2]),
    position_ego_m=np.zeros((3, 3)),
    inlier=np.ones(3, dtype=bool),
)


def test_a_good_trajectory_passes():
    check_trajectories([TRACK, replace(TRACK, track_id=8)])


@pytest.mark.parametrize(
    ("tracks", "words"),
    [
        ([TRACK, TRACK], "only one trajectory"),
        ([replace(TRACK, stamp_ns=np.array([1, 3, 2]))], "ascend"),
        ([replace(TRACK, position_ego_m=np.full((3, 3), np.nan))], "not finite"),
        ([broken(TRACK, position_ego_m=np.zeros((2, 3)))], "shapes"),
        ([broken(TRACK, inlier=np.ones(2, dtype=bool))], "shapes"),
        (["track"], "must return Trajectory"),
    ],
)
def test_a_broken_trajectory_is_refused(tracks, words):
    with pytest.raises(ContractError, match=words):
        check_trajectories(tracks)
