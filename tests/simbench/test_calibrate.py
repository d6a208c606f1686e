"""A rig calibrated on data that the bench makes: found, not exactly; the board is where it is held; files."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fusion.calibrate_board import Board
from fusion.geometry import Transform, rotation_exp
from scenarios.errors import BadInput
from scenarios.load import load_scenario
from scenarios.seeding import stream
from simbench.calibration import check, find
from simbench.calibration.file import read_calibration, told, write_calibration
from simbench.calibration.find import found_for
from simbench.calibration.held import hold, sweep_over
from simbench.calibration.lot import Lot, make_lot
from simbench.calibration.picture import take_still
from simbench.calibration.study import Settings, Study, calibrate_rig, sight_of
from simbench.calibration.text import lines
from simbench.calibration.volume import (
    STANDING_DEG,
    Volume,
    Wanted,
    draw_poses,
    parse_volume,
    to_calibrate,
)
from simbench.case import Job
from simbench.cli import main
from simbench.run import run_job
from simbench.stage import as_told, record, stage

BOARD = Board()
CAR, WORN = "car-six-cameras", "wearable-back"


@lru_cache(maxsize=4)
def lot_of(rig: str) -> Lot:
    return make_lot(rig, 0)


@lru_cache(maxsize=8)
def study(rig: str, camera: str, seed: int = 0) -> Study:
    """A quick one."""
    return calibrate_rig(Settings(rig=rig, cameras=(camera,), poses=6, seed=seed))


@pytest.fixture(autouse=True)
def few_boards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check, "BOARDS", 3)


@pytest.mark.parametrize(("rig", "camera"), [(CAR, "cam-front-left"), (WORN, "cam-centre")])
def test_the_calibration_found_is_near_the_truth_and_not_the_truth(rig: str, camera: str) -> None:
    (pair,) = study(rig, camera).pairs
    assert len(pair.measured.used) >= 5
    assert 0.01 < pair.measured.intrinsics.rms_px < 0.2
    assert 1e-4 < abs(pair.focal) < 0.03
    assert 0.5 < pair.extrinsics.rms_px < 5.0  # a click is good to 1 px, 10 mm at 5 m are 1 px
    assert 0.01 < pair.rotation_deg < 1.5
    assert 0.001 < pair.translation_m < 0.1
    zone = next(part for part in pair.parts if part.calibrated)
    assert len(zone.boards) == 3
    for score in zone.boards:
        assert 0.0 < score.residual_px < 5.0
        assert score.on_board == pytest.approx(score.on_board_true, abs=0.1)
        assert score.tpr == pytest.approx(score.tpr_true, abs=0.1)


def test_the_same_seed_finds_the_same_and_another_something_else() -> None:
    again = calibrate_rig(Settings(rig=WORN, cameras=("cam-centre",), poses=6))
    other = study(WORN, "cam-centre", seed=1)
    first = study(WORN, "cam-centre")
    T, T_again, T_other = (s.pairs[0].extrinsics.T_camera_lidar for s in (first, again, other))
    assert T.translation_m.tobytes() == T_again.translation_m.tobytes()
    assert T.rotation.tobytes() == T_again.rotation.tobytes()
    assert first.pairs[0].parts == again.pairs[0].parts
    assert not np.allclose(T.translation_m, T_other.translation_m, atol=1e-5)


def test_a_steady_hand_finds_a_better_extrinsic() -> None:
    steady = Settings(rig=WORN, cameras=("cam-centre",), poses=6, click_noise_px=0.0, corner_noise_m=0.0)
    shaky = replace(steady, click_noise_px=3.0, corner_noise_m=0.04)
    (fine,), (rough,) = calibrate_rig(steady).pairs, calibrate_rig(shaky).pairs
    assert fine.measured.intrinsics.rms_px == rough.measured.intrinsics.rms_px  # no hand in it
    assert fine.extrinsics.rms_px < 0.4 * rough.extrinsics.rms_px
    assert fine.parts[0].boards[0].residual_px < rough.parts[0].boards[0].residual_px


# -- the board -----------------------------------------------------------------------------------------------


def facing(lot: Lot, camera: str, range_m: float) -> Transform:
    """T_world_board of a board squarely before a camera."""
    view = lot.T_world_sensor(camera)
    return Transform(rotation=view.rotation, translation_m=view.apply(np.array([0.0, 0.0, range_m])))


def test_the_lidar_measures_the_board_where_it_is_held() -> None:
    lot = lot_of(CAR)
    pose = facing(lot, "cam-front", 5.0)
    sweep = sweep_over(lot, hold(lot, BOARD, pose), "test")
    on = pose.inverse().apply(lot.T_world_sensor("lidar").apply(sweep.xyz_m[sweep.on_board].astype(float)))
    assert 400 < len(on) < 900
    assert abs(np.median(on[:, 2])) < 0.01
    assert np.abs(on[:, 0]).max() == pytest.approx(0.6, abs=0.04)
    assert np.abs(on[:, 1]).max() == pytest.approx(0.45, abs=0.06)


def test_the_picture_shows_the_squares_where_they_are() -> None:
    lot, name = lot_of(CAR), "cam-front"
    pose, sight = facing(lot, name, 4.0), sight_of(lot, name)
    in_camera = sight.T_world_camera.inverse() @ pose
    outline = sight.camera.project(in_camera.apply(BOARD.outer_m))
    held = hold(lot, BOARD, pose)
    grey = take_still(held, name, lot.rig.cameras[name], sight.camera, outline, None)
    column, row = np.meshgrid(np.arange(BOARD.columns), np.arange(BOARD.rows))
    x = (column.ravel() + 0.5 - 0.5 * BOARD.columns) * BOARD.square_m
    y = (row.ravel() + 0.5 - 0.5 * BOARD.rows) * BOARD.square_m
    middle = sight.camera.project(in_camera.apply(np.column_stack([x, y, np.zeros(x.size)]))).astype(int)
    shown = grey[middle[:, 1], middle[:, 0]].reshape(BOARD.black.shape)
    assert shown[BOARD.black].max() + 50 < shown[~BOARD.black].min()


def test_poses_fill_the_volume_and_stay_in_it() -> None:
    lot, volume = lot_of(CAR), Volume(near_m=3.0, far_m=5.0, radius=0.5)
    sight = sight_of(lot, "cam-front-left")
    found = draw_poses(sight, BOARD, to_calibrate(volume), 12, stream(0, "test"))
    assert len(found) == 12
    ranges = [np.linalg.norm(p.translation_m - sight.T_world_camera.translation_m) for p in found]
    assert min(ranges) < 3.4 and max(ranges) > 4.6
    for pose, range_m in zip(found, ranges, strict=True):
        corners = pose.apply(BOARD.outer_m)
        uv = sight.camera.project(sight.T_world_camera.inverse().apply(corners))
        assert 3.0 <= range_m <= 5.0
        assert sight.radius(uv).max() <= 0.5
        assert corners[:, 2].min() > 0.0
        assert corners[0, 2] > corners[3, 2]  # upright


def test_poses_beyond_the_radius_have_their_centre_there() -> None:
    sight = sight_of(lot_of(CAR), "cam-front-left")
    wanted = Wanted(
        near_m=6.0, far_m=12.0, radius=0.6, inside=False, whole=False, standing=True, tilt_deg=STANDING_DEG
    )
    for pose in draw_poses(sight, BOARD, wanted, 8, stream(0, "test")):
        centre = sight.T_world_camera.inverse().apply(pose.translation_m[None])
        assert sight.radius(sight.camera.project(centre))[0] > 0.6
        np.testing.assert_allclose(pose.rotation[:, 1], [0.0, 0.0, -1.0], atol=1e-9)  # it stands upright


# -- scores --------------------------------------------------------------------------------------------------


def test_the_truth_scores_as_the_truth_and_a_turned_camera_loses_what_it_turns_away() -> None:
    """A board of 1.2 m, 5 m ahead: 3 degrees to the side are 0.26 m, 22 % of it."""
    lot, name = lot_of(CAR), "cam-front"
    pose, sight = facing(lot, name, 5.0), sight_of(lot, name)
    sweep = sweep_over(lot, hold(lot, BOARD, pose), "test")
    true = check.Mapping(T_camera_lidar=sight.T_camera_lidar, camera=sight.camera)
    exact = check.score(sweep, sight, BOARD, pose, true, true)
    assert exact is not None
    assert exact.residual_px == 0.0
    assert exact.tpr == exact.tpr_true
    assert exact.on_board == exact.on_board_true > 0.93
    turn = Transform(rotation=rotation_exp(np.deg2rad([0.0, 3.0, 0.0])), translation_m=np.zeros(3))
    turned = check.score(
        sweep, sight, BOARD, pose, replace(true, T_camera_lidar=turn @ true.T_camera_lidar), true
    )
    assert turned is not None
    assert turned.residual_px == pytest.approx(np.tan(np.deg2rad(3.0)) * sight.camera.fx_px, rel=0.02)
    assert turned.on_board == pytest.approx(exact.on_board - 0.22, abs=0.03)
    assert turned.tpr < exact.tpr


# -- files, and runs with them --------------------------------------------------------------------------


def test_a_file_gives_back_what_was_found(tmp_path: Path) -> None:
    found, path = study(CAR, "cam-front-left"), tmp_path / "found.yaml"
    write_calibration(found, path)
    again = read_calibration(path, lot_of(CAR).rig)
    for name, pose in found.calibration.T_ego_sensor.items():
        assert again.T_ego_sensor[name].rotation.tobytes() == pose.rotation.tobytes(), name
        assert again.T_ego_sensor[name].translation_m.tobytes() == pose.translation_m.tobytes(), name
    assert again.cameras == found.calibration.cameras
    true = lot_of(CAR).rig.calibration
    assert again.cameras["cam-back"] == true.cameras["cam-back"]  # which was not looked for
    assert again.cameras["cam-front-left"] != true.cameras["cam-front-left"]


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("rig: car-six-cameras", "rig: wearable-back", "was found for rig 'wearable-back'"),
        ("  cam-front-left:", "  cam-front-lef:", "unknown camera 'cam-front-lef'.*did you mean"),
        ("width_px: 960", "width_px: 640", "pictures of 640x600, this run's are 960x600"),
        ("fx_px:", "fx:", "unknown key 'fx'"),
        ("- [", "- [9", "not orthonormal|must be|list"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_in_one_sentence(
    tmp_path: Path, old: str, new: str, why: str
) -> None:
    path = tmp_path / "found.yaml"
    write_calibration(study(CAR, "cam-front-left"), path)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(BadInput, match=why) as caught:
        read_calibration(path, lot_of(CAR).rig)
    assert "\n" not in str(caught.value)


def test_a_fault_of_the_calibration_acts_on_the_found_one_too() -> None:
    true, found = lot_of(CAR).rig.calibration, study(CAR, "cam-front-left").calibration
    turn = Transform(rotation=rotation_exp(np.array([0.0, 0.1, 0.0])), translation_m=np.zeros(3))
    faulty = replace(true, T_ego_sensor={n: T @ turn for n, T in true.T_ego_sensor.items()})
    name = "cam-front-left"
    both = told(faulty, true, found).T_ego_sensor[name]
    np.testing.assert_allclose(both.rotation, (found.T_ego_sensor[name] @ turn).rotation, atol=1e-12)
    untouched = told(true, true, found).T_ego_sensor[name]
    np.testing.assert_allclose(untouched.rotation, found.T_ego_sensor[name].rotation, atol=1e-12)


def test_a_run_tells_its_pipelines_the_found_calibration_and_scores_by_the_true_one(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    write_calibration(study(CAR, "cam-front-left"), path)
    job = Job(
        scenario="static-board", system="car", seed=0, pipelines=("static_projection",),
        calibration=f"found:{path}", found_in=str(path),
    )  # fmt: skip
    staged = stage(job)
    recording = record(job, staged).recording
    given = as_told(job, staged, recording)
    assert given.calibration.cameras["cam-front-left"] != recording.calibration.cameras["cam-front-left"]
    assert given.truth is recording.truth
    assert given.messages is recording.messages
    assert as_told(replace(job, found_in=None), staged, recording) is recording
    assert {case.status for case in run_job(job).cases} == {"ok"}


def test_found_is_found_where_the_run_writes_and_a_file_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    family = load_scenario("static-board")
    assert found_for("true", tmp_path, family, "car", None) is None
    asked: list[Settings] = []

    def quick(settings: Settings) -> Study:
        asked.append(settings)
        return study(CAR, "cam-front-left")

    monkeypatch.setattr(find, "calibrate_rig", quick)
    path = found_for("found", tmp_path / "out", family, "car", None)
    assert path == str(tmp_path / "out" / "calibration-car-six-cameras.yaml")
    assert asked == [Settings(rig=CAR)]
    assert found_for(f"found:{path}", tmp_path, family, "car", None) == path
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / f"{CAR}.yaml").write_bytes(Path(path).read_bytes())
    kept = found_for(f"found:{tmp_path / 'kept'}", tmp_path, family, "car", None)
    assert kept == str(tmp_path / "kept" / f"{CAR}.yaml")
    with pytest.raises(BadInput, match="pictures of 960x600, this run's are 480x300"):
        found_for(f"found:{path}", tmp_path, family, "car", (480, 300))


# -- the command ------------------------------------------------------------------------------------------


def test_the_command_prints_both_tables_and_writes_the_file(tmp_path: Path) -> None:
    out = tmp_path / "new" / "found.yaml"
    words = ["calibrate", WORN, "--cameras", "cam-centre", "--poses", "4", "--out", str(out)]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert "calibrated zone" in done.output
    assert "cam-centre" in done.output
    assert out.is_file()


def test_the_table_says_the_mean_over_pairs() -> None:
    text = "\n".join(lines(study(CAR, "cam-front-left")))
    row, mean = (
        next(line for line in text.splitlines() if line.startswith(word))
        for word in ("cam-front-left", "mean")
    )
    assert row.split()[-4:] == mean.split()[-4:]  # of one pair it is that pair's


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["car-six-camera"], "did you mean 'car-six-cameras'"),
        ([CAR, "--poses", "2"], "2 poses are too few"),
        ([CAR, "--volume", "6,3"], "empty or out of range"),
        ([CAR, "--volume", "3,6,0"], "not a share"),
        ([CAR, "--volume", "near"], "not a calibration volume"),
        ([CAR, "--volume", "2,3,0.1", "--cameras", "cam-front"], "does not fit into the volume"),
        ([CAR, "--cameras", "cam-fron"], "did you mean 'cam-front'"),
        ([CAR, "--click-noise-px", "-1"], "no spread"),
        ([CAR, "--corner-noise-mm", "nan"], "no spread"),
        ([WORN, "--size", "64x64", "--poses", "3", "--cameras", "cam-left"], "found in none of 3 pictures"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(words: list[str], why: str) -> None:
    done = CliRunner().invoke(main, ["calibrate", *words])
    assert done.exit_code == 2, done.output
    said = [line for line in done.output.splitlines() if line.startswith("simbench: ")]
    assert len(said) == 1
    assert why in said[0]


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["static-board", "--calibration", "maybe"], "'maybe' is unknown"),
        (["static-board", "--calibration", "found:/no/such.yaml", "--system", "car"], "no such file"),
        (["kitti:/no/such", "--calibration", "found"], "is for simulated drives"),
    ],
)
def test_a_calibration_that_a_run_cannot_use_is_bad_input(words: list[str], why: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(main, ["run", *words, "--out", str(tmp_path / "out")])
    assert done.exit_code == 2, done.output
    assert why in done.output


def test_a_volume_is_near_far_and_perhaps_a_radius() -> None:
    assert parse_volume("2,4") == Volume(near_m=2.0, far_m=4.0, radius=0.6)
    assert parse_volume("2.5,4,0.3") == Volume(near_m=2.5, far_m=4.0, radius=0.3)
