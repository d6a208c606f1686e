"""What of another stack's bag cannot be is told in one sentence, with topic and message."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.errors import BadInput
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.read import read_ros2
from simbench.formats.ros2.topics import TopicMap
from tests.simbench.formats.ros2_foreign import (
    BARE,
    SENT,
    START,
    TREE,
    Written,
    cloud,
    driving,
    edge,
    imu,
    lidar,
    looking,
    mapped,
    message,
    stamped,
    tf,
    write_bytes,
    write_foreign,
    xyz,
)


def changed(**fields: Any) -> Any:
    return replace(SENT, **fields)


def field(**changes: Any) -> list[Any]:
    fields = list(SENT.fields)
    fields[2] = replace(fields[2], **changes)
    return fields


REFUSED: list[tuple[TopicMap, list[Written], str]] = [
    (mapped(), [TREE, ("/os/points", ros.CLOUD, START, one)], f"/os/points, message 0: .*({says})")
    for one, says in (
        (changed(width=5), "1 x 5 points of 12 bytes do not fit 48 bytes"),
        (changed(height=2**32 - 1, width=2**32 - 1), "points are more than 10000000"),
        (changed(height=10**6, width=9), "do not fit"),
        (changed(point_step=0), "a point of 0 bytes"),
        (changed(point_step=8), "reaches beyond a point of 8 bytes"),
        (changed(row_step=47), "do not fit"),
        (changed(data=SENT.data[:-1]), "do not fit 47 bytes"),
        (changed(fields=field(datatype=9)), "its field 'z' has the unknown datatype 9"),
        (changed(fields=field(name="w")), r"it has no field 'z' of one number \(there are: x, y, w\)"),
        (changed(fields=field(name="y")), "it has two fields 'y'"),
        (changed(fields=field(count=2)), "reaches beyond"),
        (changed(fields=field(offset=2**32 - 1)), "reaches beyond"),
        (replace(SENT, header=message("std_msgs/msg/Header", stamp={"sec": 1, "nanosec": 10**9})), "no time"),
        (b"\x00\x01", "2 bytes are no message"),
        (b"\x00\x03\x00\x00" + bytes(60), "its encoding is 0x0003, not plain CDR"),
        (bytes(4) + b"\xff" * 60, "no time|ends before|is no"),
        (b"\x00\x01\x00\x00" + bytes(8) + b"\xff\xff\xff\xff" + bytes(99), "it ends before its end"),
    )
]  # fmt: skip
REFUSED += [
    (mapped(), [TREE, ("/os/points", ros.CLOUD, START, cloud(frame="nowhere", **xyz()))],
     "where 'top' sits is not known: no transforms lead from 'base_link' to 'nowhere'"),
    (mapped(), [BARE], "there is no message on /tf_static"),
    (mapped(), [TREE], r"there is no message on /os/points \(allowed: its topics: /tf_static\)"),
    (mapped(), [TREE, ("/os/points", ros.IMU, START, imu())],
     "it is sensor_msgs/msg/Imu, not sensor_msgs/msg/PointCloud2"),
    (mapped(), [TREE, BARE, BARE], "/os/points, message 1: its stamp .* does not come after"),
    (mapped(), [TREE, BARE, ("/os/points", ros.CLOUD, START + 1, cloud(START + 1, frame="roof", **xyz()))],
     "message 1: its frame is 'roof', that of top is 'os_lidar'"),
    (mapped(**lidar(frame="roof")), [TREE, BARE],
     "message 0: its frame is 'os_lidar', that of top is 'roof'"),
    (mapped(), [tf(edge("base_link", "os_lidar", x=1.0)), tf(edge("base_link", "os_lidar", x=1.1)), BARE],
     "no transforms lead from 'base_link' to 'os_lidar'"),
    (mapped(), [tf(edge("a", "os_lidar"), edge("os_lidar", "a")), BARE], "go round in a circle"),
    (mapped(), [tf(edge("base_link", "os_lidar") | {"transform": {}}), BARE],
     "/tf_static, message 0: the transform of 'os_lidar' is none: a quaternion of length 0"),
    (mapped(**lidar(time={"field": "t", "unit": "s"})),
     [TREE, ("/os/points", ros.CLOUD, START, cloud(**xyz(), t=np.arange(4, dtype=np.uint32) * 10))],
     "its points' times lie 30 s from its stamp, more than 2 s: is the unit right"),
    (mapped(**lidar(time={"field": "t", "unit": "ns", "counts_from": "1970"})),
     [TREE, ("/os/points", ros.CLOUD, START, cloud(**xyz(), t=np.arange(4, dtype=np.uint32)))],
     "is the unit right"),
    (mapped(**lidar(ring="r")),
     [TREE, ("/os/points", ros.CLOUD, START, cloud(**xyz(), r=np.full(4, 40_000, dtype=np.uint16)))],
     "its rings are 40000 to 40000, not 0 to 32767"),
    (driving(), [TREE, ("/speed", ros.TWIST, START, message(ros.TWIST, header=stamped(START, "base_link"))),
                 ("/imu", ros.IMU, START + 1, imu(angular_velocity={"x": np.nan, "y": 0.0, "z": 0.0}))],
     "/imu, message 0: its angular velocity is not finite"),
    (driving(), [TREE, ("/speed", ros.TWIST, START, message(ros.TWIST, header=stamped(START, "nowhere"))),
                 ("/imu", ros.IMU, START + 1, imu())], "/speed, message 0: no transforms lead"),
]  # fmt: skip


@pytest.mark.parametrize(("topics", "sent", "says"), REFUSED)
def test_what_cannot_be_is_refused_with_topic_and_message(
    tmp_path: Path, topics: TopicMap, sent: list[Written], says: str
) -> None:
    bag = write_foreign(tmp_path / "bag", sent)
    with pytest.raises(BadInput, match=says) as told:
        read_ros2(bag, topics)
    assert "\n" not in str(told.value) and "bag.mcap" in str(told.value)


def test_a_type_that_is_defined_otherwise_is_refused(tmp_path: Path) -> None:
    """vision_msgs before version 4 had other fields under the same name."""
    from mcap.writer import Writer

    text = ros.schema_text(ros.DETECTIONS).replace("string id\n", "bool is_tracking\nstring tracking_id\n")
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        schema = writer.register_schema(ros.DETECTIONS, "ros2msg", text.encode())
        channel = writer.register_channel("/d", "cdr", schema)
        writer.add_message(channel, START, b"\x00\x01\x00\x00" + bytes(16), START)
        writer.finish()
    with pytest.raises(
        BadInput, match="/d, message 0: this vision_msgs/msg/Detection2DArray is defined in another"
    ):
        read_ros2(tmp_path / "a.mcap", looking(detections="/d"))


def test_a_folder_with_another_number_of_files_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="holds 0 MCAP files"):
        read_ros2(tmp_path, mapped())
    for name in "ab":
        write_bytes(tmp_path / f"{name}.mcap", [TREE])
    with pytest.raises(BadInput, match="holds 2 MCAP files"):
        read_ros2(tmp_path, mapped())


def test_a_link_to_somewhere_else_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "a.mcap").symlink_to("/etc/passwd")
    with pytest.raises(BadInput, match="is a link"):
        read_ros2(tmp_path / "bag", mapped())
