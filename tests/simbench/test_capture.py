"""A recording: what is delivered, when, and what of it the pictures and the sensors' noise may change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan
from scenarios.faults import TriggerOffset
from simbench.capture import Captured, capture
from simbench.case import Job
from simbench.stage import CATEGORIES, record
from tests.simbench.support import bytes_of, digest, recorded, staged


@pytest.fixture(scope="module")
def captured() -> Captured:
    return recorded(staged(duration_s=1.0, columns=64, background=True, size_px=(320, 200)))


def test_messages_are_in_order_of_arrival_and_counted_per_sensor(captured: Captured) -> None:
    messages = captured.recording.messages
    assert [m.arrival_ns for m in messages] == sorted(m.arrival_ns for m in messages)
    for kind in (LidarScan, Detections, EgoMotion):
        by_sensor: dict[str, list[int]] = {}
        for message in messages:
            if isinstance(message, kind):
                by_sensor.setdefault(message.sensor, []).append(message.seq)
        for seqs in by_sensor.values():
            assert seqs == list(range(len(seqs)))


def test_no_message_arrives_before_it_was_measured(captured: Captured) -> None:
    truth = captured.recording.truth
    taken = {(i.sensor, i.seq): i.capture_ns for i in truth.images}
    fired = {(s.sensor, s.seq): int(s.fire_ns.max()) for s in truth.scans}
    for message in captured.recording.messages:
        key = (message.sensor, message.seq)
        if isinstance(message, Detections):
            assert message.arrival_ns > taken[key]
        elif isinstance(message, LidarScan):
            assert message.arrival_ns >= fired[key]
            assert (message.offset_ns >= 0).all() and (np.diff(message.offset_ns) >= 0).all()
            np.testing.assert_array_equal(message.stamp_ns + message.offset_ns, _fire_ns(captured, key))


def _fire_ns(captured: Captured, key: tuple[str, int]) -> np.ndarray:
    return next(s.fire_ns for s in captured.recording.truth.scans if (s.sensor, s.seq) == key)


def test_truth_fits_its_messages(captured: Captured) -> None:
    recording = captured.recording
    scans = {(m.sensor, m.seq): m for m in recording.messages if isinstance(m, LidarScan)}
    boxes = {(m.sensor, m.seq): m for m in recording.messages if isinstance(m, Detections)}
    assert scans.keys() == {(s.sensor, s.seq) for s in recording.truth.scans}
    assert boxes.keys() == {(i.sensor, i.seq) for i in recording.truth.images}
    for scan in recording.truth.scans:
        assert len(scan.object_id) == len(scans[(scan.sensor, scan.seq)].xyz_m)
    for image in recording.truth.images:
        assert len(image.detection_object_id) == len(boxes[(image.sensor, image.seq)].boxes)
        shown = {box.object_id for box in image.boxes}
        assert set(image.detection_object_id) - {-1} <= shown


def test_the_sensors_outlive_the_last_sweep(captured: Captured) -> None:
    """So that what is still waiting for a late message can be answered."""
    scans = [m for m in captured.recording.messages if isinstance(m, LidarScan)]
    last = max(m.arrival_ns for m in captured.recording.messages)
    assert last > max(scan.arrival_ns for scan in scans) + 200_000_000


def test_images_come_with_their_boxes_and_change_nothing_else() -> None:
    at = staged(duration_s=0.3, background=True)
    plain = recorded(at).recording

    def grey(motion: object, camera: str, seq: int, t_ns: int) -> np.ndarray:
        return np.full((64, 96, 3), 7, dtype=np.uint8)

    shown = capture(at.system, at.rig, at.world, at.faults, CATEGORIES, 0, grey).recording
    images = [m for m in shown.messages if isinstance(m, CameraImage)]
    boxes = {(m.sensor, m.seq): m for m in shown.messages if isinstance(m, Detections)}
    assert len(images) == len(boxes)
    for image in images:
        twin = boxes[(image.sensor, image.seq)]
        assert (image.stamp_ns, image.arrival_ns) == (twin.stamp_ns, twin.arrival_ns)
    rest = tuple(m for m in shown.messages if not isinstance(m, CameraImage))
    assert bytes_of(replace(shown, messages=rest)) == bytes_of(plain)


def test_an_ideal_recording_has_exact_ranges_and_the_same_world() -> None:
    at = staged(duration_s=0.3, columns=64)
    ideal = capture(at.system, at.rig, at.world, at.faults, CATEGORIES, 0, ideal=True).recording
    for scan, truth in zip(
        (m for m in ideal.messages if isinstance(m, LidarScan)), ideal.truth.scans, strict=True
    ):
        distance = np.linalg.norm(scan.xyz_m.astype(np.float64), axis=1)
        np.testing.assert_allclose(distance, truth.true_range_m, atol=1e-5)
    assert bytes_of(ideal)["poses"] == bytes_of(recorded(at).recording)["poses"]


def test_one_more_sensor_moves_no_other_sensors_numbers() -> None:
    at = staged(duration_s=0.5, columns=32)
    fewer = replace(
        at,
        rig=replace(
            at.rig,
            cameras={"cam-front": at.rig.cameras["cam-front"]},
            pinholes={"cam-front": at.rig.pinholes["cam-front"]},
        ),
    )
    both = [recorded(stage).recording for stage in (at, fewer)]
    for pick in (
        lambda m: isinstance(m, LidarScan),
        lambda m: isinstance(m, Detections) and m.sensor == "cam-front",
    ):
        assert digest([m for m in both[0].messages if pick(m)]) == digest(
            [m for m in both[1].messages if pick(m)]
        )


def test_with_boxes_by_labels_every_visible_object_has_its_exact_box_and_nothing_else_has_one() -> None:
    small = staged(duration_s=1.0, columns=64, background=True, size_px=(320, 200))
    job = Job(scenario="any", system=small.system.ego, seed=0, pipelines=(), boxes="labels")
    truth = record(job, small).recording.truth
    count = 0
    for image in truth.images:
        exact = {
            b.object_id: b.visible_px
            for b in image.boxes
            if b.visible_px is not None
            and b.visible_fraction >= 0.2
            and b.visible_px[3] - b.visible_px[1] >= 12
        }
        assert sorted(image.detection_object_id) == sorted(exact)
        count += len(exact)
    assert count > 50
    by_model = record(replace(job, boxes="model"), small).recording.truth
    assert sum(len(i.detection_object_id) for i in by_model.images) < count


def test_an_early_camera_is_taken_before_its_stamp() -> None:
    at = staged(specs=(TriggerOffset(offset_ms=-20.0),), duration_s=0.3)
    recording = recorded(at).recording
    stamp = {(m.sensor, m.seq): m.stamp_ns for m in recording.messages if isinstance(m, Detections)}
    on_time = {name: at.rig.timing(name, 0.3, 0) for name in at.rig.cameras}
    for image in recording.truth.images:
        timing = on_time[image.sensor]
        assert image.capture_ns - timing.mid_ns[image.seq] == -20_000_000
        assert stamp[(image.sensor, image.seq)] == timing.stamp_ns[image.seq]
