"""What a page holds of a recording is what the recording holds: every number of it is compared."""

from __future__ import annotations

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

from fusion.geometry import Transform
from fusion.messages import Calibration, LidarScan
from scenarios.errors import BadInput
from simbench.formats.store import Stored
from simbench.view import caps
from simbench.view.packed import NOWHERE
from simbench.view.page import page_of
from tests.simbench.view.viewed import block, numbers, scans, with_messages, with_pictures

HALF_CM = 0.005 + 1e-9


@pytest.fixture(scope="module")
def page(stored: Stored) -> str:
    return page_of(stored)


# -- what a pipeline may see --------------------------------------------------------------------------------


def test_points_are_every_kth_of_the_scan_in_the_ego_frame(page: str, stored: Stored) -> None:
    seen = block(page, "seen")
    xyz_m = numbers(seen["xyz_cm"], "<i2").reshape(-1, 3) / 100.0
    bright = numbers(seen["intensity"], "u1")
    begin = 0
    assert len(seen["sweeps"]) == len(scans(stored)) == 6
    for told, scan in zip(seen["sweeps"], scans(stored), strict=True):
        pose = stored.recording.calibration.T_ego_sensor[scan.sensor]
        expected = (pose.rotation @ scan.xyz_m.astype(np.float64).T).T + pose.translation_m
        part = slice(begin, begin + told["kept"])
        begin += told["kept"]
        k = told["every"]
        assert told["points"] == len(scan.xyz_m) and k % 2 == 1 and told["kept"] <= caps.MOST_POINTS
        assert len(scan.xyz_m) / (k - 2) > caps.MOST_POINTS, "no more is thinned than needed"
        assert np.abs(xyz_m[part] - expected[::k]).max() <= HALF_CM
        assert np.abs(bright[part] / 255.0 - scan.intensity[::k]).max() <= 0.5 / 255.0 + 1e-6
        for name in ("sensor", "seq", "stamp_ns", "arrival_ns"):
            assert told[name] == getattr(scan, name)
    assert begin == len(xyz_m) == len(bright)


def test_with_each_sweep_goes_what_was_delivered_last_before_it(page: str, stored: Stored) -> None:
    """The oracle hears the messages one by one, as a pipeline does."""
    seen = block(page, "seen")
    words = {"LidarScan": "sweep", "CameraImage": "image", "Detections": "boxes", "EgoMotion": "motion"}
    heard: dict[tuple[str, str], list[int]] = {}
    at = 0
    for message in stored.recording.messages:
        kind = words[type(message).__name__]
        heard[message.sensor, kind] = [message.seq, message.stamp_ns, message.arrival_ns]
        if kind == "sweep":
            now = {(s["sensor"], s["kind"]): s["rows"][at] for s in seen["streams"]}
            assert {key: row for key, row in now.items() if row is not None} == heard
            at += 1
    assert at == 6 and len(heard) == 8


def test_boxes_of_a_camera_are_those_of_its_detections(page: str, stored: Stored) -> None:
    seen = block(page, "seen")
    some = 0
    for camera, places in zip(seen["cameras"], seen["boxes"], strict=True):
        for place in places:
            message = stored.recording.messages[place]
            told = seen["messages"][str(place)]
            assert message.sensor == camera["name"] and told["more"] == 0
            assert [b[:2] for b in told["boxes"]] == [[b.track_id, b.category] for b in message.boxes]
            for b, box in zip(told["boxes"], message.boxes, strict=True):
                assert b[2:] == pytest.approx(box.box_px, abs=0.0501)
                some += 1
    assert some > 10


def test_the_lidar_looks_along_a_camera_when_its_spin_is_there(page: str, stored: Stored) -> None:
    """One turn in 100 ms, clockwise from above, from 90 degrees left of the front: 25 ms to the front."""
    seen = block(page, "seen")
    azimuths = [camera["azimuth_deg"] for camera in seen["cameras"]]
    assert azimuths == pytest.approx([45.0, 0.0, -45.0, 135.0, 180.0, -135.0])
    for sweep in seen["sweeps"]:
        for azimuth, passes in zip(azimuths, sweep["passes_ms"], strict=True):
            assert passes == pytest.approx((90.0 - azimuth) % 360.0 / 3.6, abs=0.3)


