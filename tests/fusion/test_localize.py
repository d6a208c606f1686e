"""Step 5: the representative point, its distance, angle and time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fusion.geometry import Transform, rotation_rpy
from fusion.localize import LocalizeConfig, Representative, localize, median_point, planar_distance_m
from fusion.messages import Detection, LocalizedObject
from tests.fusion.make import lidar_scan

# Half-metre steps make equal distances common.
clouds = arrays(
    np.float32, st.tuples(st.integers(1, 30), st.just(3)), elements=st.integers(-20, 20).map(lambda i: i / 2)
)


def located(
    xyz: object, representative: Representative = "median", T_ego_lidar: Transform | None = None
) -> LocalizedObject:
    scan = lidar_scan(xyz, stamp_ns=1_000)
    return localize(
        scan,
        np.arange(len(scan.xyz_m)),
        detection=Detection(track_id=7, category="rider", box_px=(0.0, 0.0, 1.0, 1.0), confidence=1.0),
        camera="front",
        T_ego_lidar=Transform.identity() if T_ego_lidar is None else T_ego_lidar,
        confidence=0.5,
        config=LocalizeConfig(representative=representative),
    )


@given(clouds)
def test_the_median_point_is_a_real_point_with_the_middle_rank_of_distance(xyz: np.ndarray) -> None:
    distance = planar_distance_m(xyz)
    chosen = distance[median_point(xyz)]
    assert chosen == np.sort(distance)[(len(xyz) - 1) // 2]


@given(clouds, st.integers(0, 1000))
def test_the_order_of_the_points_does_not_move_the_object(xyz: np.ndarray, seed: int) -> None:
    shuffled = np.random.Generator(np.random.PCG64(seed)).permutation(xyz)
    assert np.array_equal(xyz[median_point(xyz)], shuffled[median_point(shuffled)])


def test_distance_leaves_out_height_and_azimuth_counts_from_x_to_y() -> None:
    found = located([[3.0, 4.0, 12.0]])
    assert found.distance_m == pytest.approx(5.0)
    assert found.azimuth_rad == pytest.approx(np.arctan2(4.0, 3.0))


def test_the_median_ignores_a_minority_of_background() -> None:
    found = located([[5.0, 0, 0], [5.1, 0, 0], [5.2, 0, 0], [30.0, 0, 0], [31.0, 0, 0]])
    assert found.position_ego_m[0] == pytest.approx(5.2)
    assert found.stamp_ns == 1_020


def test_of_two_middle_points_the_nearer_represents() -> None:
    assert located([[8.0, 0, 0], [6.0, 0, 0]]).distance_m == pytest.approx(6.0)


def test_the_mean_averages_position_and_time() -> None:
    found = located([[4.0, 0, 0], [6.0, 2.0, 1.0], [8.0, 1.0, 2.0]], "mean")
    np.testing.assert_allclose(found.position_ego_m, [6.0, 1.0, 1.0])
    assert found.stamp_ns == 1_010
    assert found.distance_m == pytest.approx(np.hypot(6.0, 1.0))


def test_the_position_is_given_in_the_ego_frame_but_distance_and_angle_from_the_lidar() -> None:
    T = Transform(rotation=rotation_rpy(0, 0, np.pi / 2), translation_m=np.array([1.0, 0.0, 1.8]))
    found = located([[2.0, 0.0, -1.0]], T_ego_lidar=T)
    np.testing.assert_allclose(found.position_ego_m, [1.0, 2.0, 0.8], atol=1e-12)
    assert found.distance_m == pytest.approx(2.0) and found.azimuth_rad == pytest.approx(0.0)


def test_an_object_without_points_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one point"):
        located(np.zeros((0, 3)))
