"""Which detections a scan gets, in hand-made streams."""

from __future__ import annotations

import pytest

from fusion.messages import Detections, LidarScan
from fusion.pairing import MAX_WAIT_NS, Pairing
from tests.fusion.make import lidar_scan

MS = 1_000_000


def scan(seq: int, stamp_ms: float, sensor: str = "lidar") -> LidarScan:
    return lidar_scan(seq=seq, stamp_ns=int(stamp_ms * MS), sensor=sensor)


def detections(seq: int, stamp_ms: float, camera: str = "front") -> Detections:
    ns = int(stamp_ms * MS)
    return Detections(sensor=camera, seq=seq, stamp_ns=ns, arrival_ns=ns, boxes=())


LATE_NS = 10_000 * MS  # long after every wait


def paired_stamps_ms(pairing: Pairing, of: LidarScan) -> list[float]:
    pairing.hold(of)
    found = pairing.settle(LATE_NS)
    assert found is not None and found[0] is of
    return [d.stamp_ns / MS for d in found[1]]


@pytest.mark.parametrize(
    ("stamps_ms", "expected"),
    [
        ([80, 110], [110]),  # nearest
        ([90, 110], [90]),  # a tie: the earlier
        ([110, 90], [90]),  # a tie, delivered in the other order
        ([50], [50]),  # exactly half a period before
        ([150], [150]),  # exactly half a period after
        ([49.9], []),
        ([150.1], []),
        ([], []),
    ],
)
def test_the_nearest_stamp_within_half_a_period_is_paired(
    stamps_ms: list[float], expected: list[float]
) -> None:
    pairing = Pairing()
    for seq, stamp_ms in enumerate(stamps_ms):
        pairing.add(detections(seq, stamp_ms))
    assert paired_stamps_ms(pairing, scan(0, 100)) == expected


def test_every_camera_is_paired_by_itself_in_the_order_of_names() -> None:
    pairing = Pairing()
    pairing.add(detections(0, 120, "rear"))
    pairing.add(detections(0, 90, "front"))
    pairing.add(detections(0, 300, "left"))
    pairing.hold(scan(0, 100))
    found = pairing.settle(LATE_NS)
    assert found is not None and [d.sensor for d in found[1]] == ["front", "rear"]


def test_a_scan_waits_for_detections_that_come_after_it() -> None:
    pairing = Pairing(cameras=["front"])
    held = scan(0, 100)
    pairing.hold(held)
    assert pairing.settle(held.arrival_ns) is None
    pairing.add(detections(0, 90))
    assert pairing.settle(held.arrival_ns + 20 * MS) is None  # a nearer one may still come
    pairing.add(detections(1, 130))
    found = pairing.settle(held.arrival_ns + 40 * MS)
    assert found is not None and [d.stamp_ns for d in found[1]] == [90 * MS]


def test_a_camera_that_is_silent_costs_one_wait_and_is_then_not_waited_for() -> None:
    pairing = Pairing(cameras=["front"])
    first, second = scan(0, 100), scan(1, 200)
    pairing.hold(first)
    assert pairing.settle(first.arrival_ns + MAX_WAIT_NS - 1) is None
    assert pairing.settle(first.arrival_ns + MAX_WAIT_NS) == (first, ())
    pairing.hold(second)
    assert pairing.settle(second.arrival_ns) == (second, ())
    pairing.add(detections(0, 250))  # heard again
    third = scan(2, 300)
    pairing.hold(third)
    assert pairing.settle(third.arrival_ns) is None


def test_waiting_scans_are_answered_oldest_first_and_one_at_a_time() -> None:
    pairing = Pairing()
    held = [scan(0, 100), scan(1, 200)]
    for each in held:
        pairing.hold(each)
    assert [settled[0] for _ in held if (settled := pairing.settle(LATE_NS)) is not None] == held
    assert pairing.settle(LATE_NS) is None


def test_a_scan_that_is_delivered_twice_is_answered_once() -> None:
    pairing = Pairing()
    for sensor in ("lidar", "lidar", "other lidar"):
        pairing.hold(scan(0, 100, sensor))
    answered = [pairing.settle(LATE_NS) for _ in range(3)]
    assert [a[0].sensor for a in answered if a is not None] == ["lidar", "other lidar"]


def test_the_period_is_learned_from_the_scans_and_survives_a_dropped_one() -> None:
    pairing = Pairing()
    for seq, stamp_ms in enumerate([0, 50, 100, 200, 250]):  # 20 Hz, the one at 150 dropped
        pairing.hold(scan(seq, stamp_ms))
        pairing.settle(LATE_NS)
    assert pairing.period_ns("lidar") == 50 * MS
    pairing.add(detections(0, 330))
    assert paired_stamps_ms(pairing, scan(5, 300)) == []  # 30 ms > half of 50 ms


def test_until_three_periods_are_known_the_default_holds() -> None:
    pairing = Pairing()
    for seq, stamp_ms in enumerate([0, 200, 400]):
        pairing.hold(scan(seq, stamp_ms))
        pairing.settle(LATE_NS)
    assert pairing.period_ns("lidar") == 100 * MS
    assert pairing.period_ns("unheard of") == 100 * MS