def test_images_are_those_of_the_camera_and_number(stored: Stored) -> None:
    import cv2

    pictured = with_pictures(stored)
    seen = block(page_of(pictured), "seen")
    cameras = sorted(stored.recording.calibration.cameras)
    for camera, places in zip(seen["cameras"], seen["images"], strict=True):
        for place in places:
            told = seen["messages"][str(place)]
            rgb = cv2.imdecode(numbers(told["jpeg"], "u1"), cv2.IMREAD_COLOR)
            assert rgb is not None and rgb.shape == (30, 320, 3)
            expected = 30 + 25 * cameras.index(camera["name"]) + 4 * told["seq"]
            assert abs(float(rgb.mean()) - expected) <= 1.5


def test_of_too_many_sweeps_and_images_every_kth_is_kept(stored: Stored) -> None:
    with mock.patch("simbench.view.sweeps.MOST_SWEEPS", 4), mock.patch("simbench.view.seen.MOST_IMAGES", 12):
        page = page_of(with_pictures(stored))
    seen = block(page, "seen")
    assert seen["every_sweep"] == 2 and [sweep["seq"] for sweep in seen["sweeps"]] == [0, 2, 4]
    assert seen["every_picture"] == 2
    held = [place for place, message in seen["messages"].items() if message.get("jpeg")]
    assert sorted(map(int, held)) == sorted(places[at] for places in seen["images"] for at in (0, 2))
    assert "those of one in 2 sweeps." in page and "<dd>one in 2 sweeps;" in page


def test_what_may_be_seen_does_not_hang_on_the_truth(page: str, stored: Stored) -> None:
    truth = stored.recording.truth
    other = replace(truth, objects=truth.objects[:1], scans=(), images=(), target_id=None)
    blind = page_of(replace(stored, recording=replace(stored.recording, truth=other)))
    assert block(blind, "seen") == block(page, "seen")
    assert block(blind, "hidden") != block(page, "hidden")


# -- what it may not ----------------------------------------------------------------------------------------


def test_true_boxes_are_where_they_were_at_the_middle_of_the_sweep(page: str, stored: Stored) -> None:
    hidden, truth = block(page, "hidden"), stored.recording.truth
    assert [(o["id"], o["name"], o["category"]) for o in hidden["objects"]] == [
        (info.object_id, info.name, info.category) for info in truth.objects
    ]
    assert [o["id"] for o in hidden["objects"] if o["target"]] == [truth.target_id]
    places = numbers(hidden["places"], "<i2").reshape(6, len(truth.objects), 3)
    near = 0
    for at, scan in enumerate(truth.scans):
        middle = (int(scan.fire_ns.min()) + int(scan.fire_ns.max())) // 2
        assert hidden["middles_ns"][at] == middle and abs(hidden["starts_ns"][at] - at * 10**8) <= 1
        t = np.array([middle], dtype=np.int64)
        r_ego, p_ego = truth.poses.ego(t)
        for row, info in enumerate(truth.objects):
            r, p = truth.poses.object_centre(info.object_id, t)
            ego_m = np.linalg.inv(r_ego[0]) @ (p[0] - p_ego[0])
            assert places[at, row, 0] != NOWHERE
            assert np.abs(places[at, row, :2] / 100.0 - ego_m[:2]).max() <= HALF_CM
            forward = np.linalg.inv(r_ego[0]) @ r[0] @ [1.0, 0.0, 0.0]
            yaw = places[at, row, 2] / 1e4
            assert np.hypot(np.cos(yaw) - forward[0], np.sin(yaw) - forward[1]) < 1e-4
            near += 1
    assert near == 6 * len(truth.objects)


def test_points_are_told_what_they_hit(page: str, stored: Stored) -> None:
    seen, hidden = block(page, "seen"), block(page, "hidden")
    rows = numbers(hidden["points"], "<i2")
    ids = np.array([o["id"] for o in hidden["objects"]])
    expected = np.concatenate(
        [
            scan.object_id[:: sweep["every"]]
            for scan, sweep in zip(stored.recording.truth.scans, seen["sweeps"], strict=True)
        ]
    )
    assert len(np.unique(expected)) > 5
    assert (np.where(rows >= 0, ids[rows], rows) == expected).all()


