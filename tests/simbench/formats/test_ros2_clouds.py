"""Point clouds of other stacks' drivers as scans."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fusion.messages import LidarScan
from simbench.formats.ros2 import definitions as ros
from simbench.formats.ros2.read import Imported, import_ros2
from simbench.formats.ros2.topics import TopicMap
from tests.simbench.formats.ros2_foreign import (
    START,
    START_S,
    TREE,
    cloud,
    lidar,
    mapped,
    write_foreign,
    xyz,
)


def scans(folder: Path, sent: list[Any], topics: TopicMap) -> tuple[list[Any], Imported]:
    told = [("/os/points", ros.CLOUD, START + 10**8 * (i + 1), one) for i, one in enumerate(sent)]
    found = import_ros2(write_foreign(folder / "bag", [TREE, *told]), topics)
    return [m for m in found.log.messages if isinstance(m, LidarScan)], found


def test_a_bare_cloud_loses_its_misses_and_says_so(tmp_path: Path) -> None:
    """A point that is not finite, and one at the sensor's centre, are no returns."""
    (scan,), found = scans(tmp_path, [cloud(**xyz())], mapped())
    assert scan.xyz_m.tolist() == [[10.0, 1.0, 0.5], [5.0, -2.0, 0.25]]
    assert scan.offset_ns.tolist() == [0, 0] and scan.ring.tolist() == [-1, -1]
    assert found.notes == (
        "2 points of top are no returns (not finite, or at the sensor's centre) and were left out",
    )
    # map over base_link over roof (1 m ahead, turned left) over os_lidar (2 m on from there)
    assert found.log.calibration.T_ego_sensor["top"].translation_m == pytest.approx([1.0, 2.0, 0.0])
    assert (scan.stamp_ns, scan.arrival_ns) == (250_000_000, 350_000_000) and found.epoch_s == START_S
    assert set(found.log.categories) == {"car", "rider", "pedestrian", "board"}


SECONDS = np.array([0.03, np.nan, 0.05, 0.01])


@pytest.mark.parametrize(
    ("field", "values", "time"),
    [
        ("time", SECONDS.astype(np.float32), {"unit": "s"}),  # Velodyne
        ("t", np.array([3, 0, 5, 1], dtype=np.uint32) * 10_000_000, {"unit": "ns"}),  # Ouster
        ("timestamp", START * 1e-9 + SECONDS, {"unit": "s", "counts_from": "1970"}),  # Hesai
        ("us", np.array([3, 0, 5, 1], dtype=np.int32) * 10_000, {"unit": "us"}),
    ],
)
@pytest.mark.parametrize("big", [False, True])
def test_points_are_put_in_the_order_of_their_firing(
    tmp_path: Path, field: str, values: np.ndarray, time: dict[str, str], big: bool
) -> None:
    sent = cloud(big=big, **xyz(), **{field: values})
    (scan,), _ = scans(tmp_path, [sent], mapped(**lidar(time={"field": field, **time})))
    assert scan.xyz_m[:, 0].tolist() == [5.0, 10.0]
    assert scan.offset_ns == pytest.approx([10_000_000, 30_000_000], abs=300)  # of a float64 since 1970
    assert scan.stamp_ns == 250_000_000


def test_a_stamp_at_the_end_of_the_sweep_becomes_the_first_firing(tmp_path: Path) -> None:
    sent = cloud(**xyz(), time=np.array([-0.1, -0.05, 0.0, -0.02], dtype=np.float64))
    (scan,), _ = scans(tmp_path, [sent], mapped(**lidar(time={"field": "time", "unit": "s"})))
    assert scan.stamp_ns == 150_000_000
    assert scan.offset_ns.tolist() == [0, 80_000_000]


def test_rings_and_intensities_of_any_type_are_read(tmp_path: Path) -> None:
    sent = cloud(
        **xyz(dtype="f8"), intensity=np.array([51, 0, 0, 255], dtype=np.uint8),
        channel=np.array([7, 1, 1, 65535], dtype=np.uint16),
    )  # fmt: skip
    topics = mapped(**lidar(ring="channel", intensity={"field": "intensity", "full": 255.0}))
    (scan,), _ = scans(tmp_path, [sent], topics)
    assert scan.intensity == pytest.approx([0.2, 1.0]) and scan.ring.tolist() == [7, -1]


def test_intensities_beyond_what_is_full_are_cut_and_counted(tmp_path: Path) -> None:
    sent = cloud(**xyz(), signal=np.array([50.0, 0, 0, 101.0], dtype=np.float32))
    topics = mapped(**lidar(intensity={"field": "signal", "full": 100.0}))
    (scan,), found = scans(tmp_path, [sent], topics)
    assert scan.intensity.tolist() == [0.5, 1.0]
    assert "1 intensities of top were below 0 or above 1 and were cut" in found.notes


def test_rows_with_gaps_between_them_are_read(tmp_path: Path) -> None:
    (scan,), _ = scans(tmp_path, [cloud(rows=2, gap=5, **xyz())], mapped())
    assert scan.xyz_m[:, 0].tolist() == [10.0, 5.0]
