"""Step 3: modes of the distance, on hand-made distances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fusion.clustering import ClusteringConfig, DistanceHistogram, distance_histogram

distances = arrays(np.float64, st.integers(0, 200), elements=st.floats(0.5, 40.0))


def histogram(values: object, granularity_m: float = 1.0, min_points: int = 4) -> DistanceHistogram:
    return distance_histogram(
        np.asarray(values, dtype=np.float64),
        granularity_m=granularity_m,
        min_points=min_points,
        config=ClusteringConfig(),
    )


def spread(centre: float, count: int, width: float = 0.4) -> np.ndarray:
    return centre + np.linspace(-width / 2, width / 2, count)


@given(values=distances, granularity_m=st.sampled_from([0.5, 0.8, 2.0, 6.0]))
def test_bins_hold_every_point_once_and_are_no_wider_than_the_granularity(
    values: np.ndarray, granularity_m: float
) -> None:
    h = histogram(values, granularity_m)
    if len(h.counts) == 0:
        return
    widths = np.diff(h.edges_m)
    assert (widths > -1e-9).all() and (widths <= granularity_m + 1e-6).all()
    np.testing.assert_allclose(widths[h.is_centre], granularity_m, atol=1e-6)
    assert h.counts.sum() == len(values)
    assert (values >= h.edges_m[h.bin_of_point] - 1e-6).all()
    assert (values <= h.edges_m[h.bin_of_point + 1] + 1e-6).all()


@given(values=distances)
def test_candidates_are_disjoint_large_enough_and_never_far_smaller_than_the_largest(
    values: np.ndarray,
) -> None:
    h = histogram(values)
    clusters = h.candidates()
    joined = np.concatenate([*clusters, np.zeros(0, dtype=np.int64)])
    assert len(np.unique(joined)) == len(joined)
    for cluster in clusters:
        assert len(cluster) >= max(4, 0.3 * h.counts.max())


@given(values=distances, seed=st.integers(0, 1000))
def test_the_order_of_the_points_decides_nothing(values: np.ndarray, seed: int) -> None:
    order = np.random.Generator(np.random.PCG64(seed)).permutation(len(values))
    plain, shuffled = histogram(values), histogram(values[order])
    assert plain.edges_m.tobytes() == shuffled.edges_m.tobytes()
    assert np.array_equal(plain.bin_of_point[order], shuffled.bin_of_point)


@given(values=distances, shift=st.floats(-20.0, 20.0))
def test_moving_everything_away_moves_the_bins_along(values: np.ndarray, shift: float) -> None:
    values, shift = np.round(values * 64) / 64, round(shift * 64) / 64  # exact sums
    plain, moved = histogram(values), histogram(values + shift)
    assert len(plain.candidates()) == len(moved.candidates())


def test_two_objects_and_stray_points_give_two_candidates_nearest_first() -> None:
    values = np.concatenate([spread(20.0, 60), spread(10.0, 40), [13.0, 14.7, 16.9]])
    near, far = histogram(values).candidates()
    assert near.tolist() == list(range(60, 100))
    assert far.tolist() == list(range(60))


def test_a_bin_is_centred_on_its_object() -> None:
    h = histogram(spread(10.0, 41))
    assert h.is_centre.sum() == 1
    (left,) = np.flatnonzero(h.is_centre)
    assert h.edges_m[left] == pytest.approx(9.5) and h.edges_m[left + 1] == pytest.approx(10.5)


def test_a_peak_below_the_ratio_is_no_candidate() -> None:
    values = np.concatenate([spread(10.0, 100), spread(20.0, 29)])
    assert len(histogram(values).candidates()) == 1
    values = np.concatenate([spread(10.0, 100), spread(20.0, 30)])
    assert len(histogram(values).candidates()) == 2


@pytest.mark.parametrize(("count", "candidates"), [(0, 0), (1, 0), (3, 0), (4, 1)])
def test_a_peak_needs_the_minimum_number_of_points(count: int, candidates: int) -> None:
    assert len(histogram(spread(10.0, count)).candidates()) == candidates


def test_at_most_five_centres_are_sought() -> None:
    values = np.concatenate([spread(5.0 * i, 20) for i in range(1, 9)])
    assert histogram(values).is_centre.sum() == 5


def test_an_object_just_before_a_larger_wall_stays_a_candidate() -> None:
    values = np.concatenate([spread(10.0, 60), spread(11.4, 150)])
    clusters = histogram(values).candidates()
    assert list(range(60)) in [c.tolist() for c in clusters]


def test_an_object_whose_bin_touches_a_fuller_one_stays_a_candidate() -> None:
    object_m = np.arange(-16, 17) / 64  # exact sums, so that the bins touch exactly
    values = np.concatenate([10.0 + object_m, np.repeat(11.0 + object_m, 3), 12.0 + object_m])
    assert [len(c) for c in histogram(values).candidates()] == [33, 99, 33]


def test_beyond_five_centres_only_a_peak_is_a_candidate() -> None:
    counts = (100, 90, 80, 70, 60, 50, 40, 45)
    values = np.concatenate([9.5 + i + np.linspace(0.005, 0.995, n) for i, n in enumerate(counts)])
    assert [len(c) > 40 for c in histogram(values).candidates()] == [True] * 6  # five centres, and the last
    centres = histogram(values).is_centre
    assert centres.sum() == 5


def test_scattered_background_drags_the_plain_mean_off_the_object_but_not_the_trimmed_one() -> None:
    values = np.concatenate([spread(10.0, 40), np.linspace(10.6, 30.0, 25)])
    kwargs = {"granularity_m": 0.8, "min_points": 30}
    trimmed = distance_histogram(values, config=ClusteringConfig(), **kwargs)
    plain = distance_histogram(values, config=ClusteringConfig.paper(), **kwargs)
    assert [len(c) for c in trimmed.candidates()] == [40]
    assert plain.edges_m[plain.is_centre.argmax()] > 12.0


def test_equal_distances_are_one_cluster() -> None:
    (cluster,) = histogram(np.full(50, 7.0)).candidates()
    assert len(cluster) == 50


def test_what_is_no_distance_or_width_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        histogram([1.0, np.nan])
    with pytest.raises(ValueError, match="positive"):
        histogram([1.0], granularity_m=0.0)