def test_an_image_is_told_when_it_was_taken_and_what_is_visible_in_it(page: str, stored: Stored) -> None:
    hidden, truth = block(page, "hidden"), stored.recording.truth
    images = {(image.sensor, image.seq): image for image in truth.images}
    ids = [o["id"] for o in hidden["objects"]]
    for place, taken in hidden["taken"].items():
        message = stored.recording.messages[int(place)]
        image = images[message.sensor, message.seq]
        assert taken["capture_ns"] == image.capture_ns
        assert taken["capture_ns"] - message.stamp_ns > 50e6, "the injected offset, which no stamp tells"
        visible = [box for box in image.boxes if box.visible_px is not None]
        assert [ids[b[0]] for b in taken["boxes"]] == [box.object_id for box in visible]
        for b, box in zip(taken["boxes"], visible, strict=True):
            assert b[1:] == pytest.approx(box.visible_px, abs=0.0501)
    assert len(hidden["taken"]) == 36


def test_what_is_wholly_hidden_in_an_image_has_no_box(stored: Stored) -> None:
    truth = stored.recording.truth
    images = tuple(
        replace(
            image, boxes=tuple(replace(box, visible_px=None, visible_fraction=0.0) for box in image.boxes)
        )
        for image in truth.images
    )
    behind = replace(truth, images=images)
    hidden = block(page_of(replace(stored, recording=replace(stored.recording, truth=behind))), "hidden")
    assert len(hidden["taken"]) == 36 and all(taken["boxes"] == [] for taken in hidden["taken"].values())


def test_truth_that_is_not_there_is_not_made_up(stored: Stored) -> None:
    truth = stored.recording.truth
    cut = replace(truth, scans=truth.scans[:2], images=truth.images[:3])
    hidden = block(page_of(replace(stored, recording=replace(stored.recording, truth=cut))), "hidden")
    assert [middle is None for middle in hidden["middles_ns"]] == [False, False, True, True, True, True]
    places = numbers(hidden["places"], "<i2").reshape(6, len(truth.objects), 3)
    assert (places[2:] == NOWHERE).all() and (places[:2] != NOWHERE).all()
    assert len(hidden["taken"]) == 3


# -- bad numbers --------------------------------------------------------------------------------------------


def test_points_that_are_no_numbers_or_too_far_away_are_left_out(stored: Stored) -> None:
    first = next(m for m in stored.recording.messages if isinstance(m, LidarScan))
    at = stored.recording.messages.index(first)
    xyz_m = first.xyz_m[:4].copy()
    xyz_m[0] = np.nan
    xyz_m[1] = [400.0, 0.0, 0.0]
    xyz_m[2] = [3.0e38, -3.0e38, np.inf]
    bad = replace(
        first, xyz_m=xyz_m, intensity=np.array([0.5, 0.5, 0.5, np.nan], dtype=np.float32),
        offset_ns=first.offset_ns[:4], ring=first.ring[:4],
    )  # fmt: skip
    page = page_of(with_messages(stored, (*stored.recording.messages[:at], bad)))
    seen = block(page, "seen")
    assert [(sweep["points"], sweep["kept"]) for sweep in seen["sweeps"]] == [(4, 1)]
    pose = stored.recording.calibration.T_ego_sensor[first.sensor]
    (shown,) = numbers(seen["xyz_cm"], "<i2").reshape(-1, 3) / 100.0
    assert np.abs(shown - pose.apply(xyz_m[3].astype(np.float64))).max() <= HALF_CM
    assert (numbers(block(page, "hidden")["points"], "<i2") == -2).all(), "the truth is of another scan"


def test_a_recording_without_a_sweep_has_nothing_to_show(stored: Stored) -> None:
    others = tuple(m for m in stored.recording.messages if not isinstance(m, LidarScan))
    with pytest.raises(BadInput, match="no LiDAR sweep"):
        page_of(with_messages(stored, others))


def test_a_lidar_of_which_nobody_says_where_it_is_cannot_be_shown(stored: Stored) -> None:
    told = Calibration(T_ego_sensor={"imu": Transform.identity()}, cameras={})
    with pytest.raises(BadInput, match="where the sensor 'lidar' is"):
        page_of(replace(stored, recording=replace(stored.recording, calibration=told)))
