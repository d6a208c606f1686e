"""Distances by camera: whose they are, when, and how far two cameras are apart."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest

from fusion.messages import FusionOutput, LocalizedObject
from simbench.capture import Captured
from simbench.distances import Curve, disagreements, distances
from simbench.score.frames import frames_of
from tests.simbench.support import recorded, staged

ACTORS = ("rider", "leader", "oncoming", "walker-right", "walker-left")
BY_CAMERA_M = {"cam-front": 0.0, "cam-front-left": 0.25, "cam-front-right": -0.5}


def curve(name: str, camera: str, by_scan: dict[int, float], late_ns: int = 0) -> Curve:
    """Scan k starts at k x 100 ms; the answer's stamp is `late_ns` later."""
    scans = np.array(list(by_scan), dtype=np.int64)
    return Curve(
        pipeline="mine", object_name=name, camera=camera, scan_seq=scans, t_ns=scans * 100_000_000 + late_ns,
        distance_m=np.array(list(by_scan.values())),
    )  # fmt: skip


@pytest.fixture(scope="module")
def captured() -> Captured:
    with mock.patch("simbench.sensors.detector.recall", lambda *_: 1.0):
        at = staged(scenario="five-objects", duration_s=0.5, columns=16, size_px=(320, 200), background=True)
        return recorded(at)


def answers(captured: Captured) -> tuple[FusionOutput, ...]:
    """Every box of every image as an object: at 10 m plus its id, plus what the camera adds."""
    return tuple(
        FusionOutput(
            scan_sensor=frame.scan.sensor,
            scan_seq=frame.scan.seq,
            objects=tuple(
                LocalizedObject(
                    track_id=box.track_id, category=box.category, sensor=camera,
                    stamp_ns=frame.scan.stamp_ns + 7, points=np.empty(0, dtype=np.int64),
                    position_ego_m=np.zeros(3), azimuth_rad=0.0, confidence=1.0,
                    distance_m=10.0 + object_id + BY_CAMERA_M.get(camera, 3.0),
                )
                for camera, view in frame.views.items()
                if view.detections is not None
                for box, object_id in zip(
                    view.detections.boxes, view.truth.detection_object_id, strict=True
                )
            ),
        )
        for frame in frames_of(captured.recording)
    )  # fmt: skip


def test_a_curve_holds_what_was_said_of_its_object_by_its_camera(captured: Captured) -> None:
    ids = {info.name: info.object_id for info in captured.recording.truth.objects}
    found = distances(captured.recording, {"mine": answers(captured)}, ACTORS)
    assert {one.object_name for one in found.curves} <= set(ACTORS)  # none of the background
    assert {"rider", "leader"} <= {one.object_name for one in found.curves}
    stamps = {frame.scan.seq: frame.scan.stamp_ns for frame in frames_of(captured.recording)}
    for one in found.of("mine"):
        expected_m = 10.0 + ids[one.object_name] + BY_CAMERA_M.get(one.camera, 3.0)
        np.testing.assert_array_equal(one.distance_m, expected_m)
        assert [int(t) for t in one.t_ns] == [stamps[int(seq)] + 7 for seq in one.scan_seq]
        assert (np.diff(one.scan_seq) > 0).all()
    assert found.of("another") == ()


def test_cameras_with_constant_errors_are_apart_by_their_difference(captured: Captured) -> None:
    found = distances(captured.recording, {"mine": answers(captured)}, ("leader",))
    cameras = {one.camera for one in found.curves}
    assert {"cam-front", "cam-front-left"} <= cameras
    (apart,) = disagreements([c for c in found.curves if c.camera in ("cam-front", "cam-front-left")])
    assert len(apart.apart_m) == len(frames_of(captured.recording)) == 5  # both see it in every scan
    np.testing.assert_allclose(apart.apart_m, 0.25, atol=1e-12)


def test_the_true_curve_is_the_distance_of_centre_and_lidar_in_the_world(captured: Captured) -> None:
    found = distances(captured.recording, {}, ACTORS)
    assert tuple(one.object_name for one in found.true) == ACTORS and found.curves == ()
    poses = captured.recording.truth.poses
    for one in found.true:
        object_id = captured.motion.world.find(one.object_name).object_id
        gap = poses.object_centre(object_id, one.t_ns)[1] - poses.sensor("lidar", one.t_ns)[1]
        np.testing.assert_allclose(one.distance_m, np.hypot(gap[:, 0], gap[:, 1]), atol=1e-6)
        assert len(one.t_ns) == 5


def test_an_object_that_is_not_there_is_refused(captured: Captured) -> None:
    with pytest.raises(ValueError, match=r"no object 'ghost'; there are: .*rider"):
        distances(captured.recording, {}, ("ghost",))


def test_disagreement_compares_every_two_cameras_in_the_scans_that_both_have() -> None:
    found = disagreements(
        [
            curve("rider", "a", {0: 10.0, 1: 11.0, 2: 12.0}),
            curve("rider", "b", {1: 11.5, 2: 12.0, 3: 13.0}, late_ns=5),
            curve("rider", "c", {2: 10.0}, late_ns=9),
            curve("walker", "a", {0: 5.0, 1: 5.0}),
            curve("walker", "b", {2: 9.0}),
        ]
    )
    assert [one.object_name for one in found] == ["rider", "walker"]
    rider, walker = found
    # scan 1: a-b 0.5; scan 2: a-b 0, a-c 2, b-c 2 (at the first camera's stamps: 200 ms twice, then +5 ns)
    assert rider.apart_m.tolist() == [0.5, 0.0, 2.0, 2.0]
    assert rider.t_ns.tolist() == [100_000_000, 200_000_000, 200_000_000, 200_000_005]
    assert walker.apart_m.tolist() == [] and disagreements([]) == ()
