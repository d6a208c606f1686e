"""Faults in recorded data: each acts where it says, and its receipt finds it, or that it did not act."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.camera import project_points
from fusion.messages import Calibration, Detections, LidarScan
from scenarios.fault_set import FaultSet
from scenarios.faults.lidar import BeamLoss
from scenarios.recorded import ON_RECORDINGS, parse_recorded_faults
from simbench.faults.points_lost import lost_rings
from simbench.formats import recorded as made
from simbench.formats.inject import DrawnOnRecording, draw_on_recording, moved_box
from simbench.formats.kitti import open_kitti
from simbench.formats.proof import layers
from simbench.formats.recorded import Player, Recorded
from simbench.formats.rings import rings_of
from tests.simbench.formats import mini_kitti as mini

FRAMES = 7


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return mini.write_tracking(tmp_path_factory.mktemp("kitti"), mini.drive(FRAMES))


def play(root: Path, *words: str, **options: object) -> Recorded:
    faults = parse_recorded_faults(words)
    return Player(open_kitti(f"kitti:{root}").drive(0), faults, **options).play()  # type: ignore[arg-type]


def scans(found: Recorded) -> list[LidarScan]:
    return [m for m in found.recording.messages if isinstance(m, LidarScan)]


def boxes(found: Recorded) -> dict[int, tuple[tuple[float, float, float, float], ...]]:
    messages = (m for m in found.recording.messages if isinstance(m, Detections))
    return {m.seq: tuple(d.box_px for d in m.boxes) for m in messages}


# -- what each one does -----------------------------------------------------------------------------------


def test_a_shifted_calibration_moves_every_point_and_nothing_else(sequence: Path) -> None:
    clean, found = play(sequence), play(sequence, "calibration.shift_px={right_px: 8, down_px: -3}")
    points = np.random.default_rng(2).uniform((5, -3, -1), (30, 3, 1), (50, 3))
    moved = []
    for one in (clean, found):
        told = one.recording.calibration
        moved.append(project_points(points, told.T_camera_lidar("cam-2", "lidar"), told.cameras["cam-2"]))
    np.testing.assert_allclose(moved[1] - moved[0], np.tile([8.0, -3.0], (50, 1)), atol=1e-9)
    assert boxes(clean) == boxes(found)
    assert found.recording.truth.calibration.cameras == clean.recording.truth.calibration.cameras


def test_a_turned_calibration_is_told_and_the_truth_stays(sequence: Path) -> None:
    found = play(sequence, "calibration.rotation_deg={angle_deg: 2, axis: yaw}")
    told, true = found.recording.calibration, found.recording.truth.calibration
    turn = true.T_ego_sensor["cam-2"].rotation.T @ told.T_ego_sensor["cam-2"].rotation
    assert np.rad2deg(np.arccos((np.trace(turn) - 1) / 2)) == pytest.approx(2.0)
    np.testing.assert_allclose(np.abs(turn @ [0, 1, 0]), [0, 1, 0], atol=1e-12)  # about the image's vertical


def test_stale_frames_deliver_what_was_seen_before(sequence: Path) -> None:
    clean, found = play(sequence), play(sequence, "timing.stale_frames=2")
    before, late = boxes(clean), boxes(found)
    assert set(late) == set(range(2, FRAMES))  # the first two have nothing before them
    assert all(late[seq] == before[seq - 2] for seq in late)
    truth = found.recording.truth
    assert [(i.seq, i.capture_ns) for i in truth.images] == [
        (seq, (seq - 2) * 100_000_000) for seq in range(2, FRAMES)
    ]
    stamps = {m.seq: m.stamp_ns for m in found.recording.messages if isinstance(m, Detections)}
    assert all(stamps[seq] == seq * 100_000_000 for seq in stamps)  # the stamp knows nothing of it


def test_a_lost_beam_returns_nothing_and_the_others_stay(sequence: Path) -> None:
    clean, found = play(sequence), play(sequence, "lidar.beam_loss=50")
    for whole, rest in zip(scans(clean), scans(found), strict=True):
        kept = np.isin(whole.ring, np.unique(rest.ring))
        np.testing.assert_array_equal(whole.xyz_m[kept], rest.xyz_m)
        np.testing.assert_array_equal(whole.ring[kept], rest.ring)
    lost = set(np.unique(scans(clean)[0].ring)) - set(np.unique(scans(found)[0].ring))
    assert len(lost) == round(0.5 * (scans(clean)[0].ring.max() + 1))
    for scan, labels in zip(scans(found), found.recording.truth.scans, strict=True):
        assert len(scan.xyz_m) == len(labels.object_id)


def test_box_errors_move_the_delivered_boxes_only(sequence: Path) -> None:
    clean, found = play(sequence), play(sequence, "detector.edge_error={sd_fraction: 0.1, tau_s: 0}")
    a, b = boxes(clean), boxes(found)
    relative = []
    for seq in a:
        for true, moved in zip(a[seq], b[seq], strict=True):
            side = np.array([true[2] - true[0], true[3] - true[1]] * 2)
            relative.append((np.array(moved) - np.array(true)) / side)
    assert 0.05 < float(np.std(relative)) < 0.2
    assert found.recording.truth.images[0].boxes == clean.recording.truth.images[0].boxes


# -- laws -------------------------------------------------------------------------------------------------

ZERO = (
    "calibration.shift_px=0",
    "calibration.rotation_deg=0",
    "calibration.translation_cm=0",
    "calibration.focal_percent=0",
    "calibration.click_noise_px=0",
    "calibration.mixup=none",
    "timing.stale_frames=0",
    "lidar.beam_loss=0",
    "detector.edge_error={sd_fraction: 0, bias_fraction: 0}",
)


@pytest.mark.parametrize("word", ZERO)
def test_a_fault_of_zero_strength_is_none(word: str) -> None:
    assert len(parse_recorded_faults([word])) == 0


STRONG = (
    "calibration.shift_px=6",
    "calibration.rotation_deg=1",
    "calibration.translation_cm={shift_cm: 10, sensors: lidar}",
    "calibration.focal_percent=2",
    "calibration.click_noise_px=2",
    "calibration.mixup=inverse",
    "timing.stale_frames=1",
    "lidar.beam_loss=50",
    "detector.edge_error=0.05",
)


def test_every_fault_on_recordings_is_tried_here() -> None:
    assert {word.partition("=")[0] for word in STRONG} == set(ON_RECORDINGS)


@pytest.mark.parametrize("word", STRONG)
def test_a_draw_repeats(sequence: Path, word: str) -> None:
    a, b = play(sequence, word), play(sequence, word)
    for x, y in zip(scans(a), scans(b), strict=True):
        np.testing.assert_array_equal(x.xyz_m, y.xyz_m)
    assert boxes(a) == boxes(b)
    assert a.receipts == b.receipts
    told = [one.recording.calibration.T_ego_sensor["cam-2"].rotation for one in (a, b)]
    np.testing.assert_array_equal(*told)


def test_other_seeds_lose_other_beams() -> None:
    spec = BeamLoss(percent=50)
    assert list(lost_rings(spec, 64, 1)) != list(lost_rings(spec, 64, 2))


@given(
    percent=st.floats(0, 99), rings=st.integers(1, 128), seed=st.integers(0, 50),
    pattern=st.sampled_from(["random", "even"]),
)  # fmt: skip
def test_as_many_rings_are_lost_as_asked_for_and_one_stays(
    percent: float, rings: int, seed: int, pattern: str
) -> None:
    lost = lost_rings(BeamLoss(percent=percent, pattern=pattern), rings, seed)  # type: ignore[arg-type]
    assert len(lost) == min(round(0.01 * percent * rings), rings - 1)
    assert len(set(lost)) == len(lost)
    assert set(lost) <= set(range(rings))
    assert sorted(lost) == list(lost)


def test_even_losses_leave_rings_that_are_spread_evenly() -> None:
    kept = sorted(set(range(64)) - set(lost_rings(BeamLoss(percent=75, pattern="even"), 64, 0)))
    assert kept == list(range(2, 64, 4))


def test_an_even_loss_is_weaker_than_a_stronger_one(sequence: Path) -> None:
    sizes = [len(scans(play(sequence, f"lidar.beam_loss={p}"))[0].xyz_m) for p in (0, 25, 50, 75)]
    assert sizes == sorted(sizes, reverse=True)


def test_a_box_is_cut_at_the_border_and_vanishes_beyond_it() -> None:
    error = np.array([-0.5, 0.0, 0.5, 0.0])
    assert moved_box((10.0, 10.0, 30.0, 20.0), error, 35, 100) == (0.0, 10.0, 35.0, 20.0)
    assert moved_box((10.0, 10.0, 30.0, 20.0), np.array([2.0, 0, 2.0, 0]), 35, 100) is None


# -- rings ------------------------------------------------------------------------------------------------


@given(keep=st.sets(st.integers(0, len(mini.RINGS) - 1), min_size=5))
def test_rings_are_counted_from_above_whichever_returned_anything(keep: set[int]) -> None:
    points, _ = mini.sweep((), rings=[mini.RINGS[i] for i in sorted(keep)])
    seen = [i for i in sorted(keep) if -mini.HEIGHT_M / np.sin(np.deg2rad(min(mini.RINGS[i], -1e-9))) < 80.0]
    ring = rings_of(points[:, :3])
    if len(seen) < 4:
        assert ring is None
    else:
        assert ring is not None
        np.testing.assert_array_equal(np.unique(ring), np.arange(len(seen)))


def test_points_in_any_other_order_have_no_rings() -> None:
    points, _ = mini.sweep(mini.SCENE)
    shuffled = np.random.default_rng(0).permutation(points)[:, :3]
    upside_down = points[::-1, :3]
    assert rings_of(shuffled) is None
    assert rings_of(np.ascontiguousarray(upside_down)) is None
    assert rings_of(points[:0, :3]) is None
    assert rings_of(points[:1, :3]) is None


def test_layers_count_the_beams_that_return() -> None:
    points, _ = mini.sweep((), rings=np.linspace(-5, -20, 10))
    assert layers(points[:, :3]) == pytest.approx(10.0, abs=0.02)


# -- receipts ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve walkers in a row for six frames: enough boxes for a receipt, all on the move."""
    frames = [
        tuple(
            mini.Box(
                track=i, category="pedestrian", size_m=(0.8, 0.6, 1.7), heading_rad=1.57,
                xyz_m=(9.0 + 0.5 * i, -3.0 + 0.45 * i + 0.3 * f, -mini.HEIGHT_M),
            )
            for i in range(12)
        )
        for f in range(6)
    ]  # fmt: skip
    return mini.write_tracking(tmp_path_factory.mktemp("crowd"), frames, oxts=False)


