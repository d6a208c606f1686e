"""Laws of whole pipelines, on a small analytic street."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from fusion.check import synthetic_run
from fusion.geometry import Transform, rotation_rpy
from fusion.messages import (
    Calibration,
    CategorySize,
    Detection,
    Detections,
    FusionOutput,
    LidarScan,
    Trajectory,
)
from fusion.pipeline import Pipeline
from fusion.pipelines.probabilistic import (
    Probabilistic,
    ProbabilisticConfig,
    explain_scan,
    probabilistic_paper,
)
from fusion.pipelines.static_projection import StaticProjection, StaticProjectionGround
from fusion.shape import ShapeConfig, load_benchmark_shapes
from fusion.synthetic import Block, beams, cast
from tests.fusion.make import lidar_scan

OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
CAMERA = PinholeCamera(fx_px=500.0, fy_px=500.0, cx_px=480.0, cy_px=300.0, width_px=960, height_px=600)
CALIBRATION = Calibration(
    T_ego_sensor={
        "lidar": Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.8])),
        "front": Transform(rotation=OPTICAL, translation_m=np.array([0.2, 0.0, 1.6])),
    },
    cameras={"front": CAMERA},
)
CATEGORIES = {"board": CategorySize(mean_m=(1.0, 0.1, 1.0), spread=0.1)}
PERSON = Block(centre_m=(8.0, 1.0, 0.9), size_m=(0.3, 0.5, 1.8))
CAR = Block(centre_m=(12.0, -2.0, 0.75), size_m=(4.5, 1.8, 1.5), yaw_rad=0.3)
HEDGE = Block(centre_m=(14.0, 3.0, 1.0), size_m=(0.5, 9.0, 2.0))
BLOCKS = (PERSON, CAR, HEDGE)
OURS = [StaticProjection, StaticProjectionGround, Probabilistic, probabilistic_paper]


def street(rings: int = 32, columns: int = 900, reach_m: float = 14.5) -> tuple[LidarScan, np.ndarray]:
    """A sweep, cut off before the region of step 1 ends however it is turned, and the block hit [n]."""
    origin = CALIBRATION.T_ego_sensor["lidar"].translation_m
    rays = beams(rings, columns, np.deg2rad(16.0))
    range_m, hit = cast(origin, rays, BLOCKS)
    seen = range_m < reach_m
    xyz = rays[seen] * range_m[seen, None]
    column = (np.arange(rings * columns) // rings)[seen]
    return lidar_scan(xyz, offset_ns=column * (100_000_000 // columns)), hit[seen]


def box_of(block: Block, shift_px: float = 0.0) -> tuple[float, float, float, float]:
    uv = CAMERA.project(CALIBRATION.T_ego_sensor["front"].inverse().apply(block.corners_m()))
    (x0, y0), (x1, y1) = uv.min(axis=0), uv.max(axis=0)
    return (float(x0) + shift_px, float(y0), float(x1) + shift_px, float(y1))


def seen(shift_px: float = 0.0) -> Detections:
    boxes = (
        Detection(track_id=1, category="pedestrian", box_px=box_of(PERSON, shift_px), confidence=0.9),
        Detection(track_id=2, category="car", box_px=box_of(CAR, shift_px), confidence=0.8),
    )
    return Detections(sensor="front", seq=0, stamp_ns=0, arrival_ns=0, boxes=boxes)


def answer(
    pipeline: Pipeline,
    scan: LidarScan,
    detections: Detections,
    calibration: Calibration = CALIBRATION,
) -> FusionOutput:
    pipeline.reset(calibration, CATEGORIES)
    assert pipeline.update(detections) is None
    output = pipeline.update(scan)
    assert output is not None
    return output


def with_points(scan: LidarScan, index: np.ndarray) -> LidarScan:
    return lidar_scan(scan.xyz_m[index], offset_ns=scan.offset_ns[index])


@pytest.mark.parametrize("factory", OURS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("yaw_rad", [0.4, np.pi / 2, -2.5])
def test_turning_the_scene_and_the_rig_about_the_vertical_turns_the_result(
    factory: Callable[[], Pipeline], yaw_rad: float
) -> None:
    scan, _ = street()
    turn = Transform(rotation=rotation_rpy(0, 0, yaw_rad), translation_m=np.zeros(3))
    turned = replace(
        CALIBRATION, T_ego_sensor={name: turn @ T for name, T in CALIBRATION.T_ego_sensor.items()}
    )
    plain, moved = answer(factory(), scan, seen()), answer(factory(), scan, seen(), turned)
    assert len(plain.objects) == len(moved.objects) == 2
    for a, b in zip(plain.objects, moved.objects, strict=True):
        assert np.array_equal(a.points, b.points)
        np.testing.assert_allclose(turn.apply(a.position_ego_m), b.position_ego_m, atol=1e-9)


@pytest.mark.parametrize("factory", OURS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("scale", [0.5, 2.0, 4.0])
def test_scaling_the_image_with_its_intrinsics_changes_nothing(
    factory: Callable[[], Pipeline], scale: float
) -> None:
    scan, _ = street()
    camera = PinholeCamera(
        fx_px=500.0 * scale,
        fy_px=500.0 * scale,
        cx_px=480.0 * scale,
        cy_px=300.0 * scale,
        width_px=int(960 * scale),
        height_px=int(600 * scale),
    )
    boxes = []
    for box in seen().boxes:
        x0, y0, x1, y1 = box.box_px
        boxes.append(replace(box, box_px=(x0 * scale, y0 * scale, x1 * scale, y1 * scale)))
    scaled = answer(
        factory(),
        scan,
        replace(seen(), boxes=tuple(boxes)),
        replace(CALIBRATION, cameras={"front": camera}),
    )
    for a, b in zip(answer(factory(), scan, seen()).objects, scaled.objects, strict=True):
        assert np.array_equal(a.points, b.points) and a.stamp_ns == b.stamp_ns


def test_points_outside_all_boxes_change_nothing_for_the_static_projection() -> None:
    scan, _ = street()
    plain = answer(StaticProjection(), scan, seen())
    used = np.unique(np.concatenate([o.points for o in plain.objects]))
    fewer = answer(StaticProjection(), with_points(scan, used), seen())
    for a, b in zip(plain.objects, fewer.objects, strict=True):
        assert np.array_equal(a.points, used[b.points])
        assert np.array_equal(a.position_ego_m, b.position_ego_m) and a.stamp_ns == b.stamp_ns


@settings(max_examples=10)
@given(seed=st.integers(0, 1000))
def test_permuting_the_points_permutes_the_mapping_and_moves_no_object(seed: int) -> None:
    scan, _ = street()
    order = np.random.Generator(np.random.PCG64(seed)).permutation(len(scan.xyz_m))
    plain = answer(StaticProjection(), scan, seen())
    shuffled = answer(StaticProjection(), with_points(scan, order), seen())
    for a, b in zip(plain.objects, shuffled.objects, strict=True):
        assert np.array_equal(a.points, np.sort(order[b.points]))
        assert np.array_equal(a.position_ego_m, b.position_ego_m) and a.stamp_ns == b.stamp_ns


def test_the_raw_box_has_ground_in_it_and_the_other_has_not() -> None:
    scan, hit = street()
    raw, clear = answer(StaticProjection(), scan, seen()), answer(StaticProjectionGround(), scan, seen())
    assert (hit[raw.objects[1].points] == -1).any()
    assert not (hit[clear.objects[1].points] == -1).any()
    assert set(clear.objects[1].points) < set(raw.objects[1].points)


def precision(output: FusionOutput, hit: np.ndarray, track_id: int, block: int) -> float:
    (found,) = (o for o in output.objects if o.track_id == track_id)
    return float(np.mean(hit[found.points] == block))


def test_without_errors_the_six_steps_find_both_objects() -> None:
    scan, hit = street()
    output = answer(Probabilistic(), scan, seen())
    assert precision(output, hit, 1, 0) > 0.95 and precision(output, hit, 2, 1) > 0.95
    person, car = output.objects
    np.testing.assert_allclose(person.position_ego_m[:2], [7.85, 1.0], atol=0.3)
    assert 9.5 < car.distance_m < 12.5
    assert 0.0 < person.confidence <= 0.9


def test_boxes_shifted_by_their_own_width_cost_the_baseline_the_person_but_not_the_six_steps() -> None:
    scan, hit = street()
    x0, _, x1, _ = box_of(PERSON)
    shifted = seen(0.8 * (x1 - x0))
    assert precision(answer(StaticProjectionGround(), scan, shifted), hit, 1, 0) < 0.6
    wide = replace(ProbabilisticConfig(), aoi=replace(ProbabilisticConfig().aoi, widen=2.0))
    assert precision(answer(Probabilistic(wide), scan, shifted), hit, 1, 0) > 0.9


def test_the_literal_argmax_of_kl_takes_the_least_similar_candidate() -> None:
    scan, _ = street()
    shifted, shapes = seen(30.0), load_benchmark_shapes()
    config = ProbabilisticConfig()
    literal = replace(config, shape=ShapeConfig(literal_kl=True))
    several = 0
    for sane, odd in zip(
        explain_scan(scan, (shifted,), CALIBRATION, CATEGORIES, config, shapes),
        explain_scan(scan, (shifted,), CALIBRATION, CATEGORIES, literal, shapes),
        strict=True,
    ):
        assert sane.chosen is not None and odd.chosen is not None
        scores = [c.similarity for c in sane.candidates]
        assert scores[sane.chosen] == max(scores) and scores[odd.chosen] == min(scores)
        several += len(scores) > 1
    assert several > 0


def test_an_explanation_holds_what_the_pipeline_answers() -> None:
    scan, _ = street()
    pipeline = Probabilistic()
    output = answer(pipeline, scan, seen())
    explained = explain_scan(scan, (seen(),), CALIBRATION, CATEGORIES, pipeline.config, pipeline.shapes)
    for found, aoi in zip(output.objects, explained, strict=True):
        assert aoi.chosen is not None
        chosen = aoi.candidates[aoi.chosen]
        assert np.array_equal(found.points, chosen.points)
        assert set(chosen.points) <= set(aoi.points)
        assert aoi.histogram.counts.sum() == len(aoi.points) == len(aoi.distance_m)
        assert 0.0 < aoi.similarity_before(chosen) <= 1.0
        assert chosen.descriptor.sum() == pytest.approx(1.0) == chosen.descriptor_before.sum()
        assert found.confidence == pytest.approx(aoi.detection.confidence * chosen.similarity)


def test_a_scan_is_answered_once_by_the_message_that_settles_it() -> None:
    scan, _ = street()
    pipeline = StaticProjection()
    pipeline.reset(CALIBRATION, CATEGORIES)
    assert pipeline.update(scan) is None  # its camera has not been heard
    output = pipeline.update(seen())
    assert output is not None and output.scan_seq == scan.seq and len(output.objects) == 2
    assert pipeline.update(scan) is None  # the same scan again


def test_a_category_without_an_entry_uses_half_its_mean_length() -> None:
    config = ProbabilisticConfig()
    assert config.of("board", CATEGORIES).granularity_m == 0.5
    assert config.of("bus", {"bus": CategorySize(mean_m=(12.0, 2.5, 3.0), spread=0.1)}).granularity_m == 6.0
    with pytest.raises(ValueError, match="'boat' has no size; known: board, car"):
        config.of("boat", CATEGORIES)


def test_the_papers_preset_differs_only_where_the_print_does() -> None:
    ours, paper = asdict(ProbabilisticConfig()), asdict(ProbabilisticConfig.paper())
    differing = {
        f"{step}.{key}"
        for step in ("ground", "clustering", "smoother")
        for key in ours[step]
        if ours[step][key] != paper[step][key]
    }
    assert differing == {
        "ground.literal_acceptance",
        "ground.max_trials",
        "ground.refits",
        "ground.scored_points",
        "clustering.trimmed",
        "smoother.robust_scale",
        "smoother.floor_m",
    }
    same = ("aoi", "categories", "shape", "localize")
    assert all(ours[step] == paper[step] for step in same)


@pytest.mark.parametrize("factory", OURS, ids=lambda f: f.__name__)
def test_every_step_is_timed_once_per_scan(factory: Callable[[], StaticProjection]) -> None:
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


def test_a_sensor_without_calibration_and_an_update_before_reset_are_refused() -> None:
    pipeline = StaticProjection()
    with pytest.raises(RuntimeError, match="before reset"):
        pipeline.update(seen())
    pipeline.reset(CALIBRATION, CATEGORIES)
    with pytest.raises(ValueError, match="camera 'rear' has no calibration; known: front"):
        pipeline.update(replace(seen(), sensor="rear"))
    with pytest.raises(ValueError, match="LiDAR 'roof' has no calibration"):
        pipeline.update(lidar_scan(sensor="roof"))


def test_trajectories_follow_the_moving_objects_of_a_run() -> None:
    calibration, categories, messages = synthetic_run()
    pipeline = Probabilistic()
    pipeline.reset(calibration, categories)
    for message in messages:
        pipeline.update(message)
    tracks: dict[int, Trajectory] = {t.track_id: t for t in pipeline.trajectories()}
    assert set(tracks) == {1, 2}
    car = tracks[1]
    travelled = (car.position_ego_m[-1] - car.position_ego_m[0])[:2]
    seconds = (car.stamp_ns[-1] - car.stamp_ns[0]) / 1e9
    np.testing.assert_allclose(travelled / seconds, [-3.0, 0.0], atol=0.6)
