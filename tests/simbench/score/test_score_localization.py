"""Localization scores: hand-computed rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusion.messages import Trajectory
from simbench.score.score import score

MS = 1_000_000


def run(kit, recording, *answers):
    return score(recording, *kit.together(recording, *answers))


def track(recording, stamps_ms, offset=(0.0, 0.0, 0.0), track_id=7):
    stamps = np.array(stamps_ms, dtype=np.int64) * MS
    return Trajectory(
        track_id=track_id,
        stamp_ns=stamps,
        position_ego_m=recording.truth.target_centre_ego_m(stamps) + np.array(offset),
        inlier=np.ones(len(stamps), dtype=bool),
    )


def test_a_constant_offset_is_the_error_on_each_axis(kit, recording):
    scores = run(kit, recording, kit.Answer(offset_m=(0.4, -0.3, 5.0)))
    for stage in ("raw", "smooth"):
        assert scores[f"mae_longitudinal_m.{stage}"].value == pytest.approx(0.4)
        assert scores[f"mae_lateral_m.{stage}"].value == pytest.approx(0.3)
        assert scores[f"mae_m.{stage}"].value == pytest.approx(0.35)
        assert scores[f"planar_m.{stage}"].value == pytest.approx(0.5)
        assert scores[f"mae_m.{stage}"].n == 20


def test_errors_of_opposite_sign_do_not_cancel(kit, recording):
    outputs, _ = kit.Answer(offset_m=(0.4, 0.0, 0.0)).run(recording)
    others, _ = kit.Answer(offset_m=(-0.4, 0.0, 0.0)).run(recording)
    scores = score(recording, outputs[:10] + others[10:], ())
    assert scores["mae_longitudinal_m.raw"].value == pytest.approx(0.4)


def test_the_gnss_variant_is_the_error_against_the_fix_that_holds(kit, recording):
    """Sweep 0's stamp 50 ms: fix of 0 ms (available from 20 ms). Lever 1.2, heading 0.01 y, noise 0.02, lag
    5.2 x 0.05.
    """
    scores = run(kit, recording, kit.Answer())
    lag, heading = -5.2 * 0.05, 0.01 * -3.0
    error = scores.frames[0].raw.error_m(".gnss")
    assert error[0] == pytest.approx(lag - 1.2 - heading - 0.02)
    assert error[1] == pytest.approx(-0.1 - 0.02 * 20.0 + 0.01)


def test_without_gnss_its_rows_are_null_and_the_others_are_not(kit):
    recording = kit.World(gnss=False).record()
    scores = run(kit, recording, kit.Answer())
    assert scores["mae_m.raw.gnss"].value is None and scores["mae_m.raw.gnss"].why
    assert scores["tpr.gnss"].value is None
    assert scores["mae_m.raw"].value == pytest.approx(0.0, abs=1e-9)
    assert scores.budget is None


@pytest.mark.parametrize(("frames", "known"), [(5, True), (4, False)])
def test_five_frames_make_an_error_and_four_make_a_null_with_a_reason(kit, recording, frames, known):
    scores = run(kit, recording, kit.Answer(frames=frozenset(range(frames))))
    row = scores["mae_m.raw"]
    assert (row.value is not None) is known
    assert (row.why is None) is known
    assert row.n == frames
    assert scores["coverage.raw"].value == pytest.approx(frames / 20)


def test_only_eligible_frames_count(kit):
    recording = kit.World(visible_fraction=0.1).record()
    scores = run(kit, recording, kit.Answer())
    assert scores["coverage.raw"].value is None
    assert scores["gross_rate.smooth"].value is None
    assert scores.frames == ()


def test_the_most_confident_camera_gives_the_raw_position(kit):
    recording = kit.World(cameras=("front", "left")).record()
    scores = run(
        kit,
        recording,
        kit.Answer(sensor="front", offset_m=(1.0, 0.0, 0.0), confidence=0.4),
        kit.Answer(sensor="left", offset_m=(0.25, 0.0, 0.0), confidence=0.6),
    )
    assert scores["mae_longitudinal_m.raw"].value == pytest.approx(0.25)
    assert scores["mae_longitudinal_m.raw"].n == 20


def test_a_trajectory_counts_for_the_sweep_that_holds_its_stamp(recording):
    """Stamps 0, 99, 200 and 399 ms lie in sweeps 0, 0, 2 and 3: three frames of twenty."""
    scores = score(recording, (), (track(recording, [0, 99, 200, 399]),))
    assert [f.frame for f in scores.frames if f.smooth] == [0, 2, 3]
    assert scores["coverage.smooth"].value == pytest.approx(3 / 20)


def test_of_several_samples_in_a_sweep_the_nearest_to_the_hit_counts_and_of_equals_the_earlier(recording):
    scores = score(recording, (), (track(recording, [10, 45, 70, 140, 160]),))
    assert scores.frames[0].smooth.stamp_ns == 45 * MS
    assert scores.frames[0].instant_ns == 50 * MS
    assert scores.frames[1].smooth.stamp_ns == 140 * MS


def test_a_trajectory_is_never_extrapolated_past_its_stamps(recording):
    scores = score(recording, (), (track(recording, range(50, 1050, 100)),))
    assert scores["coverage.smooth"].value == 0.5
    assert scores["gross_rate.smooth"].value == 0.5
    assert scores["mae_m.smooth"].value == pytest.approx(0.0, abs=1e-9)


def test_the_trajectory_of_another_object_is_not_the_targets(recording):
    scores = score(recording, (), (track(recording, range(50, 2050, 100), track_id=9),))
    assert scores["coverage.smooth"].value == 0.0


@pytest.mark.parametrize(("offset", "gross"), [(0.99, 0.0), (1.01, 1.0)])
def test_more_than_a_metre_is_gross(recording, offset, gross):
    scores = score(recording, (), (track(recording, range(50, 2050, 100), (0.6 * offset, 0.8 * offset, 0)),))
    assert scores["gross_rate.smooth"].value == gross


def test_lateral_clearance_is_read_where_the_target_is_closest(kit, recording):
    """The target comes nearer all the time: the last frame counts, off by 0.2 m; the others by 0.5 m."""
    stamps = list(range(50, 2050, 100))
    exact = track(recording, stamps)
    off = exact.position_ego_m.copy()
    off[:, 1] += 0.5
    off[-1, 1] -= 0.7
    scores = score(recording, (), (replace(exact, position_ego_m=off),))
    assert scores["lateral_clearance_error_m"].value == pytest.approx(0.2)


def test_lateral_clearance_is_null_when_the_closest_frame_has_no_position(recording):
    scores = score(recording, (), (track(recording, range(50, 1950, 100)),))
    assert scores["lateral_clearance_error_m"].value is None
    assert "closest" in scores["lateral_clearance_error_m"].why


def test_a_gap_too_long_by_one_metre_is_a_fifth_of_a_second_late(recording):
    scores = score(recording, (), (track(recording, range(50, 2050, 100), (1.04, 0, 0)),))
    assert scores["ttc_error_s"].value == pytest.approx(1.04 / 5.2)
    assert scores["ttc_error_s"].n == 20


def test_a_target_farther_than_ten_seconds_does_not_count_as_closing_yet(kit):
    """From 52 m at 5 m/s it is 10 s away after 0.4 s: the hits at 450, 550, ... 1950 ms count."""
    recording = kit.World(poses=kit.Poses(start_m=(52.0, -3.0), velocity_mps=(-5.0, 0.0))).record()
    assert run(kit, recording, kit.Answer())["ttc_error_s"].n == 16


def test_time_to_collision_is_null_where_nothing_closes(kit):
    recording = kit.World(poses=kit.Poses(velocity_mps=(5.2, 0.0))).record()
    scores = run(kit, recording, kit.Answer())
    assert scores["ttc_error_s"].value is None
    assert scores["mae_m.smooth"].value == pytest.approx(0.0, abs=1e-9)


def test_an_estimate_that_does_not_close_is_as_wrong_as_the_horizon_allows(kit):
    recording = kit.World(poses=kit.Poses(start_m=(20.0, -3.0), velocity_mps=(-5.0, 0.0))).record()
    stamps = np.arange(50, 2050, 100, dtype=np.int64) * MS
    still = Trajectory(
        track_id=7,
        stamp_ns=stamps,
        position_ego_m=np.tile([20.0, -3.0, 0.85], (20, 1)),
        inlier=np.ones(20, dtype=bool),
    )
    true_ttc = (20.0 - 5.0 * stamps * 1e-9) / 5.0
    assert score(recording, (), (still,))["ttc_error_s"].value == pytest.approx(np.mean(10.0 - true_ttc))


def test_time_to_first_valid_waits_for_a_representative_on_the_target(kit, recording):
    wall, _ = kit.Answer(points=lambda scan, true: np.flatnonzero(true.object_id == -1)).run(recording)
    right, _ = kit.Answer().run(recording)
    assert score(recording, right, ())["time_to_first_valid_s"].value == 0.0
    assert score(recording, wall[:7] + right[7:], ())["time_to_first_valid_s"].value == pytest.approx(0.7)
    assert score(recording, wall, ())["time_to_first_valid_s"].value is None


def test_true_centre_travels_with_the_turned_ego_frame(recording):
    scores = score(recording, (), ())
    assert scores.frames[0].true_centre_ego_m == pytest.approx((20 - 5.2 * 0.05, -3.0, 0.85))