VARIANTS = ("lidar.beam_loss={percent: 50, pattern: even}", "calibration.shift_px={right_px: -4, down_px: 9}")


@pytest.mark.parametrize("word", [*STRONG, *VARIANTS])
def test_a_receipt_finds_what_was_asked_for(crowd: Path, word: str) -> None:
    found = play(crowd, word)
    assert found.receipts
    assert {r.status for r in found.receipts} == {"ok"}, found.receipts


def test_all_faults_together_are_found(crowd: Path) -> None:
    found = play(crowd, *STRONG)
    assert {r.fault for r in found.receipts} == set(ON_RECORDINGS)
    assert {r.status for r in found.receipts} <= {"ok", "unverifiable"}, found.receipts


def told_truth(drawn: DrawnOnRecording, true: Calibration) -> DrawnOnRecording:
    return replace(drawn, told=true)


def half_the_rings(drawn: DrawnOnRecording, true: Calibration) -> DrawnOnRecording:
    return replace(drawn, lost_rings=drawn.lost_rings[::2])


def one_frame_more(drawn: DrawnOnRecording, true: Calibration) -> DrawnOnRecording:
    return replace(drawn, stale_frames=drawn.stale_frames + 1)


def twice_the_errors(drawn: DrawnOnRecording, true: Calibration) -> DrawnOnRecording:
    return replace(drawn, edge_errors={i: 2.0 * e for i, e in drawn.edge_errors.items()})


