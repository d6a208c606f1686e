"""A ROS 2 bag that we wrote comes back bit by bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fusion.messages import CameraImage, LidarScan
from simbench.formats.ros2.bag import write_bag, write_ros2
from simbench.formats.ros2.read import import_ros2, read_ros2
from simbench.formats.ros2.topics import default_map
from tests.simbench.formats.ros2_drives import drive, shifted
from tests.simbench.support import digest


@pytest.mark.parametrize("by_ns", [0, -3_000_000_001, 1_400_000_000_123_456_789])
def test_what_we_wrote_comes_back_bit_by_bit(tmp_path: Path, by_ns: int) -> None:
    recording = shifted(drive(), by_ns)
    if by_ns > 10**18:
        recording = replace(recording, truth=replace(recording.truth, scans=(), reference=None))
    write_bag(recording, tmp_path / "bag")
    found = import_ros2(tmp_path / "bag", default_map(tmp_path / "bag" / "bag.mcap"))
    assert digest(found.log.messages) == digest(recording.messages)
    assert digest(found.log.categories) == digest(recording.categories)
    assert found.notes == ()
    told, sent = found.log.calibration, recording.calibration
    assert set(told.T_ego_sensor) == set(sent.T_ego_sensor) and set(told.cameras) == set(sent.cameras)
    for name, T in sent.T_ego_sensor.items():
        assert told.T_ego_sensor[name].rotation == pytest.approx(T.rotation, abs=1e-12)
        assert told.T_ego_sensor[name].translation_m == pytest.approx(T.translation_m, abs=1e-12)
    for name, camera in sent.cameras.items():
        assert told.cameras[name].matrix == pytest.approx(camera.matrix, abs=1e-12)
        assert replace(told.cameras[name], cx_px=0, cy_px=0) == replace(camera, cx_px=0, cy_px=0)


def test_late_twice_told_and_reordered_messages_come_back_too(tmp_path: Path) -> None:
    """As transport faults deliver them: stamps that do not rise, numbers that repeat or are missing."""
    messages = list(drive().messages)
    rng = np.random.default_rng(1)
    kept = [m for m in messages if rng.random() > 0.1]
    kept += [replace(m, arrival_ns=m.arrival_ns + 70_000_000) for m in kept if rng.random() < 0.2]
    kept.sort(key=lambda m: m.arrival_ns)
    recording = replace(drive(), messages=tuple(kept))
    write_ros2(recording, tmp_path / "a.mcap")
    found = read_ros2(tmp_path / "a.mcap", default_map(tmp_path / "a.mcap"))
    assert digest(found.messages) == digest(recording.messages)


def test_a_point_without_a_ring_and_boxes_alone_come_back(tmp_path: Path) -> None:
    messages = tuple(
        replace(m, ring=np.full(len(m.ring), -1, dtype=np.int16)) if isinstance(m, LidarScan) else m
        for m in drive().messages
        if not isinstance(m, CameraImage)
    )
    recording = replace(drive(), messages=messages)
    write_ros2(recording, tmp_path / "a.mcap")
    found = read_ros2(tmp_path / "a.mcap", default_map(tmp_path / "a.mcap"))
    assert digest(found.messages) == digest(recording.messages)


def test_the_same_recording_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_ros2(drive(), tmp_path / f"{name}.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
