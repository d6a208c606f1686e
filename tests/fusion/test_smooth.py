"""Step 6: polynomials in time, with outliers thrown out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fusion.messages import Trajectory
from fusion.smooth import SmootherConfig, find_inliers, smooth_track

START_NS = 1_700_000_000_000_000_000
NONE = np.zeros(0, dtype=np.int64)


def path(times_s: np.ndarray, cubic: float = 0.02) -> np.ndarray:
    t = times_s - 2.5
    return np.column_stack([10 - 5 * t + 0.2 * t**2 + cubic * t**3, 3 + 0.1 * t - 0.05 * t**2, 0.9 + 0 * t])


def stamps(times_s: np.ndarray) -> np.ndarray:
    return START_NS + np.round(times_s * 1e9).astype(np.int64)


def smoothed(
    times_s: np.ndarray,
    position_m: np.ndarray,
    config: SmootherConfig | None = None,
    missing_s: np.ndarray | None = None,
) -> Trajectory:
    return smooth_track(
        track_id=3,
        stamp_ns=stamps(times_s),
        position_ego_m=position_m,
        missing_ns=NONE if missing_s is None else stamps(missing_s),
        config=SmootherConfig() if config is None else config,
    )


@settings(max_examples=40)
@given(
    coefficients=arrays(np.float64, (4, 3), elements=st.floats(-5.0, 5.0)),
    bend=st.floats(-0.8, 0.8),
    count=st.integers(15, 80),
)
def test_a_cubic_comes_back_exactly(coefficients: np.ndarray, bend: float, count: int) -> None:
    """The third power is kept below what phase one tolerates: 0.5 m away from the best parabola.

    From 15 samples on: with a handful, a parabola through three of them can be that far from the others.
    """
    unit = np.linspace(-1.0, 1.0, count)
    coefficients[3] = bend
    position = np.vander(unit, 4, increasing=True) @ coefficients
    track = smoothed(2.5 * (unit + 1.0), position)
    assert len(track.stamp_ns) == count and track.inlier.all()
    np.testing.assert_allclose(track.position_ego_m, position, atol=1e-6)


def test_a_cubic_too_bent_for_a_parabola_still_comes_back_exactly_between_its_inliers() -> None:
    times = np.linspace(0, 5, 51)
    position = path(times, cubic=0.5)
    track = smoothed(times, position)
    kept = np.isin(stamps(times), track.stamp_ns)
    np.testing.assert_allclose(track.position_ego_m, position[kept], atol=1e-6)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_thirty_per_cent_of_gross_outliers_are_ignored(seed: int) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    times = np.linspace(0, 5, 50)
    position = path(times) + rng.normal(0.0, 0.03, (50, 3))
    wrong = rng.choice(np.arange(1, 49), 15, replace=False)
    position[wrong, 0] += rng.choice([-1, 1], 15) * rng.uniform(4.0, 15.0, 15)
    track = smoothed(times, position)
    assert not track.inlier[np.isin(track.stamp_ns, stamps(times[wrong]))].any()
    truth = path((track.stamp_ns - START_NS) / 1e9)
    assert np.abs(track.position_ego_m - truth).max() < 0.12


def test_the_papers_plain_scale_keeps_most_of_thirty_per_cent_of_one_sided_outliers() -> None:
    rng = np.random.Generator(np.random.PCG64(1))
    times = np.linspace(0, 5, 50)
    position = path(times)
    wrong = rng.choice(np.arange(1, 49), 15, replace=False)
    position[wrong, 0] += rng.uniform(4.0, 8.0, 15)
    robust = np.abs(smoothed(times, position).position_ego_m - path(times)).mean()
    track = smoothed(times, position, SmootherConfig.paper())
    plain = np.abs(track.position_ego_m - path((track.stamp_ns - START_NS) / 1e9)).mean()
    assert robust < 1e-6 < 0.1 < plain


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_outlier_on_any_axis_is_an_outlier(axis: int) -> None:
    times = np.linspace(0, 5, 50)
    position = path(times)
    position[20, axis] += 5.0
    track = smoothed(times, position)
    assert np.flatnonzero(~track.inlier).tolist() == [20]
    np.testing.assert_allclose(track.position_ego_m, path(times), atol=1e-6)


def test_deviations_below_the_floor_are_no_outliers_unless_the_floor_is_zero() -> None:
    times = np.linspace(0, 5, 50)
    position = path(times, cubic=0.0)
    position[20, 0] += 0.4
    assert smoothed(times, position).inlier.all()
    assert not smoothed(times, position, replace(SmootherConfig(), floor_m=0.0)).inlier.all()


def test_missed_frames_are_interpolated_and_marked() -> None:
    times = np.delete(np.linspace(0, 5, 51), [20, 21, 22])
    track = smoothed(times, path(times), missing_s=np.array([2.0, 2.1, 2.2]))
    assert len(track.stamp_ns) == 51 and (np.diff(track.stamp_ns) > 0).all()
    assert np.flatnonzero(~track.inlier).tolist() == [20, 21, 22]
    np.testing.assert_allclose(track.position_ego_m, path(np.linspace(0, 5, 51)), atol=1e-6)


def test_nothing_is_extrapolated_beyond_the_first_and_last_inlier() -> None:
    times = np.linspace(0, 5, 51)
    position = path(times)
    position[[0, 1, 50]] += 6.0
    track = smoothed(times, position, missing_s=np.array([-1.0, 6.0]))
    assert track.stamp_ns[0] == stamps(times)[2] and track.stamp_ns[-1] == stamps(times)[49]


def test_several_cameras_at_one_stamp_make_one_row_and_no_singular_fit() -> None:
    times = np.repeat(np.linspace(0, 5, 6), 3)
    track = smoothed(times, path(times))
    assert len(track.stamp_ns) == 6 and track.inlier.all()
    np.testing.assert_allclose(track.position_ego_m, path(np.linspace(0, 5, 6)), atol=1e-6)


def test_a_camera_that_is_always_wrong_does_not_win_against_two_others() -> None:
    times = np.repeat(np.linspace(0, 5, 30), 3)
    position = path(times)
    position[::3] += 6.0  # the first of the three samples at every stamp
    np.testing.assert_allclose(
        smoothed(times, position).position_ego_m, path(np.linspace(0, 5, 30)), atol=1e-6
    )


def test_one_good_sample_of_a_stamp_makes_it_an_inlier() -> None:
    times = np.repeat(np.linspace(0, 5, 30), 2)
    position = path(times)
    position[31] += 8.0
    assert smoothed(times, position).inlier.all()


def test_the_order_of_the_samples_does_not_matter() -> None:
    times = np.linspace(0, 5, 40)
    order = np.random.Generator(np.random.PCG64(0)).permutation(40)
    a, b = smoothed(times, path(times)), smoothed(times[order], path(times)[order])
    assert a.position_ego_m.tobytes() == b.position_ego_m.tobytes()


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_few_samples_come_back_as_they_are(count: int) -> None:
    times = np.linspace(0, 1, count)
    track = smoothed(times, path(times))
    np.testing.assert_allclose(track.position_ego_m, path(times), atol=1e-9)


def test_many_samples_of_one_instant_become_their_mean() -> None:
    position = np.array([[1.0, 2.0, 3.0], [3.0, 2.0, 1.0], [2.0, 5.0, 2.0]])
    track = smoothed(np.zeros(3), position)
    np.testing.assert_allclose(track.position_ego_m, [[2.0, 3.0, 2.0]])


def test_no_samples_make_an_empty_trajectory() -> None:
    assert len(smoothed(np.zeros(0), np.zeros((0, 3))).stamp_ns) == 0


def test_half_of_the_samples_of_phase_one_agree_with_the_parabola() -> None:
    rng = np.random.Generator(np.random.PCG64(2))
    unit = np.linspace(-1, 1, 60)
    noise = rng.normal(0.0, 1.0, (60, 3))
    inlier = find_inliers(unit, noise, SmootherConfig())
    assert 0.7 < inlier.mean() <= 1.0  # 2 sigma on three axes: 0.954 ** 3 = 0.87 of Gaussian samples
