"""Mapping scores: hand-computed rows and laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.messages import LidarScan
from simbench.score.frames import frames_of
from simbench.score.identity import best, identify, owners
from simbench.score.mapping import PairScore, mapping_estimates, most_within, window_m
from simbench.score.score import score

MS = 1_000_000


def pair(**changes):
    """10 mapped points: 6 in the window, 8 of the target; 20 true points, 8 of them found."""
    values = dict(
        frame=0,
        scan_sensor="lidar",
        scan_seq=0,
        scan_stamp_ns=0,
        camera="front",
        track_id=7,
        visible_fraction=1.0,
        surface_distance_m=10.0,
        n_mapped=10,
        n_window=6,
        n_window_centre=2,
        n_window_gnss=1,
        n_window_any=7,
        n_correct=8,
        n_true=20,
        n_found=8,
        hit=True,
    )
    return PairScore(**{**values, **changes})


EMPTY = pair(
    track_id=None,
    n_mapped=0,
    n_window=0,
    n_window_centre=0,
    n_window_gnss=None,
    n_window_any=0,
    n_correct=0,
    n_true=10,
    n_found=0,
    hit=False,
)
LARGE = pair(n_mapped=90, n_window=81, n_correct=45, n_true=50, n_found=45)


def value(pairs, metric):
    return mapping_estimates(pairs, [], True)[metric].value


def test_the_mean_weighs_pairs_alike_and_pooling_weighs_points_alike():
    pairs = [pair(), LARGE]
    assert value(pairs, "tpr") == pytest.approx((0.6 + 0.9) / 2)
    assert value(pairs, "tpr.pooled") == pytest.approx(87 / 100)
    assert value(pairs, "precision") == pytest.approx((0.8 + 0.5) / 2)
    assert value(pairs, "precision.pooled") == pytest.approx(53 / 100)
    assert value(pairs, "recall") == pytest.approx((0.4 + 0.9) / 2)
    assert value(pairs, "recall.pooled") == pytest.approx(53 / 70)


def test_a_pair_without_points_counts_zero_unless_left_out_by_name():
    pairs = [pair(), EMPTY]
    assert value(pairs, "tpr") == pytest.approx(0.3)
    assert value(pairs, "tpr.nonempty") == pytest.approx(0.6)
    assert value(pairs, "tpr.pooled") == pytest.approx(0.6)
    assert value(pairs, "precision") == pytest.approx(0.4)
    assert value(pairs, "recall") == pytest.approx(0.2)


def test_a_pair_before_the_first_fix_is_left_out_of_the_gnss_variant_only():
    estimates = mapping_estimates([pair(), replace(LARGE, n_window_gnss=None)], [], True)
    assert estimates["tpr.gnss"].value == pytest.approx(0.1)
    assert estimates["tpr.gnss"].n == 1
    assert estimates["tpr.centre"].n == 2


def test_spread_is_the_standard_deviation_over_pairs_with_n_minus_one():
    tpr = mapping_estimates([pair(), LARGE], [], True)["tpr"]
    assert tpr.sd == pytest.approx(np.std([0.6, 0.9], ddof=1))
    assert mapping_estimates([pair()], [], True)["tpr"].sd is None


@pytest.mark.parametrize(("missed", "points"), [(4, 1.0), (5, 0.0)])
def test_coverage_counts_pairs_that_miss_fewer_than_five_points(missed, points):
    assert value([pair(n_true=30, n_found=30 - missed)], "coverage@5points") == points


@pytest.mark.parametrize(("missed", "share"), [(19, 1.0), (20, 0.0)])
def test_coverage_counts_pairs_that_miss_fewer_than_twenty_percent(missed, share):
    assert value([pair(n_true=100, n_found=100 - missed)], "coverage@20percent") == share


def test_an_empty_selection_never_covers_the_smallest_eligible_pair():
    assert value([pair(n_true=5, n_found=0)], "coverage@5points") == 0.0


def test_hit_rate_given_tpr_looks_only_at_pairs_above_one_half():
    pairs = [pair(), pair(n_window=5, hit=False), pair(n_window=6, hit=False)]
    estimates = mapping_estimates(pairs, [], True)
    assert estimates["hit_rate"].value == pytest.approx(1 / 3)
    assert (estimates["hit_rate.given_tpr"].value, estimates["hit_rate.given_tpr"].n) == (0.5, 2)


def test_without_pairs_every_target_metric_is_null_and_says_why():
    for name, estimate in mapping_estimates([], [[]], True).items():
        if name != "false_objects_per_frame":
            assert estimate.value is None and estimate.why, name


@given(st.lists(st.floats(0, 30), max_size=30), st.floats(0.1, 5))
def test_no_distance_has_more_points_around_it_than_the_one_with_most(distances, width_m):
    """By trying every interval that begins at a point; and no reference gives more."""
    distance_m = np.array(distances)
    most = most_within(distance_m, width_m)
    assert most == max(
        (int(((distance_m >= d) & (distance_m <= d + width_m)).sum()) for d in distance_m), default=0
    )
    for reference_m in np.linspace(0, 30, 13):
        assert np.count_nonzero(np.abs(distance_m - reference_m) <= 0.49999 * width_m) <= most


@pytest.mark.parametrize(("category", "half"), [((4.5, 1.8, 1.5), 0.675), ((0.6, 1.5, 1.7), 0.225)])
def test_window_is_fifteen_percent_of_the_longest_horizontal_side(kit, category, half):
    assert window_m(kit.World(frames=1, category_m=category).record()) == pytest.approx(half)


@pytest.mark.parametrize(("shift_m", "tpr"), [(0.22, 1.0), (-0.22, 1.0), (0.235, 0.0), (-0.235, 0.0)])
def test_points_within_fifteen_percent_of_the_surface_count_and_beyond_do_not(kit, shift_m, tpr):
    """All target points at one planar distance, then shifted along the ray by `shift_m`: rider window 0.225
    m.
    """
    recording = kit.World(frames=6, poses=kit.Poses(velocity_mps=(0.0, 0.0))).record()
    messages, scans = [], []
    for message in recording.messages:
        if isinstance(message, LidarScan):
            true = recording.truth.scans[message.seq]
            xyz = message.xyz_m.astype(float)
            planar = np.hypot(xyz[:, 0], xyz[:, 1])
            on_circle = xyz * (19.0 / planar)[:, None]
            moved = xyz * ((19.0 + shift_m) / planar)[:, None]
            scans.append(replace(true, true_range_m=np.linalg.norm(on_circle, axis=1)))
            message = replace(message, xyz_m=moved.astype(np.float32))
        messages.append(message)
    recording = replace(
        recording,
        messages=tuple(messages),
        truth=replace(recording.truth, scans=tuple(scans)),
    )
    assert score(recording, *kit.Answer().run(recording))["tpr"].value == tpr


def test_centre_and_gnss_variants_move_only_the_reference(kit):
    """A window of +-0.8 m reaches the centre, 0.75 m behind the face, but not the GNSS antenna 1.2 m
    beyond.
    """
    recording = kit.World(category_m=(5.4, 1, 1), poses=kit.Poses(velocity_mps=(0.0, 0.0))).record()
    scores = score(recording, *kit.Answer().run(recording))
    assert [scores[m].value for m in ("tpr", "tpr.centre", "tpr.gnss")] == [1.0, 1.0, 0.0]
    narrow = kit.World().record()  # +-0.225 m does not reach the centre
    assert score(narrow, *kit.Answer().run(narrow))["tpr.centre"].value == 0.0


def test_the_representative_hits_within_the_box_grown_by_twenty_centimetres(kit):
    def rows(noise):
        recording = kit.World(frames=6).record()
        messages = tuple(
            replace(m, xyz_m=(m.xyz_m + np.array([noise, 0, 0])).astype(np.float32))
            if isinstance(m, LidarScan)
            else m
            for m in recording.messages
        )
        moved = replace(recording, messages=messages)
        return score(moved, *kit.Answer().run(moved))["hit_rate"].value

    assert [rows(-0.19), rows(-0.21), rows(1.69), rows(1.71)] == [1.0, 0.0, 1.0, 0.0]


def test_points_of_the_target_outside_the_image_are_precise_but_not_asked_for(kit):
    recording = kit.World(frames=1, poses=kit.Poses(start_m=(8.0, -5.95), velocity_mps=(0.0, 30.0))).record()
    scores = score(recording, *kit.Answer().run(recording))
    assert scores.pairs[0].n_true < 30 == scores.pairs[0].n_correct
    assert (scores["precision"].value, scores["recall"].value) == (1.0, 1.0)


# -- who is who -----------------------------------------------------------------------------------------


def test_a_false_box_and_an_unknown_id_are_false_objects_and_a_parked_car_is_not(kit):
    recording = kit.World(false_box=True).record()
    answers = [kit.Answer(track_id=t) for t in (7, 9, 99, 12345)]
    scores = score(recording, *kit.together(recording, *answers))
    assert scores["false_objects_per_frame"].value == 2.0
    assert scores["false_objects_per_frame"].n == 20
    assert scores["precision"].value == 1.0


def test_an_object_of_a_track_that_the_paired_image_does_not_show_is_false(kit):
    recording = kit.World(missed=frozenset({3})).record()
    scores = score(recording, *kit.Answer().run(recording))
    assert scores["false_objects_per_frame"].value == pytest.approx(1 / 20)
    assert scores["recall"].value == pytest.approx(19 / 20)
    assert scores.pairs[3].track_id is None


def test_an_object_of_an_unknown_camera_is_false(kit, recording):
    scores = score(recording, *kit.Answer(sensor="no-such-camera").run(recording))
    assert scores["false_objects_per_frame"].value == 1.0


def test_the_most_confident_object_counts_then_the_one_nearest_to_the_image_centre(kit):
    recording = kit.World(frames=1).record()
    frame = frames_of(recording)[0]

    def chosen(low, high):
        outputs, _ = kit.together(
            recording,
            kit.Answer(track_id=9, confidence=low),  # its box is 230 px left of the image centre
            kit.Answer(track_id=7, confidence=high),  # its box is nearer
        )
        return best(identify(frame, outputs[0]), recording).found.track_id

    assert [chosen(0.5, 0.4), chosen(0.4, 0.5), chosen(0.5, 0.5)] == [9, 7, 7]


def test_each_camera_is_a_pair_of_its_own(kit):
    recording = kit.World(cameras=("front", "left")).record()
    scores = score(recording, *kit.Answer(sensor="left").run(recording))
    assert scores["recall"].n == 40
    assert scores["recall"].value == 0.5
    assert scores["coverage.raw"].n == 20


def test_a_track_belongs_to_the_object_of_most_of_its_boxes(recording):
    images = [
        replace(image, detection_object_id=(image.detection_object_id[0], -1 if k < 9 else 0))
        for k, image in enumerate(recording.truth.images)
    ]
    few = replace(recording, truth=replace(recording.truth, images=tuple(images)))
    assert owners(few)[7] == 0
    images[9:12] = [replace(i, detection_object_id=(1, -1)) for i in images[9:12]]
    most = replace(recording, truth=replace(recording.truth, images=tuple(images)))
    assert owners(most)[7] == -1


# -- laws -----------------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_counts_agree_with_a_loop_over_single_points(kit, seed):
    """Independent oracle: one point at a time, from the definitions."""
    rng = np.random.default_rng(seed)
    recording = kit.World(frames=2, noise_m=0.2, category_m=(1.5, 0.6, 1.7)).record()
    chosen = {k: np.sort(rng.choice(65, size=rng.integers(1, 65), replace=False)) for k in (0, 1)}
    answer = kit.Answer(points=lambda scan, true: chosen[scan.seq])
    scores = score(recording, *answer.run(recording))
    for k, got in enumerate(scores.pairs):
        scan = next(m for m in recording.messages if isinstance(m, LidarScan) and m.seq == k)
        true = recording.truth.scans[k]
        mapped = set(chosen[k].tolist())
        target = {i for i in range(65) if true.object_id[i] == 0}
        near = 0
        ranges = []
        for i in target:
            v = scan.xyz_m[i].astype(float)
            v = v / np.linalg.norm(v) * true.true_range_m[i]
            ranges.append(float(np.hypot(v[0], v[1])))
        for i in mapped:
            distance = float(np.hypot(float(scan.xyz_m[i][0]), float(scan.xyz_m[i][1])))
            near += abs(distance - float(np.median(ranges))) <= 0.225
        assert got.n_mapped == len(mapped)
        assert got.n_correct == len(mapped & target)
        assert got.n_found == len(mapped & target)
        assert got.n_window == near
        assert 0.0 <= got.tpr <= 1.0 and 0.0 <= got.precision <= 1.0 and 0.0 <= got.recall <= 1.0
