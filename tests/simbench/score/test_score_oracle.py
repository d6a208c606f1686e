"""The oracle knows the labels and nothing else."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

import simbench.score
from simbench.score.oracle import oracle_labels, oracle_track, score_oracle
from simbench.score.score import score


def test_the_oracle_maps_every_true_point_and_no_other(kit):
    scores = score_oracle(kit.World(noise_m=0.02, poses=kit.Poses(shake_rad=0.02)).record())
    for metric in ("precision", "recall", "hit_rate", "coverage.raw"):
        assert scores[metric].value == 1.0, metric
    assert scores["coverage.smooth"].value >= 0.9  # the smoother may throw away the first or last sample
    assert scores["false_objects_per_frame"].value == 0.0


def test_the_oracle_keeps_the_surface_bias_that_the_same_later_steps_leave(recording):
    scores = score_oracle(recording)
    assert scores["mae_longitudinal_m.raw"].value == pytest.approx(0.75, abs=0.01)
    assert scores["mae_longitudinal_m.smooth"].value == pytest.approx(0.75, abs=0.01)


def test_the_oracle_is_not_held_back_by_missed_detections(kit):
    recording = kit.World(missed=frozenset(range(0, 20, 2))).record()
    assert score_oracle(recording)["recall"].value == 1.0
    assert score(recording, *kit.Answer().run(recording))["recall"].value == 0.5


def test_the_oracle_sees_the_calibration_that_a_pipeline_is_told(kit):
    told = score_oracle(kit.World(told_yaw_rad=0.02).record())
    right = score_oracle(kit.World().record())
    for a, b in zip(told.frames, right.frames, strict=True):
        aside = a.raw.error_m()[1] - b.raw.error_m()[1]
        assert aside == pytest.approx(0.02 * (a.true_centre_ego_m[0] - 0.75), rel=0.02)


def test_without_its_own_key_the_oracles_track_is_a_false_object(recording):
    outputs, trajectories = oracle_labels(recording)
    assert oracle_track(recording) < 0
    scores = score(recording, outputs, trajectories)
    assert scores["false_objects_per_frame"].value == 1.0
    assert scores["recall"].value == 0.0


def test_without_a_target_the_oracle_says_nothing(kit):
    recording = kit.World(has_target=False).record()
    outputs, trajectories = oracle_labels(recording)
    assert trajectories == () and all(o.objects == () for o in outputs)
    assert score_oracle(recording)["recall"].value is None


def test_the_oracle_answers_the_same_twice(recording):
    a, b = oracle_labels(recording), oracle_labels(recording)
    assert score_oracle(recording).rows == score_oracle(recording).rows
    assert np.array_equal(a[1][0].position_ego_m, b[1][0].position_ego_m)


def test_scores_import_no_pipeline_and_the_contract_imports_no_truth():
    folder = Path(simbench.score.__file__).parent
    for file in folder.glob("*.py"):
        imported = set()
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom):
                imported.add(node.module or "")
            elif isinstance(node, ast.Import):
                imported.update(alias.name for alias in node.names)
        assert not any(name.startswith("fusion.pipelines") for name in imported), file.name
        if file.name in ("contract.py", "metrics.py", "statistics.py"):
            assert not any(name.startswith(("simbench.truth", "simbench.recording")) for name in imported)
