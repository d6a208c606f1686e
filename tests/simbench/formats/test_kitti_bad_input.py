"""Folders that nobody vouches for: one sentence with the file and the line, and exit code 2."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet
from simbench.cli import main
from simbench.formats.kitti import open_kitti
from simbench.formats.recorded import Player
from tests.simbench.formats import mini_kitti as mini


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("good")
    mini.write_object(root / "object", {0: mini.SCENE})
    mini.write_tracking(root / "tracking", mini.drive(3))
    mini.write_raw(root / "raw", mini.drive(3))
    return root


def change(path: str, old: str, new: str) -> Callable[[Path], None]:
    def act(root: Path) -> None:
        text = (root / path).read_text(encoding="utf-8")
        assert old in text, (path, old)
        (root / path).write_text(text.replace(old, new, 1), encoding="utf-8")

    return act


def replaced(path: str, data: bytes) -> Callable[[Path], None]:
    return lambda root: (root / path).write_bytes(data) and None


def gone(path: str) -> Callable[[Path], None]:
    def act(root: Path) -> None:
        target = root / path
        shutil.rmtree(target) if target.is_dir() else target.unlink()

    return act


def not_finite(value: float, column: int) -> Callable[[Path], None]:
    def act(root: Path) -> None:
        path = root / "velodyne/000000.bin"
        points = np.fromfile(path, "<f4").reshape(-1, 4)
        points[7, column] = value
        points.tofile(path)

    return act


def appended(path: str, text: str) -> Callable[[Path], None]:
    return lambda root: (root / path).write_text((root / path).read_text() + text) and None


def linked(path: str, to: str) -> Callable[[Path], None]:
    def act(root: Path) -> None:
        (root / path).unlink()
        os.symlink(to, root / path)

    return act


def fifo(path: str) -> Callable[[Path], None]:
    def act(root: Path) -> None:
        (root / path).unlink()
        os.mkfifo(root / path)

    return act


LABEL, CALIB, BIN = "label_2/000000.txt", "calib/000000.txt", "velodyne/000000.bin"
TRACKS, XML = "label_02/0000.txt", f"{mini.DRIVE}/tracklet_labels.xml"
BAD: dict[str, tuple[str, Callable[[Path], None], tuple[str, ...]]] = {
    # what is wrong: layout, how, what the sentence says
    "no sweeps": ("object", gone("velodyne"), ("velodyne", "no frame with sweeps")),
    "no labels": ("object", gone("label_2"), ("label_2", "no labels")),
    "label file missing": ("object", gone(LABEL), (LABEL, "no such file")),
    "calibration missing": ("object", gone(CALIB), (CALIB, "no such file")),
    "image missing": ("object", gone("image_2/000000.png"), ("image_2/000000.png", "no such file")),
    "image that is none": (
        "object",
        replaced("image_2/000000.png", b"no picture"),
        ("000000.png", "PNG or JPEG"),
    ),
    "empty image": ("object", replaced("image_2/000000.png", b""), ("000000.png", "not an image")),
    "size of a sweep": ("object", replaced(BIN, bytes(33)), (BIN, "33 bytes", "multiple of 16")),
    "point that is NaN": ("object", not_finite(float("nan"), 1), (BIN, "point 7 (byte 112)", "not finite")),
    "point that is infinite": ("object", not_finite(float("inf"), 0), (BIN, "point 7", "not finite")),
    "reflectance": ("object", not_finite(17.0, 3), (BIN, "point 7", "reflectance", "17", "0 to 1")),
    "label cut short": ("object", change(LABEL, " 0.00 0 ", " "), (LABEL, "line 1", "15")),
    "word for a number": (
        "object",
        change(LABEL, " 0.00 0 ", " none 0 "),
        (LABEL, "line 1", "truncated", "'none'"),
    ),
    "NaN in a label": ("object", change(LABEL, " 0.00 0 ", " nan 0 "), (LABEL, "line 1", "finite")),
    "number too large": ("object", change(LABEL, " 0.00 0 ", " 1e999 0 "), (LABEL, "line 1", "finite")),
    "truncation": ("object", change(LABEL, " 0.00 0 ", " 1.5 0 "), (LABEL, "line 1", "truncated", "0 to 1")),
    "occlusion": (
        "object",
        change(LABEL, " 0.00 0 ", " 0.00 4 "),
        (LABEL, "line 1", "occluded", "0, 1, 2, 3"),
    ),
    "type": ("object", change(LABEL, "Car", "Carr"), (LABEL, "line 1", "'Carr'", "near 'Car'")),
    "side of a box": (
        "object",
        change(LABEL, "1.500000 1.700000", "-1.5 1.700000"),
        (LABEL, "line 1", "height"),
    ),
    "label that is no text": ("object", replaced(LABEL, b"Car\n\xff\xfe"), (LABEL, "line 2", "UTF-8")),
    "calibration without P2": ("object", change(CALIB, "P2:", "P7:"), (CALIB, "P2")),
    "calibration without the LiDAR": (
        "object",
        change(CALIB, "Tr_velo_to_cam:", "Tr:"),
        (CALIB, "Tr_velo_to_cam"),
    ),
    "calibration cut short": (
        "object",
        change(CALIB, "R0_rect: ", "R0_rect: 1 "),
        (CALIB, "line 5", "10 numbers"),
    ),
    "calibration that is no rotation": (
        "object",
        change(CALIB, "R0_rect: 9.", "R0_rect: 2."),
        (CALIB, "line 5", "not a rotation"),
    ),
    "calibration word": ("object", change(CALIB, "P2: 3.6", "P2: x3.6"), (CALIB, "line 3", "P2", "number")),
    "projection": ("object", change(CALIB, "P2: 3.6", "P2: -3.6"), (CALIB, "line 3", "projection")),
    "link out of the folder": ("object", linked(LABEL, "/etc/hostname"), (LABEL, "leaves the folder")),
    "link to itself": ("object", linked(LABEL, "000000.txt"), (LABEL,)),
    "pipe": ("object", fifo(LABEL), (LABEL, "not a file")),
    "sequence without labels": ("tracking", gone(TRACKS), (TRACKS, "no such file")),
    "track twice": (
        "tracking",
        appended(TRACKS, "0 7 " + mini.label_words(mini.CAR, tracking=True)),
        (TRACKS, "track 7", "twice"),
    ),
    "track that is no number": (
        "tracking",
        change(TRACKS, "0 7 ", "0 7.5 "),
        (TRACKS, "line 2", "track", "whole"),
    ),
    "frame below zero": ("tracking", change(TRACKS, "0 7 ", "-1 7 "), (TRACKS, "line 2", "frame")),
    "image of another size": (
        "tracking",
        lambda root: _shrink(root / "image_02/0000/000001.png"),
        ("000001.png", "310x94", "620x188"),
    ),
    "oxts cut short": ("tracking", change("oxts/0000.txt", "49 ", ""), ("oxts/0000.txt", "line 1", "30")),
    "oxts without a frame": (
        "tracking",
        replaced("oxts/0000.txt", mini.oxts_words(0).encode()),
        ("oxts/0000.txt", "frame 1"),
    ),
    "tracklets that are no XML": ("raw", change(XML, "</tracklets>", ""), (XML, "line", "not XML")),
    "tracklets with an entity": (
        "raw",
        change(XML, "serialization>", 'serialization [<!ENTITY a "b">]>'),
        (XML, "entity"),
    ),
    "tracklet without a size": ("raw", change(XML, "<w>1.7</w>", ""), (XML, "tracklet 0", "<w>")),
    "tracklet of a type unknown": ("raw", change(XML, ">Car<", ">Boat<"), (XML, "tracklet 0", "'Boat'")),
    "pose that is no number": ("raw", change(XML, "<tx>", "<tx>here"), (XML, "tracklet 0, pose 0", "<tx>")),
    "time": (
        "raw",
        change(f"{mini.DRIVE}/velodyne_points/timestamps.txt", "13:02", "13-02"),
        ("timestamps.txt", "line 1", "no time"),
    ),
    "times too few": (
        "raw",
        replaced(f"{mini.DRIVE}/image_02/timestamps.txt", b"2011-09-26 13:02:25.5\n"),
        ("image_02/timestamps.txt", "frame 1"),
    ),
    "times backwards": (
        "raw",
        replaced(f"{mini.DRIVE}/velodyne_points/timestamps.txt", b"2011-09-26 13:02:25.5\n" * 3),
        ("timestamps.txt", "ascend"),
    ),
    "raw calibration": ("raw", gone("calib_velo_to_cam.txt"), ("calib_velo_to_cam.txt", "no such file")),
    "raw without R": ("raw", change("calib_velo_to_cam.txt", "\nR:", "\nQ:"), ("calib_velo_to_cam.txt", "R")),
}


def _shrink(path: Path) -> None:
    import cv2

    picture = cv2.imread(str(path))
    assert picture is not None
    cv2.imwrite(str(path), picture[::2, ::2])


@pytest.mark.parametrize("which", BAD)
def test_what_is_wrong_with_a_folder_is_one_sentence_with_its_place(
    good: Path, tmp_path: Path, which: str
) -> None:
    layout, spoil, parts = BAD[which]
    root = tmp_path / "data"
    shutil.copytree(good / layout, root)
    spoil(root)
    with pytest.raises(BadInput) as caught:
        folder = open_kitti(f"kitti:{root}")
        for number in folder.names:
            Player(folder.drive(number), FaultSet()).play(images=True)
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    for part in parts:
        assert part in text, text


def test_the_good_folders_are_good(good: Path) -> None:
    for layout, number in (("object", 0), ("tracking", 0), ("raw", 5)):
        Player(open_kitti(f"kitti:{good / layout}").drive(number), FaultSet()).play(images=True)


# -- the same through the command line --------------------------------------------------------------------


def run(*words: str) -> Result:
    return CliRunner().invoke(main, ["run", *words, "--images", "none"], prog_name="simbench")


def refused(done: Result, *parts: str) -> None:
    assert done.exit_code == 2, (done.exit_code, done.output, done.exception)
    assert done.stdout == ""
    line = done.stderr.splitlines()[-1]
    assert line.startswith("simbench: ")
    assert "Traceback" not in done.stderr
    for part in parts:
        assert part in line, line


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["kitti:nowhere"], ("nowhere", "no such folder")),
        (["kitti:"], ("path", "empty")),
        (["kitti:{data}"], ("no KITTI layout",)),
        (["kitti:{data}/object/label_2/000000.txt"], ("not a folder",)),
        (["kitti:{data}/object", "--seeds", "3"], ("no frame 3", "allowed: 0")),
        (["kitti:{data}/tracking", "--seeds", "0-2"], ("no sequence 1", "allowed: 0")),
        (["kitti:{data}/tracking", "--frames", "7-9"], ("no frame from 7 to 9",)),
        (["kitti:{data}/object", "--frames", "0-1"], ("--frames", "--seeds")),
        (["kitti:{data}/tracking", "--frames", "3-1"], ("--frames", "'3-1'")),
        (["kitti:{data}/tracking", "--frames", "all"], ("--frames", "'all'")),
        (["kitti:{data}/object", "--system", "wearable"], ("'wearable'", "allowed: car")),
        (["kitti:{data}/object", "--size", "320x200"], ("--size",)),
        (["kitti:{data}/object", "kitti:{data}/tracking"], ("one kitti: folder",)),
        (
            ["kitti:{data}/object", "--faults", "motion.flex_deg=1"],
            ("motion.flex_deg", "does not act on recorded data"),
        ),
        (
            ["kitti:{data}/object", "--faults", "demo"],
            ("motion.vibration_deg", "does not act on recorded data"),
        ),
        (["kitti:{data}/object", "--faults", "lidar.beam_los=5"], ("did you mean 'lidar.beam_loss'?",)),
        (["kitti:{data}/object", "--faults", "timing.stale_frames=1"], ("has 1 frame", "stale_frames")),
        (["kitti:{data}/tracking", "--faults", "timing.stale_frames=3"], ("has 3 frames", "stale_frames")),
        (["kitti:{data}/tracking", "--faults", "timing.stale_frames=0.5"], ("whole number",)),
        (["kitti:{data}/object", "--faults", "lidar.beam_loss=100"], ("percent", "100")),
        (
            ["kitti:{data}/object", "--faults", "calibration.shift_px"],
            ("calibration.shift_px", "needs a value"),
        ),
        (
            ["kitti:{data}/object", "--faults", "calibration.shift_px={{left_px: 3}}"],
            ("unknown key 'left_px'",),
        ),
        (
            ["kitti:{data}/object", "--faults", "calibration.shift_px={{right_px: 3, sensors: [cam-3]}}"],
            ("did you mean 'cam-2'?",),
        ),
        (["kitti:{data}/object", "--boxes", "network"], ("--boxes",)),
        (["overtake-approach", "--frames", "0-3"], ("--frames", "recorded")),
        (["kitti:{data}/object", "--set", "road.width_m=40"], ("--set", "simulated")),
    ],
)
def test_a_bad_word_costs_one_sentence(
    good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], parts: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    refused(run(*(word.format(data=good) for word in words)), *parts)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_one_too_high_is_told_where_the_data_is(good: Path, tmp_path: Path) -> None:
    shutil.copytree(good / "object", tmp_path / "training")
    refused(run(f"kitti:{tmp_path}"), f"did you mean 'kitti:{tmp_path}/training'?")


def test_a_point_that_is_no_number_ends_the_command_whatever_ran_before(good: Path, tmp_path: Path) -> None:
    shutil.copytree(good / "object", tmp_path / "data")
    not_finite(float("nan"), 2)(tmp_path / "data")
    out = tmp_path / "out"
    refused(run(f"kitti:{tmp_path / 'data'}", "--out", str(out), "--jobs", "1"), "000000.bin", "point 7")


def test_sweeps_that_are_not_in_rings_have_no_beam_to_lose(good: Path, tmp_path: Path) -> None:
    shutil.copytree(good / "object", tmp_path / "data")
    path = tmp_path / "data/velodyne/000000.bin"
    points = np.fromfile(path, "<f4").reshape(-1, 4)
    np.random.default_rng(0).permutation(points).tofile(path)
    words = (f"kitti:{tmp_path / 'data'}", "--out", str(tmp_path / "out"), "--jobs", "1", "--alone")
    refused(run(*words, "--faults", "lidar.beam_loss=50"), "lidar.beam_loss", "ring by ring", "000000.bin")
