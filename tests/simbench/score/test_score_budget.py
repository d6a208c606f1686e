"""The error budget adds up, and each part reads its own cause."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.localize import LocalizeConfig, localize
from fusion.messages import Detection, FusionOutput, LidarScan
from simbench.score.budget import PARTS
from simbench.score.score import score


def localized(recording, choose):
    """What a pipeline without truth would say: the told calibration on the median of the chosen points."""
    outputs = []
    for scan in (m for m in recording.messages if isinstance(m, LidarScan)):
        found = localize(
            scan,
            choose(scan, recording.truth.scans[scan.seq]),
            detection=Detection(track_id=7, category="rider", box_px=(0, 0, 1, 1), confidence=1.0),
            camera="front",
            T_ego_lidar=recording.calibration.T_ego_sensor["lidar"],
            confidence=0.5,
            config=LocalizeConfig(),
        )
        outputs.append(FusionOutput(scan_sensor="lidar", scan_seq=scan.seq, objects=(found,)))
    return score(recording, outputs, ()).budget


@settings(max_examples=10, deadline=None)
@given(
    shake=st.floats(0, 0.1),
    noise=st.floats(0, 0.2),
    yaw=st.floats(-0.2, 0.2),
    shift_ms=st.integers(-100, 100),
    offset=st.floats(-3, 3),
)
def test_the_parts_add_up_to_the_total(kit, shake, noise, yaw, shift_ms, offset):
    recording = kit.World(
        frames=6, poses=kit.Poses(shake_rad=shake), noise_m=noise, told_yaw_rad=yaw
    ).record()
    answer = kit.Answer(shift_ns=shift_ms * 1_000_000, offset_m=(offset, -offset, 0.1))
    budget = score(recording, *answer.run(recording)).budget
    assert tuple(budget.parts_m) == PARTS
    assert budget.frames == tuple(range(6))
    assert np.allclose(sum(budget.parts_m.values()), budget.total_m, rtol=0, atol=1e-9)


def test_the_total_is_the_raw_position_against_the_held_reference(kit, recording):
    scores = score(recording, *kit.Answer().run(recording))
    for row, frame in enumerate(scores.frames):
        assert scores.budget.total_m[row] == pytest.approx(frame.raw.error_m(".gnss"))


def test_with_the_right_points_and_no_errors_only_the_reference_and_the_surface_remain(kit, recording):
    budget = localized(recording, kit.target_points)
    assert budget.mean_m("surface_to_centre")[0] == pytest.approx(-0.75, abs=1e-6)
    assert budget.mean_m("lever_arm") == pytest.approx([-1.2, -0.1, 0.0])
    assert budget.mean_m("reference_noise") == pytest.approx([-0.02, 0.01, -0.03])
    for part in ("wrong_cluster", "sensor_attitude", "rest"):
        assert np.abs(budget.parts_m[part]).max() < 1e-5, part  # f32 points


def test_reference_lag_is_speed_times_the_age_of_the_fix(kit, recording):
    """Fixes every 200 ms: the hits at 50, 150, 250, ... ms are 50, 150, 50, ... ms younger than their fix."""
    lag = score(recording, *kit.Answer().run(recording)).budget.parts_m["reference_lag"]
    assert lag[:4, 0] == pytest.approx(-5.2 * np.array([0.05, 0.15, 0.05, 0.15]))
    assert np.abs(lag[:, 1]).max() < 1e-12


def test_a_turned_calibration_is_attitude_and_nothing_else(kit):
    recording = kit.World(told_yaw_rad=0.01).record()
    budget = localized(recording, kit.target_points)
    # 0.01 rad x the target's longitudinal distance of the surface moves it to the left.
    distance = np.array([f.true_centre_ego_m[0] for f in score(recording, (), ()).frames]) - 0.75
    assert budget.parts_m["sensor_attitude"][:, 1] == pytest.approx(0.01 * distance, rel=0.02)
    for part in ("wrong_cluster", "rest"):
        assert np.abs(budget.parts_m[part]).max() < 1e-5, part
    plain = localized(kit.World().record(), kit.target_points)
    assert budget.parts_m["surface_to_centre"] == pytest.approx(plain.parts_m["surface_to_centre"], abs=1e-6)


def test_a_shaking_sensor_is_attitude_and_not_surface(kit):
    calm = localized(kit.World().record(), kit.target_points)
    shaken = localized(kit.World(poses=kit.Poses(shake_rad=0.03)).record(), kit.target_points)
    assert np.abs(calm.parts_m["sensor_attitude"]).max() < 1e-9
    assert np.abs(shaken.parts_m["sensor_attitude"][:, 2]).max() > 0.3
    # Tilted, another of the face's points may be at the middle rank: the surface part stays on the face.
    assert shaken.parts_m["surface_to_centre"][:, 0] == pytest.approx(-0.75, abs=1e-6)


def test_points_of_the_parked_car_are_the_wrong_cluster(kit, recording):
    budget = localized(recording, lambda scan, true: np.flatnonzero(true.object_id == 1))
    # The car's rear: 12.75 m ahead, 3.2-4.8 m to the left; the rider's face at 50 ms: 18.99 ahead, 3 right.
    assert budget.parts_m["wrong_cluster"][0, 0] == pytest.approx(12.75 - 18.99, abs=0.02)
    assert budget.parts_m["wrong_cluster"][0, 1] == pytest.approx(7.0, abs=1.0)
    assert np.abs(budget.parts_m["rest"][:, 0]).max() == pytest.approx(5.2 * 0.02, abs=0.02)


def test_range_noise_is_rest(kit):
    budget = localized(kit.World(noise_m=0.1).record(), kit.target_points)
    assert 0.02 < np.abs(budget.parts_m["rest"][:, 0]).mean() < 0.2


def test_frames_before_the_first_fix_have_no_budget(kit, recording):
    from dataclasses import replace

    late = replace(
        recording.truth.reference, available_ns=recording.truth.reference.available_ns + 500_000_000
    )
    moved = replace(recording, truth=replace(recording.truth, reference=late))
    budget = score(moved, *kit.Answer().run(moved)).budget
    assert budget.frames[0] == 5
    nothing = score(recording, (), ()).budget
    assert nothing.frames == () and np.isnan(nothing.mean_m("total")).all()