@pytest.mark.parametrize(
    ("word", "mutant"),
    [
        ("calibration.shift_px=6", told_truth),
        ("calibration.rotation_deg=1", told_truth),
        ("timing.stale_frames=1", one_frame_more),
        ("lidar.beam_loss=50", half_the_rings),
        ("detector.edge_error=0.05", twice_the_errors),
    ],
)
def test_an_injector_that_does_something_else_is_a_mismatch(
    crowd: Path, word: str, mutant: Callable[[DrawnOnRecording, Calibration], DrawnOnRecording]
) -> None:
    def spoiled(faults: FaultSet, true: Calibration, *rest: object, **more: object) -> DrawnOnRecording:
        drawn = draw_on_recording(faults, true, *rest, **more)  # type: ignore[arg-type]
        return mutant(drawn, true)

    with mock.patch.object(made, "draw_on_recording", spoiled):
        found = play(crowd, word)
    assert "mismatch" in {r.status for r in found.receipts}, found.receipts


@pytest.mark.parametrize("word", STRONG)
def test_an_injector_that_does_nothing_is_a_mismatch(crowd: Path, word: str) -> None:
    """What is delivered is clean, what was drawn is not."""
    clean = play(crowd)
    real = made.recorded_receipts

    def of_clean(faults: object, drawn: object, recording: object, *rest: object) -> object:
        return real(faults, drawn, clean.recording, *rest)  # type: ignore[arg-type]

    with mock.patch.object(made, "recorded_receipts", of_clean):
        found = play(crowd, word)
    assert "mismatch" in {r.status for r in found.receipts}, found.receipts


def test_boxes_that_stand_still_cannot_tell_how_old_they_are(tmp_path: Path) -> None:
    root = mini.write_tracking(tmp_path, [mini.SCENE] * 5, oxts=False)
    (receipt,) = play(root, "timing.stale_frames=1").receipts
    assert receipt.status == "unverifiable"
    assert receipt.measured is None
