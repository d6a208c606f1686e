"""IMU and odometry of other stacks."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from fusion.messages import EgoMotion
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.read import import_ros2, read_ros2
from tests.simbench.formats.ros2_foreign import (
    START,
    START_S,
    TREE,
    Written,
    driving,
    imu,
    message,
    odometry,
    stamped,
    write_foreign,
)


def test_a_big_endian_message_is_read(tmp_path: Path) -> None:
    """CDR's own byte order: header, a text of 10 bytes, a gap to a multiple of 8, six numbers."""
    twist = b"\x00\x00\x00\x00" + struct.pack(
        ">iII10s2x6d", START_S, 250_000_000, 10, b"base_link", 3, 0.25, 0, 0, 0, 0
    )
    sent = [TREE, ("/speed", ros.TWIST, START, twist), ("/imu", ros.IMU, START + 1, imu())]
    (motion,) = read_ros2(write_foreign(tmp_path / "bag", sent), driving()).messages
    assert isinstance(motion, EgoMotion) and motion.velocity_mps.tolist() == [3.0, 0.25, 0.0]


def test_an_imu_message_has_the_newest_velocity_before_it(tmp_path: Path) -> None:
    """Messages are taken in order of arrival, wherever they stand in the file."""
    sent: list[Written] = [TREE]
    sent += [("/imu", ros.IMU, START + i * 10**7, imu(START + i * 10**7)) for i in range(5)]
    speeds = ((15_000_000, 3.0), (31_000_000, 4.0))
    sent += [("/odom", ros.ODOMETRY, START + at_ns, odometry(START, v)) for at_ns, v in speeds]
    found = import_ros2(write_foreign(tmp_path / "bag", sent), driving("/odom"))
    motions = [m for m in found.log.messages if isinstance(m, EgoMotion)]
    assert [m.velocity_mps[0] for m in motions] == [3.0, 3.0, 4.0]
    assert [m.seq for m in motions] == [0, 1, 2]
    assert found.notes == ("2 messages of imu came before the first velocity and were left out",)


def test_a_turned_imu_is_told_in_the_egos_axes(tmp_path: Path) -> None:
    """The IMU's x is the ego's y (it is turned by 90 degrees to the left)."""
    speed = message(
        ros.TWIST, header=stamped(START, "base_link"), twist={"linear": {"x": 1.0, "y": 0.0, "z": 0.0}}
    )
    sent = [TREE, ("/speed", ros.TWIST, START, speed), ("/imu", ros.IMU, START + 1, imu(frame="imu_link"))]
    (motion,) = read_ros2(write_foreign(tmp_path / "bag", sent), driving()).messages
    assert isinstance(motion, EgoMotion)
    assert motion.rate_radps == pytest.approx([-2.0, 1.0, 3.0])
    assert motion.specific_force_mps2 == pytest.approx([0.0, 0.5, 9.8])
