"""The rivals of the paper's method: their clustering, their choice of points, and their laws as pipelines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from fusion.check import synthetic_run
from fusion.euclidean import dbscan, euclidean_clusters, voxels
from fusion.iou import bounding_boxes, iou, within
from fusion.messages import BoxPx, Detection, Detections, LidarScan
from fusion.pipeline import Pipeline
from fusion.pipelines.base import ScanPipeline
from fusion.pipelines.frustum_dbscan import FrustumDbscan, FrustumDbscanConfig
from fusion.pipelines.nearest_gap import NearestGap, NearestGapConfig
from fusion.pipelines.roi_cluster import RoiCluster, RoiClusterConfig, best_fit, cluster_columns
from fusion.pipelines.shrunken_median import ShrunkenMedian, ShrunkenMedianConfig
from fusion.pipelines.static_projection import StaticProjection, StaticProjectionGround
from fusion.pipelines.within_box import BoxPoints, RivalConfig, WithinBox
from tests.fusion.make import lidar_scan
from tests.fusion.street import (
    CALIBRATION,
    CATEGORIES,
    answer,
    same,
    scene,
    seen,
    street,
    with_points,
)

RIVALS = [ShrunkenMedian, NearestGap, FrustumDbscan, RoiCluster]
# Step 1 draws points by their index, so laws about points hold exactly only where it is left out.
WITH_GROUND: list[Callable[[], ScanPipeline]] = [
    lambda: ShrunkenMedian(ShrunkenMedianConfig(ground=None)),
    lambda: NearestGap(NearestGapConfig(ground=None)),
    lambda: FrustumDbscan(FrustumDbscanConfig(ground=None)),
    lambda: RoiCluster(RoiClusterConfig(ground=None)),
]
NAMES = ["shrunken_median", "nearest_gap", "frustum_dbscan", "roi_cluster"]
GROUND_M = -1.8  # in the LiDAR's frame


def cloud(seed: int, count: int, *, dimensions: int = 3, side_m: float = 4.0) -> np.ndarray:
    return np.random.Generator(np.random.PCG64(seed)).uniform(0.0, side_m, (count, dimensions))


def partition(labels: np.ndarray) -> set[frozenset[int]]:
    return {frozenset(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels[labels >= 0])}


def hovering(scan: LidarScan) -> LidarScan:
    """The points clear of the ground."""
    return with_points(scan, np.flatnonzero(scan.xyz_m[:, 2] > GROUND_M + 0.1))


# -- clusters in space ------------------------------------------------------------------------------------


@given(seed=st.integers(0, 10**6), count=st.integers(0, 60), size_m=st.floats(0.05, 5.0))
def test_the_cells_of_a_grid_hold_each_point_once_near_their_centroid(
    seed: int, count: int, size_m: float
) -> None:
    xyz_m = cloud(seed, count) - 2.0
    grid = voxels(xyz_m, size_m)
    assert np.array_equal(np.bincount(grid.cell_of_point, minlength=len(grid.count)), grid.count)
    assert grid.count.sum() == count and (grid.count > 0).all()
    np.testing.assert_allclose(
        (grid.centroid_m * grid.count[:, None]).sum(axis=0), xyz_m.sum(axis=0), atol=1e-9
    )
    assert (np.abs(xyz_m - grid.centroid_m[grid.cell_of_point]) <= size_m).all()
    cells = np.floor(xyz_m / size_m)
    assert len(grid.count) == len(np.unique(cells, axis=0))


def test_a_cell_must_have_a_size() -> None:
    with pytest.raises(ValueError, match="size_m must be positive, got 0"):
        voxels(np.zeros((1, 3)), 0.0)


@given(seed=st.integers(0, 10**6), count=st.integers(0, 50), tolerance_m=st.floats(0.1, 2.0))
def test_euclidean_clusters_are_the_components_of_the_graph_of_near_points(
    seed: int, count: int, tolerance_m: float
) -> None:
    xyz_m = cloud(seed, count, dimensions=2)
    joined = cdist(xyz_m, xyz_m) <= tolerance_m
    for _ in range(count):  # oracle: the transitive closure
        joined = joined @ joined
    expected = {frozenset(np.flatnonzero(row).tolist()) for row in joined}
    labels = euclidean_clusters(xyz_m, tolerance_m)
    assert partition(labels) == expected
    firsts = [int(np.flatnonzero(labels == k)[0]) for k in range(labels.max(initial=-1) + 1)]
    assert firsts == sorted(firsts)


@pytest.mark.parametrize("seed", range(4))
def test_a_long_chain_in_any_order_is_one_cluster(seed: int) -> None:
    order = np.random.Generator(np.random.PCG64(seed)).permutation(500)
    chain_m = np.stack([np.arange(500.0), np.zeros(500)], axis=1)[order]
    assert not euclidean_clusters(chain_m, 1.0).any()
    assert euclidean_clusters(chain_m, 0.99).max() == 499


def dbscan_by_the_book(
    xyz_m: np.ndarray, weight: np.ndarray, eps_m: np.ndarray, min_points: int
) -> tuple[np.ndarray, np.ndarray]:
    """Core points, and labels by growing each cluster from a core point."""
    near = cdist(xyz_m, xyz_m) <= np.minimum(eps_m[:, None], eps_m[None, :])
    core = near @ weight >= min_points
    labels = np.full(len(xyz_m), -1)
    for start in np.flatnonzero(core):
        if labels[start] >= 0:
            continue
        label, queue = labels.max() + 1, [start]
        labels[start] = label
        while queue:
            for other in np.flatnonzero(near[queue.pop()] & core & (labels < 0)):
                labels[other] = label
                queue.append(other)
    gaps = np.where(near & core[None, :], cdist(xyz_m, xyz_m), np.inf)
    for border in np.flatnonzero(~core):
        if np.isfinite(gaps[border].min(initial=np.inf)):
            labels[border] = labels[gaps[border].argmin()]
    return core, labels


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(0, 60),
    min_points=st.integers(1, 8),
    growth=st.floats(0.0, 0.3),
)
def test_dbscan_is_as_in_the_book(seed: int, count: int, min_points: int, growth: float) -> None:
    xyz_m = cloud(seed, count)
    weight = np.random.Generator(np.random.PCG64(seed)).integers(1, 4, count)
    eps_m = 0.4 + growth * np.linalg.norm(xyz_m, axis=1)
    labels = dbscan(xyz_m, weight, eps_m, min_points)
    _, expected = dbscan_by_the_book(xyz_m, weight, eps_m, min_points)
    assert np.array_equal(labels, expected)


def test_a_heavy_point_is_as_many_points() -> None:
    alone, pair = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    assert dbscan(alone, np.array([4]), np.array([0.5]), 5).tolist() == [-1]
    assert dbscan(alone, np.array([5]), np.array([0.5]), 5).tolist() == [0]
    assert dbscan(pair, np.array([4, 1]), np.full(2, 0.5), 5).tolist() == [0, 0]


def test_neighbours_must_be_near_for_both() -> None:
    pair, ones = np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0]]), np.ones(2, dtype=np.int64)
    assert dbscan(pair, ones, np.array([0.6, 0.6]), 2).tolist() == [0, 0]
    assert dbscan(pair, ones, np.array([0.5, 2.0]), 2).tolist() == [-1, -1]


# -- rectangles -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        ((0.0, 0.0, 10.0, 10.0), 1.0),
        ((5.0, 0.0, 15.0, 10.0), 1 / 3),
        ((2.0, 2.0, 4.0, 4.0), 0.04),
        ((10.0, 0.0, 20.0, 10.0), 0.0),  # they touch
        ((12.0, 12.0, 14.0, 14.0), 0.0),  # apart in both directions
        ((3.0, 3.0, 3.0, 9.0), 0.0),  # no area
        ((np.nan, np.nan, np.nan, np.nan), 0.0),
    ],
)
def test_the_overlap_of_two_boxes(box: BoxPx, expected: float) -> None:
    assert iou(np.array([box]), (0.0, 0.0, 10.0, 10.0))[0] == pytest.approx(expected)


def test_a_box_lies_within_itself_and_not_beyond_any_side() -> None:
    outer = (0.0, 0.0, 10.0, 10.0)
    boxes = np.array(
        [outer, (-1, 0, 9, 10), (0, -1, 10, 9), (1, 0, 11, 10), (0, 1, 10, 11), 4 * (np.nan,)], float
    )
    assert within(boxes, outer).tolist() == [True, False, False, False, False, False]


def test_rectangles_bound_the_pixels_of_their_label() -> None:
    uv_px = np.array([[5.0, 1.0], [2.0, 8.0], [-3.0, -4.0], [7.0, 0.0]])
    boxes = bounding_boxes(uv_px, np.array([0, 0, 2, 0]), 3)
    np.testing.assert_array_equal(boxes, [[2, 0, 7, 8], [np.nan] * 4, [-3, -4, -3, -4]])
    assert bounding_boxes(np.zeros((0, 2)), np.zeros(0, dtype=np.int64), 0).shape == (0, 4)


# -- which points of a box --------------------------------------------------------------------------------


def in_box(
    distance_m: list[float], uv_px: list[tuple[float, float]] | None = None, *, camera_m: float = 0.0
) -> BoxPoints:
    """Points straight ahead at these distances from a LiDAR, the camera so far ahead of it; box 0..100 px."""
    ahead = np.zeros((len(distance_m), 3), dtype=np.float32)
    ahead[:, 0] = distance_m
    centre = [(50.0, 50.0)] * len(distance_m)
    return BoxPoints(
        xyz_lidar_m=ahead,
        uv_px=np.array(centre if uv_px is None else uv_px, dtype=np.float64).reshape(-1, 2),
        box_px=(0.0, 0.0, 100.0, 100.0),
        camera_lidar_m=np.array([camera_m, 0.0, 0.0]),
    )


def chosen(rival: WithinBox, inside: BoxPoints) -> list[int]:
    mask = rival.select(inside)
    assert mask.shape == (len(inside.uv_px),)
    return np.flatnonzero(mask).tolist()


def test_the_median_is_of_the_middle_and_its_band_reaches_into_the_whole_box() -> None:
    # three in the middle half, one at its corner; then outside: too near, in the band twice, behind
    uv = [(50.0, 50.0), (40.0, 60.0), (25.0, 75.0), (24.9, 50.0), (99.0, 99.0), (1.0, 1.0), (50.0, 80.0)]
    box = in_box([10.0, 10.2, 10.4, 5.0, 10.9, 11.1, 30.0], uv)
    assert chosen(ShrunkenMedian(), box) == [0, 1, 2, 4, 5]
    assert chosen(ShrunkenMedian(ShrunkenMedianConfig(band_m=0.3)), box) == [0, 1, 2]


def test_without_points_in_the_middle_there_is_no_median() -> None:
    edges = in_box([10.0, 11.0], [(0.0, 50.0), (50.0, 100.0)])
    assert chosen(ShrunkenMedian(), edges) == []
    assert chosen(ShrunkenMedian(ShrunkenMedianConfig(keep=1.0)), edges) == [0, 1]


def test_the_nearest_cluster_ends_at_the_first_gap() -> None:
    assert chosen(NearestGap(), in_box([8.9, 8.5, 8.1, 9.3, 10.0])) == [0, 1, 2, 3]
    assert chosen(NearestGap(), in_box([8.0, 8.25, 8.75, 9.0])) == [0, 1]  # 0.5 m is a gap


def test_lone_returns_in_front_are_passed_over() -> None:
    assert chosen(NearestGap(), in_box([3.0, 5.0, 8.0, 8.1])) == [2, 3]
    assert chosen(NearestGap(), in_box([3.0, 5.0, 8.0])) == []
    three = NearestGap(NearestGapConfig(min_points=3))
    assert chosen(three, in_box([3.0, 3.1, 8.0, 8.1, 8.2])) == [2, 3, 4]


def test_the_distance_of_a_gap_is_measured_from_the_camera() -> None:
    both_sides = [2.0, 2.0, 6.0, 6.0]
    assert chosen(NearestGap(), in_box(both_sides)) == [0, 1]
    assert chosen(NearestGap(), in_box(both_sides, camera_m=4.0)) == [0, 1, 2, 3]  # 2 m before and behind it


def test_the_distance_of_a_gap_is_planar() -> None:
    box = in_box([8.0, 8.0])
    xyz_m = box.xyz_lidar_m.copy()
    xyz_m[1, 2] = 6.0
    assert chosen(NearestGap(), replace(box, xyz_lidar_m=xyz_m)) == [0, 1]


def test_the_largest_cluster_wins_and_of_two_as_large_the_nearer() -> None:
    near, far = [6.0, 6.0, 6.2, 6.2, 6.4], [9.0, 9.1, 9.2, 9.3, 9.4, 9.5]
    assert chosen(FrustumDbscan(), in_box(near + far)) == [5, 6, 7, 8, 9, 10]
    assert chosen(FrustumDbscan(), in_box(far[:5] + near)) == [5, 6, 7, 8, 9]
    assert chosen(FrustumDbscan(), in_box(near + far[:5])) == [0, 1, 2, 3, 4]


def test_what_is_too_thin_for_a_cluster_is_noise() -> None:
    assert chosen(FrustumDbscan(), in_box([6.0, 8.0, 10.0, 12.0, 14.0])) == []
    assert chosen(FrustumDbscan(), in_box([6.0, 6.0, 6.2, 6.2])) == []
    assert chosen(FrustumDbscan(), in_box([6.0, 6.0, 6.2, 6.2, 6.4, 9.0])) == [0, 1, 2, 3, 4]


def test_the_neighbourhood_grows_with_the_range() -> None:
    def mast(distance_m: float) -> BoxPoints:
        box = in_box([distance_m] * 5)
        xyz_m = box.xyz_lidar_m.copy()
        xyz_m[:, 2] = 0.7 * np.arange(5)
        return replace(box, xyz_lidar_m=xyz_m)

    config = FrustumDbscanConfig(min_points=2)
    assert chosen(FrustumDbscan(config), mast(10.0)) == []
    assert chosen(FrustumDbscan(config), mast(20.0)) == [0, 1, 2, 3, 4]  # 4 % of 20 m are 0.8 m
    assert chosen(FrustumDbscan(replace(config, eps_per_range=0.0)), mast(20.0)) == []


def test_an_empty_box_has_no_points_to_choose() -> None:
    for rival in (ShrunkenMedian(), NearestGap(), FrustumDbscan()):
        assert chosen(rival, in_box([])) == []


# -- the best rectangle -----------------------------------------------------------------------------------


def test_clusters_are_seen_from_above_and_small_ones_dropped() -> None:
    post = np.stack([np.full(10, 5.0), np.zeros(10), np.arange(10.0)], axis=1)  # a metre apart
    beside = post + np.array([0.0, 0.9, 0.0])
    pebble = np.array([[5.0, -20.0, 0.0]] * 9)
    xyz_m = np.concatenate([pebble, post, beside]).astype(np.float32)
    points, label = cluster_columns(xyz_m, RoiClusterConfig())
    assert points.tolist() == list(range(9, 29))
    assert label.tolist() == 10 * [0] + 10 * [1]
    _, joined = cluster_columns(xyz_m, RoiClusterConfig(tolerance_m=0.95))
    assert joined.tolist() == 20 * [0]
    none, no_label = cluster_columns(np.zeros((0, 3), dtype=np.float32), RoiClusterConfig())
    assert none.shape == no_label.shape == (0,)


def test_the_best_rectangle_above_the_threshold_is_taken() -> None:
    box, config = (0.0, 0.0, 10.0, 10.0), RoiClusterConfig()
    poor, good, gone = (5.0, 0.0, 15.0, 10.0), (0.0, 0.0, 10.0, 7.0), 4 * (np.nan,)
    assert best_fit(np.array([poor, gone, good]), box, config) == 2
    assert best_fit(np.array([poor, gone]), box, config) is None  # a third
    assert best_fit(np.array([(0.0, 0.0, 10.0, 3.5)]), box, config) is None  # not above 0.35
    assert best_fit(np.zeros((0, 4)), box, config) is None


def test_the_strict_preset_wants_a_rectangle_that_does_not_stick_out() -> None:
    box, strict = (0.0, 0.0, 10.0, 10.0), RoiClusterConfig.strict()
    assert best_fit(np.array([(-0.5, 0.0, 10.0, 10.0)]), box, strict) == 0
    assert best_fit(np.array([(-0.6, 0.0, 10.0, 10.0)]), box, strict) is None
    assert best_fit(np.array([(-0.6, 0.0, 10.0, 10.0)]), box, RoiClusterConfig()) == 0
    assert best_fit(np.array([(0.0, 0.0, 10.0, 6.4)]), box, strict) is None
    assert best_fit(np.array([(-0.6, 0.0, 10.0, 10.0), (0.0, 0.0, 10.0, 7.0)]), box, strict) == 1


# -- laws of the pipelines --------------------------------------------------------------------------------


@pytest.mark.parametrize("factory", RIVALS, ids=NAMES)
def test_every_rival_finds_the_person_and_the_car(factory: Callable[[], Pipeline]) -> None:
    scan, hit = scene()
    person, car = answer(factory(), scan, seen()).objects
    assert (person.track_id, person.category, person.sensor) == (1, "pedestrian", "front")
    for found, block, least in ((person, 0, 0.9), (car, 1, 0.6)):
        assert np.mean(hit[found.points] == block) > 0.95
        clear = (hit == block) & (scan.xyz_m[:, 2] > GROUND_M + 0.25)
        assert np.isin(np.flatnonzero(clear), found.points).mean() > least
    np.testing.assert_allclose(person.position_ego_m[:2], [7.85, 1.0], atol=0.3)
    assert 9.5 < car.distance_m < 12.5
    assert (person.confidence, car.confidence) == (0.9, 0.8)


@pytest.mark.parametrize("factory", RIVALS, ids=NAMES)
def test_what_stands_behind_the_person_costs_the_baseline_points_but_no_rival(
    factory: Callable[[], Pipeline],
) -> None:
    scan, hit = scene()
    wide = replace(seen(), boxes=tuple(widened(box, 1.5) for box in seen().boxes[:1]))
    baseline, rival = answer(StaticProjectionGround(), scan, wide), answer(factory(), scan, wide)
    share = [float(np.mean(hit[output.objects[0].points] == 0)) for output in (baseline, rival)]
    assert share[0] < 0.9 and share[1] > 0.99


def widened(box: Detection, scale: float) -> Detection:
    x0, y0, x1, y1 = box.box_px
    spread = 0.5 * (scale - 1.0) * (x1 - x0)
    return replace(box, box_px=(x0 - spread, y0, x1 + spread, y1))


@pytest.mark.parametrize("factory", WITH_GROUND[:3], ids=NAMES[:3])
def test_points_outside_all_boxes_change_nothing(factory: Callable[[], Pipeline]) -> None:
    scan, _ = scene()
    boxed = np.unique(np.concatenate([o.points for o in answer(StaticProjection(), scan, seen()).objects]))
    clear = np.flatnonzero(scan.xyz_m[:, 2] > GROUND_M + 0.1)
    inside = np.intersect1d(boxed, clear)  # else ground fills the boxes
    more = np.union1d(inside, np.setdiff1d(np.arange(len(scan.xyz_m)), boxed))
    plain, fuller = (answer(factory(), with_points(scan, index), seen()) for index in (inside, more))
    assert len(plain.objects) == 2 and len(more) > len(inside) + 1000
    assert same(fuller, plain, np.searchsorted(more, inside))


def test_other_clusters_that_no_box_sees_change_nothing_for_the_projected_clusters() -> None:
    scan = hovering(scene()[0])
    factory = WITH_GROUND[3]
    plain = answer(factory(), scan, seen())
    used = np.unique(np.concatenate([o.points for o in plain.objects]))
    fewer = answer(factory(), with_points(scan, used), seen())
    assert len(used) < len(scan.xyz_m) - 100 and same(plain, fewer, used)


def test_a_car_that_touches_a_hedge_is_one_cluster_with_it_and_fits_no_box() -> None:
    (apart, _), (touching, _) = scene(), street()
    assert [o.track_id for o in answer(RoiCluster(), apart, seen()).objects] == [1, 2]
    assert [o.track_id for o in answer(RoiCluster(), touching, seen()).objects] == [1]


@pytest.mark.parametrize(
    "factory", [*RIVALS, *WITH_GROUND], ids=[*NAMES, *(f"{n} with ground" for n in NAMES)]
)
def test_where_there_is_nothing_to_find_nothing_is_found(factory: Callable[[], Pipeline]) -> None:
    scan, _ = scene(rings=16)
    x0, y0, x1, y1 = seen().boxes[0].box_px

    def boxed(*box: float) -> Detections:
        return replace(seen(), boxes=(replace(seen().boxes[0], box_px=box),))

    nowhere = with_points(scan, np.zeros(0, dtype=np.int64))
    lost = lidar_scan(np.where(np.arange(len(scan.xyz_m))[:, None] % 2 == 0, np.nan, np.inf) * np.ones(3))
    for sweep, detections in (
        (nowhere, seen()),
        (lost, seen()),
        (scan, replace(seen(), boxes=())),
        (scan, boxed(x0, y0, x0, y1)),  # no area
        (scan, boxed(x1, y1, x0, y0)),
        (scan, boxed(np.nan, y0, x1, y1)),
        (scan, boxed(x0 - 5000, y0, x1 - 5000, y1)),  # outside the image
        (scan, boxed(440.0, 0.0, 460.0, 40.0)),  # the sky
    ):
        assert answer(factory(), sweep, detections).objects == ()


@pytest.mark.parametrize("factory", WITH_GROUND, ids=NAMES)
def test_points_that_are_not_finite_are_as_good_as_missing(factory: Callable[[], Pipeline]) -> None:
    scan = hovering(scene(rings=16)[0])
    good = np.arange(len(scan.xyz_m)) % 9 != 0
    spoilt = np.where(good[:, None], scan.xyz_m, np.array([np.nan, 1.0, np.inf], dtype=np.float32))
    found = answer(factory(), lidar_scan(spoilt, offset_ns=scan.offset_ns), seen())
    index = np.flatnonzero(good)
    assert len(found.objects) == 2
    assert same(found, answer(factory(), with_points(scan, index), seen()), index)


def test_the_points_of_a_box_come_with_their_pixels_and_the_cameras_place() -> None:
    given: list[BoxPoints] = []

    class Notes(WithinBox):
        def select(self, inside: BoxPoints) -> np.ndarray:
            given.append(inside)
            return np.zeros(len(inside.uv_px), dtype=bool)

    assert answer(Notes(RivalConfig()), scene()[0], seen()).objects == ()
    for inside, box in zip(given, seen().boxes, strict=True):
        np.testing.assert_allclose(inside.camera_lidar_m, [0.2, 0.0, -0.2], atol=1e-12)
        assert inside.box_px == box.box_px and len(inside.uv_px) > 50
        T_front_lidar = CALIBRATION.T_camera_lidar("front", "lidar")
        expected_px = CALIBRATION.cameras["front"].project(T_front_lidar.apply(inside.xyz_lidar_m))
        np.testing.assert_allclose(inside.uv_px, expected_px, atol=1e-9)


@pytest.mark.parametrize("factory", RIVALS, ids=NAMES)
def test_every_step_is_timed_once_per_scan(factory: Callable[[], ScanPipeline]) -> None:
    calibration, categories, messages = synthetic_run()
    pipeline = factory()
    pipeline.reset(calibration, categories)
    for message in messages:
        pipeline.update(message)
    pipeline.trajectories()
    timings = pipeline.timings_ns()
    assert list(timings) == [*pipeline.steps, "smooth"]
    assert {len(timings[step]) for step in pipeline.steps} == {8} and len(timings["smooth"]) == 1
    assert all(sum(spent) > 0 for spent in timings.values())


def test_a_category_without_a_size_is_no_trouble() -> None:
    scan, _ = scene(rings=16)
    boat = replace(seen(), boxes=tuple(replace(box, category="boat") for box in seen().boxes))
    assert "boat" not in CATEGORIES
    for factory in RIVALS:
        assert [o.category for o in answer(factory(), scan, boat).objects] == ["boat", "boat"]
