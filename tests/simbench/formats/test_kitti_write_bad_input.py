"""What cannot be written as KITTI or PCD is said in one sentence, before anything is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from fusion.messages import Calibration, CameraImage, Detections, LidarScan
from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet
from simbench.formats.kitti import open_kitti
from simbench.formats.kitti_write import write_kitti
from simbench.formats.pcd import write_pcd_folder
from simbench.formats.recorded import Player
from simbench.recording import Recording
from tests.simbench.formats import mini_kitti as mini


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    root = mini.write_tracking(tmp_path_factory.mktemp("kitti"), mini.drive(2))
    return Player(open_kitti(f"kitti:{root}").drive(0), FaultSet()).play().recording


def sentence(make: Callable[[], int]) -> str:
    with pytest.raises(BadInput) as caught:
        make()
    text = str(caught.value)
    assert "\n" not in text and text.endswith((".", "?"))
    return text


def without(recording: Recording, *kinds: type) -> Recording:
    return replace(recording, messages=tuple(m for m in recording.messages if not isinstance(m, kinds)))


def test_no_sweep(small: Recording, tmp_path: Path) -> None:
    empty = without(small, LidarScan)
    for make in (write_kitti, write_pcd_folder):
        assert sentence(lambda make=make: make(empty, tmp_path / "new")) == (
            "the recording has no sweep of a LiDAR."
        )
    assert not (tmp_path / "new").exists()


def test_no_camera(small: Recording, tmp_path: Path) -> None:
    blind = replace(small, calibration=Calibration(T_ego_sensor=small.calibration.T_ego_sensor, cameras={}))
    assert "no camera" in sentence(lambda: write_kitti(blind, tmp_path / "new"))
    assert not (tmp_path / "new").exists()


def test_no_image_near_a_sweep(small: Recording, tmp_path: Path) -> None:
    dark = without(small, Detections, CameraImage)
    assert "no sweep of the recording has an image of 'cam-2'" in sentence(
        lambda: write_kitti(dark, tmp_path / "new")
    )


def test_a_misspelt_camera(small: Recording, tmp_path: Path) -> None:
    text = sentence(lambda: write_kitti(small, tmp_path / "new", camera="cam_3"))
    assert text == "unknown camera 'cam_3' (allowed: cam-2); did you mean 'cam-2'?"


def test_two_lidars(small: Recording, tmp_path: Path) -> None:
    (scan, *_) = (m for m in small.messages if isinstance(m, LidarScan))
    two = replace(small, messages=(*small.messages, replace(scan, sensor="lidar-b")))
    assert "2 LiDARs (lidar, lidar-b); KITTI has one" in sentence(lambda: write_kitti(two, tmp_path / "new"))


def test_a_folder_with_something_in_it_stays_as_it_is(small: Recording, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    for make in (write_kitti, write_pcd_folder):
        text = sentence(lambda make=make: make(small, tmp_path))
        assert "there is something in it already (allowed: an empty folder)" in text
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_file_where_the_folder_should_be(small: Recording, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for make in (write_kitti, write_pcd_folder):
        assert "cannot write to" in sentence(lambda make=make: make(small, tmp_path / "file"))


@pytest.mark.parametrize("name", ["../out", "/abs", "a/b", "", ".hidden", "truth", "a\nb"])
def test_a_lidar_whose_name_is_no_folders_name(small: Recording, tmp_path: Path, name: str) -> None:
    messages = tuple(replace(m, sensor=name) if isinstance(m, LidarScan) else m for m in small.messages)
    truth = replace(small.truth, scans=tuple(replace(t, sensor=name) for t in small.truth.scans))
    odd = replace(small, messages=messages, truth=truth)
    assert "cannot be the name" in sentence(lambda: write_pcd_folder(odd, tmp_path / "new"))
    assert list(tmp_path.iterdir()) == []
