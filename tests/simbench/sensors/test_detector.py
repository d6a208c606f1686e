"""The detector model: exact without disturbance, the right statistics with it, no word about the truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import rankdata

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx
from scenarios.scenario import DetectorSpec
from simbench.sensors.detector import Detected, Detector, draw_track_ids, perfect, recall
from simbench.truth import ObjectInfo, TrueBox

CAMERA = PinholeCamera(fx_px=600, fy_px=600, cx_px=480, cy_px=300, width_px=960, height_px=600)
SURE = DetectorSpec(recall_at_best=1.0, false_boxes_per_image=0.0)


def objects(n: int) -> tuple[ObjectInfo, ...]:
    kinds = ("rider", "car", "pedestrian")
    return tuple(
        ObjectInfo(object_id=i, name=f"thing-{i}", category=kinds[i % 3], size_m=(1.0, 1.0, 1.0))
        for i in range(n)
    )


def box(object_id: int, px: BoxPx = (100.0, 100.0, 180.0, 260.0), fraction: float = 1.0) -> TrueBox:
    return TrueBox(object_id=object_id, amodal_px=px, visible_px=px, visible_fraction=fraction)


def run(
    spec: DetectorSpec,
    boxes: tuple[TrueBox, ...],
    frames: int,
    seed: int = 0,
    n: int = 8,
    edge_errors: dict[int, np.ndarray] | None = None,
) -> list[Detected]:
    detector = Detector(spec, "cam", CAMERA, objects(n), frames, seed, edge_errors or {})
    return [detector.detect(frame, boxes) for frame in range(frames)]


def seen(results: list[Detected], object_id: int) -> np.ndarray:
    return np.array([object_id in r.object_id for r in results])


def with_recall(share: float, burst: float, false_boxes: float = 0.0) -> DetectorSpec:
    """For a box 160 px high, wholly visible: the recall is `share`."""
    return DetectorSpec(recall_at_best=share, miss_burst_frames=burst, false_boxes_per_image=false_boxes)


# -- without disturbance ----------------------------------------------------------------------------------


def test_without_disturbance_the_detections_are_the_visible_boxes_exactly() -> None:
    boxes = (
        box(0, (10.0, 20.0, 90.0, 220.0)),
        box(1, (300.0, 100.0, 500.0, 400.0)),
        box(2, (0.0, 0.0, 960.0, 600.0)),
    )
    for result in run(SURE, boxes, 50):
        assert sorted(result.object_id) == [0, 1, 2]
        for detection, object_id in zip(result.boxes, result.object_id, strict=True):
            assert detection.box_px == boxes[object_id].visible_px
            assert detection.category == objects(8)[object_id].category


def test_what_is_not_visible_or_not_of_a_wanted_category_is_not_detected() -> None:
    hidden = TrueBox(object_id=0, amodal_px=(10, 10, 90, 190), visible_px=None, visible_fraction=0.0)
    spec = SURE.model_copy(update={"categories": ("rider", "pedestrian")})
    for result in run(spec, (hidden, box(1), box(2)), 20):
        assert result.object_id == (2,)


def test_below_its_floors_nothing_is_found() -> None:
    assert recall(SURE, SURE.min_height_px - 0.1, 1.0) == 0.0
    assert recall(SURE, 100.0, SURE.min_visible_fraction - 0.01) == 0.0
    assert recall(SURE, 1000.0, 1.0) == pytest.approx(1.0)


@given(st.floats(0, 500), st.floats(0, 1))
def test_a_perfect_detector_misses_nothing_above_its_floors(height_px: float, visible: float) -> None:
    spec = DetectorSpec(recall_at_best=0.6, false_boxes_per_image=3.0)
    above = height_px >= spec.min_height_px and visible >= spec.min_visible_fraction
    assert recall(perfect(spec), height_px, visible) == (1.0 if above else 0.0)
    assert perfect(spec).false_boxes_per_image == 0.0


def test_a_perfect_detector_sees_what_enters_the_picture_at_once() -> None:
    detector = Detector(perfect(DetectorSpec()), "cam", CAMERA, objects(30), 2, 0, {})
    too_low = tuple(box(i, (0.0, 300.0, 9.0, 308.0)) for i in range(30))
    assert detector.detect(0, too_low).object_id == ()
    assert len(detector.detect(1, tuple(box(i) for i in range(30))).object_id) == 30


@given(h=st.floats(0, 500), dh=st.floats(0, 100), v=st.floats(0, 1), dv=st.floats(0, 1))
def test_recall_never_falls_with_height_or_visibility(h: float, dh: float, v: float, dv: float) -> None:
    spec = DetectorSpec()
    assert 0.0 <= recall(spec, h, v) <= recall(spec, h + dh, min(v + dv, 1.0)) <= spec.recall_at_best


# -- misses -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("share", "burst"), [(0.99, 2.0), (0.9, 1.0), (0.7, 4.0), (0.5, 2.0), (0.2, 2.0), (0.05, 1.0)]
)
def test_the_share_of_misses_is_one_minus_recall(share: float, burst: float) -> None:
    frames, things = 1200, 6
    results = run(with_recall(share, burst), tuple(box(i) for i in range(things)), frames, seed=3)
    missed = np.concatenate([~seen(results, i) for i in range(things)])
    # Bursts make frames dependent: as if there were fewer.
    length = max(burst, (1 - share) / share, share / (1 - share)) + 1.0
    limit = 5.0 * np.sqrt(share * (1 - share) / (frames * things / length))
    assert missed.mean() == pytest.approx(1.0 - share, abs=limit)


@pytest.mark.parametrize(("share", "burst"), [(0.8, 1.0), (0.8, 2.0), (0.8, 5.0), (0.95, 3.0)])
def test_bursts_of_misses_are_as_long_as_asked_on_average(share: float, burst: float) -> None:
    results = run(with_recall(share, burst), tuple(box(i) for i in range(6)), 1200, seed=4)
    lengths: list[int] = []
    for i in range(6):
        edges = np.flatnonzero(np.diff(np.concatenate([[True], seen(results, i), [True]]).astype(int)))
        lengths += (edges[1::2] - edges[0::2]).tolist()
    assert np.mean(lengths) == pytest.approx(burst, rel=5.0 / np.sqrt(len(lengths)))


def test_the_first_frame_misses_as_often_as_any() -> None:
    first = [0 in run(with_recall(0.6, 5.0), (box(0),), 1, seed=s)[0].object_id for s in range(400)]
    assert np.mean(first) == pytest.approx(0.6, abs=5.0 * np.sqrt(0.24 / 400))


# -- disturbance ------------------------------------------------------------------------------------------


def test_edge_errors_move_each_edge_by_its_share_of_the_side() -> None:
    errors = np.array([[0.1, -0.05, 0.2, 0.0]])
    (result,) = run(SURE, (box(0, (100.0, 100.0, 180.0, 260.0)),), 1, edge_errors={0: errors})
    np.testing.assert_allclose(result.boxes[0].box_px, (108.0, 92.0, 196.0, 260.0))


@settings(max_examples=50)
@given(
    edges=st.tuples(*[st.floats(-1.5, 1.5)] * 4),
    x=st.floats(0, 900), y=st.floats(0, 500),
)  # fmt: skip
def test_a_box_ends_at_the_images_border_or_is_gone(edges: tuple[float, ...], x: float, y: float) -> None:
    errors = np.array([edges])
    (result,) = run(
        SURE, (box(0, (x, y, min(x + 200.0, 960.0), min(y + 200.0, 600.0))),), 1, edge_errors={0: errors}
    )
    for detection in result.boxes:
        x0, y0, x1, y1 = detection.box_px
        assert 0.0 <= x0 < x1 <= 960.0
        assert 0.0 <= y0 < y1 <= 600.0


# -- false boxes ------------------------------------------------------------------------------------------


def test_false_boxes_come_at_their_rate_inside_the_image() -> None:
    spec = SURE.model_copy(update={"false_boxes_per_image": 0.4})
    results = run(spec, (), 3000, seed=5)
    counts = np.array([len(r.boxes) for r in results])
    assert counts.mean() == pytest.approx(0.4, abs=5.0 * np.sqrt(0.4 / 3000))
    assert counts.var() == pytest.approx(0.4, rel=0.15)  # Poisson
    for r in results:
        assert set(r.object_id) <= {-1}
        for detection in r.boxes:
            x0, y0, x1, y1 = detection.box_px
            assert 0.0 <= x0 < x1 <= 960.0
            assert 0.0 <= y0 < y1 <= 600.0
            assert detection.category in spec.categories


def auc(a: np.ndarray, b: np.ndarray) -> float:
    rank = rankdata(np.concatenate([a, b]))
    return float((rank[: len(a)].sum() - len(a) * (len(a) + 1) / 2) / (len(a) * len(b)))


def test_confidence_order_and_ids_do_not_tell_true_from_false_boxes_nor_the_target() -> None:
    spec = with_recall(0.9, 2.0, false_boxes=2.0)
    rows = []
    for seed in range(100):
        for result in run(spec, tuple(box(i) for i in range(4)), 4, seed=seed):
            for place, (d, object_id) in enumerate(zip(result.boxes, result.object_id, strict=True)):
                rows.append((object_id, d.confidence, place / max(len(result.boxes) - 1, 1), d.track_id))
    table = np.array(rows, dtype=float)
    false, target = table[:, 0] < 0, table[:, 0] == 0
    assert false.sum() > 400
    for column in (1, 2, 3):
        for one, other in ((false, ~false), (target, ~target & ~false)):
            assert 0.42 < auc(table[one, column], table[other, column]) < 0.58, column
    # No single threshold on an id tells either: both kinds of id fill the same range.
    assert table[false, 3].max() < 1.05 * table[~false, 3].max()


def test_no_false_box_carries_an_objects_id() -> None:
    for seed in range(30):
        spec = with_recall(0.9, 2.0, false_boxes=5.0)
        own = set(draw_track_ids(objects(8), seed).values())
        for result in run(spec, (), 20, seed=seed):
            assert not own & {d.track_id for d in result.boxes}


def test_track_ids_are_the_same_in_every_camera_and_differ_between_objects_and_seeds() -> None:
    ids = draw_track_ids(objects(8), 3)
    assert len(set(ids.values())) == 8
    assert ids == Detector(SURE, "a", CAMERA, objects(8), 1, 3, {}).track_id
    assert ids == Detector(SURE, "b", CAMERA, objects(8), 1, 3, {}).track_id
    assert ids != draw_track_ids(objects(8), 4)


# -- independence -----------------------------------------------------------------------------------------


def of_object(results: list[Detected], object_id: int) -> list[tuple[object, ...]]:
    """What was said of one object (or of nothing: -1), frame by frame."""
    return [tuple(d for d, i in zip(r.boxes, r.object_id, strict=True) if i == object_id) for r in results]


def test_one_objects_fate_never_moves_anothers_nor_the_false_boxes() -> None:
    """With and without a companion in view; with another's edges in error; with another in more frames."""
    spec = with_recall(0.7, 2.0, false_boxes=0.5)
    alone = run(spec, (box(3),), 300, seed=6)
    for others in (
        run(spec, (box(0), box(3), box(5)), 300, seed=6),
        run(spec, (box(0), box(3)), 300, seed=6, edge_errors={0: np.full((300, 4), 0.1)}),
        run(spec, (box(3), box(7, (5.0, 5.0, 6.0, 6.0))), 300, seed=6),
    ):
        assert of_object(others, 3) == of_object(alone, 3)
        assert of_object(others, -1) == of_object(alone, -1)
    assert any(of_object(alone, -1))


def test_the_order_of_two_does_not_depend_on_a_third() -> None:
    spec = with_recall(1.0, 2.0)
    two, three = run(spec, (box(1), box(2)), 200, seed=7), run(spec, (box(0), box(1), box(2)), 200, seed=7)
    for a, b in zip(two, three, strict=True):
        assert [i for i in b.object_id if i != 0] == list(a.object_id)
    assert 60 < sum(r.object_id[0] == 1 for r in two) < 140


def test_the_same_seed_detects_the_same_and_cameras_are_independent() -> None:
    spec = with_recall(0.6, 2.0, false_boxes=0.5)
    assert run(spec, (box(0), box(1)), 100, seed=8) == run(spec, (box(0), box(1)), 100, seed=8)
    other = Detector(spec, "other", CAMERA, objects(8), 100, 8, {})
    misses = [0 not in other.detect(f, (box(0),)).object_id for f in range(100)]
    here = ~seen(run(spec, (box(0),), 100, seed=8), 0)
    assert not np.array_equal(np.array(misses), here)
