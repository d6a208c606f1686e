"""Laws of whole pipelines, on a small analytic street."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest

from fusion.check import synthetic_run
from fusion.messages import (
    CategorySize,
    FusionOutput,
    Trajectory,
)
from fusion.pipelines.probabilistic import (
    Probabilistic,
    ProbabilisticConfig,
    explain_scan,
)
from fusion.pipelines.static_projection import StaticProjection, StaticProjectionGround
from fusion.shape import ShapeConfig, load_benchmark_shapes
from tests.fusion.street import CALIBRATION, CATEGORIES, PERSON, answer, box_of, seen, street


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
    literal = replace(config, shape=ShapeConfig(pick="least_similar"))
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


@pytest.mark.parametrize("factory", [StaticProjection, StaticProjectionGround, Probabilistic])
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
