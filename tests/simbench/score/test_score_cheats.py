"""Ways to cheat that must show in the scores (the list is in ../shared/scoring.md)."""

from __future__ import annotations

import numpy as np
import pytest

from simbench.score.contract import ContractError
from simbench.score.metrics import METRICS
from simbench.score.score import score


def test_truth_handed_over_is_perfect(kit, recording):
    scores = score(recording, *kit.Answer().run(recording))
    for metric in ("tpr", "precision", "recall", "precision.pooled", "recall.pooled", "hit_rate"):
        assert scores[metric].value == 1.0, metric
    for metric in METRICS:
        row = scores[metric.name]
        against_gnss = metric.name.endswith(".gnss") or metric.name.startswith("budget_")
        if metric.unit in ("m", "s") and not against_gnss:
            assert row.value == pytest.approx(0.0, abs=1e-9), metric.name
    assert scores["gross_rate.smooth"].value == 0.0


@pytest.mark.parametrize("silent", ["no output", "empty outputs"])
def test_nothing_returned_scores_zero_and_does_not_crash(kit, recording, silent):
    outputs = () if silent == "no output" else kit.Answer(frames=frozenset()).run(recording)[0]
    scores = score(recording, outputs, ())
    for metric in ("tpr", "precision", "recall", "recall.pooled", "hit_rate", "coverage.raw"):
        assert scores[metric].value == 0.0, metric
    assert scores["gross_rate.smooth"].value == 1.0
    assert scores["coverage@5points"].value == 0.0
    assert scores["false_objects_per_frame"].value == 0.0
    for row in scores.rows:
        assert (row.value is None) == (row.why is not None), row.metric
    assert scores["mae_m.smooth"].value is None


def test_one_point_per_object_has_a_tpr_near_one_but_hardly_any_recall(kit, recording):
    scores = score(recording, *kit.Answer(points=lambda s, t: kit.target_points(s, t)[15:16]).run(recording))
    assert scores["tpr"].value > 0.99
    assert scores["recall"].value == pytest.approx(1 / 30)
    assert scores["coverage@5points"].value == 0.0


def test_one_frame_only_shows_in_coverage_and_gets_no_error(kit, recording):
    scores = score(recording, *kit.Answer(frames=frozenset({19})).run(recording))
    assert scores["coverage.raw"].value == scores["coverage.smooth"].value == pytest.approx(0.05)
    assert scores["gross_rate.smooth"].value == pytest.approx(0.95)
    for metric in ("mae_m.raw", "mae_m.smooth", "lateral_clearance_error_m", "ttc_error_s"):
        assert scores[metric].value is None and scores[metric].why, metric


@pytest.mark.parametrize("sign", [1, -1])
def test_truth_shifted_by_100_ms_moves_only_the_longitudinal_error_by_52_cm(kit, recording, sign):
    scores = score(recording, *kit.Answer(shift_ns=sign * 100_000_000).run(recording))
    for stage in ("raw", "smooth"):
        assert scores[f"mae_longitudinal_m.{stage}"].value == pytest.approx(0.52, abs=0.05)
        assert scores[f"mae_lateral_m.{stage}"].value < 0.05


def test_at_rest_a_100_ms_offset_changes_no_row(kit):
    """Both of the answer and of the camera's exposure."""
    still = kit.Poses(velocity_mps=(0.0, 0.0))
    rows = []
    for shift, late in [(0, 10), (100, 10), (0, 40)]:
        recording = kit.World(poses=still, image_after_ns=late * 1_000_000).record()
        rows.append(score(recording, *kit.Answer(shift_ns=shift * 1_000_000).run(recording)).rows)
    assert rows[0] == rows[1] == rows[2]


def test_permuted_labels_bring_precision_down_to_the_class_share(kit):
    recording = kit.World(
        frames=100, poses=kit.Poses(start_m=(30.0, -3.0), velocity_mps=(-0.5, 0.0))
    ).record()
    rng = np.random.default_rng(1)

    def permuted(scan, true):
        return np.flatnonzero(rng.permutation(true.object_id) == 0)

    scores = score(recording, *kit.Answer(points=permuted).run(recording))
    assert scores["precision"].n == 100
    assert scores["precision"].value == pytest.approx(30 / 65, abs=0.03)


def test_all_points_are_recalled_but_not_precise(kit, recording):
    scores = score(recording, *kit.Answer(points=lambda s, t: np.arange(65)).run(recording))
    assert scores["recall"].value == 1.0
    assert scores["precision"].value == pytest.approx(30 / 65)


def test_many_guesses_for_one_target_do_not_get_the_best_of_them(kit):
    recording = kit.World(cameras=("front", "left")).record()
    sure_and_wrong = kit.Answer(sensor="front", offset_m=(3.0, 0, 0), confidence=0.9)
    right = kit.Answer(sensor="left", confidence=0.1)
    scores = score(recording, *kit.together(recording, sure_and_wrong, right))
    assert scores["mae_longitudinal_m.raw"].value == pytest.approx(3.0)


def test_a_second_output_for_a_scan_is_a_contract_error(kit, recording):
    outputs, tracks = kit.Answer().run(recording)
    with pytest.raises(ContractError, match="second output"):
        score(recording, (*outputs, outputs[0]), tracks)


def test_an_output_for_a_scan_that_never_came_is_a_contract_error(kit, recording):
    short = kit.World(frames=19).record()
    with pytest.raises(ContractError, match="never delivered"):
        score(short, *kit.Answer().run(recording))


def test_same_input_gives_the_same_rows_and_the_order_of_outputs_does_not_matter(kit, recording):
    outputs, tracks = kit.Answer(offset_m=(0.1, 0.2, 0.0)).run(recording)
    first = score(recording, outputs, tracks)
    assert first.rows == score(recording, outputs, tracks).rows
    assert first.rows == score(recording, outputs[::-1], tracks[::-1]).rows


def test_without_a_target_only_false_objects_are_counted(kit):
    recording = kit.World(has_target=False, false_box=True).record()
    scores = score(recording, *kit.Answer(track_id=99).run(kit.World(false_box=True).record()))
    assert scores["false_objects_per_frame"].value == 1.0
    for row in scores.rows:
        if row.metric != "false_objects_per_frame":
            assert row.value is None and row.why == "the scenario has no target", row.metric


def test_every_metric_has_one_row_in_the_order_of_the_specification(kit, recording):
    scores = score(recording, *kit.Answer().run(recording))
    assert [r.metric for r in scores.rows] == [m.name for m in METRICS]
    assert len({m.name for m in METRICS}) == len(METRICS)
    for metric in METRICS:
        assert metric.definition.endswith(".") and metric.unit and metric.better in ("higher", "lower")
