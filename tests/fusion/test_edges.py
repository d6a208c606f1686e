"""The contract's edge, for every pipeline of ours: a clear error, or cleanly nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fusion.geometry import Transform
from fusion.messages import Calibration, Detections, LidarScan
from fusion.pipeline import Pipeline
from tests.fusion.make import lidar_scan
from tests.fusion.ours import OURS
from tests.fusion.street import CALIBRATION, CATEGORIES, answer, scene, seen

every_pipeline = pytest.mark.parametrize("name", OURS)
NAN, INF = float("nan"), float("inf")


@cache
def sweep() -> LidarScan:
    return scene(rings=24)[0]


def boxed(*box_px: float, confidence: float = 0.9) -> Detections:
    """The person's detection with another box."""
    (person, *_) = seen().boxes
    return replace(seen(), boxes=(replace(person, box_px=box_px, confidence=confidence),))


def ready(name: str) -> Pipeline:
    pipeline = OURS[name]()
    pipeline.reset(CALIBRATION, CATEGORIES)
    return pipeline


@every_pipeline
def test_a_scan_without_points_has_no_objects(name: str) -> None:
    assert answer(OURS[name](), lidar_scan(), seen()).objects == ()


@every_pipeline
@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_a_scan_without_a_finite_point_has_no_objects(name: str, value: float) -> None:
    lost = lidar_scan(np.full((500, 3), value))
    assert answer(OURS[name](), lost, seen()).objects == ()


@every_pipeline
def test_points_that_are_not_finite_are_nobodys(name: str) -> None:
    xyz_m = sweep().xyz_m.copy()
    xyz_m[::5] = NAN
    xyz_m[1::7, 0] = INF
    xyz_m[3::11, 2] = -INF
    output = answer(OURS[name](), lidar_scan(xyz_m, offset_ns=sweep().offset_ns), seen())
    assert len(output.objects) == 2
    for found in output.objects:
        assert np.isfinite(xyz_m[found.points]).all() and np.isfinite(found.position_ego_m).all()


@every_pipeline
@pytest.mark.parametrize(
    "box_px",
    [
        (400.0, 300.0, 400.0, 400.0),
        (400.0, 300.0, 450.0, 300.0),
        (450.0, 400.0, 400.0, 300.0),
        (-90.0, 200.0, -10.0, 400.0),
        (960.0, 200.0, 1060.0, 400.0),
        (400.0, -90.0, 450.0, -10.0),
        (NAN, 200.0, 450.0, 400.0),
        (-INF, -INF, INF, INF),
    ],
    ids=["no width", "no height", "upside down", "left", "right", "above", "not a number", "infinite"],
)
def test_what_is_no_box_has_no_object(name: str, box_px: tuple[float, float, float, float]) -> None:
    assert answer(OURS[name](), sweep(), boxed(*box_px)).objects == ()


@every_pipeline
def test_a_box_without_a_confidence_has_no_object(name: str) -> None:
    box_px = seen().boxes[0].box_px
    assert answer(OURS[name](), sweep(), boxed(*box_px, confidence=NAN)).objects == ()


@every_pipeline
def test_an_image_without_boxes_has_no_objects(name: str) -> None:
    assert answer(OURS[name](), sweep(), replace(seen(), boxes=())).objects == ()


@every_pipeline
def test_detections_before_any_scan_wait_for_it(name: str) -> None:
    pipeline = ready(name)
    assert pipeline.update(seen()) is None
    assert pipeline.trajectories() == ()
    output = pipeline.update(sweep())
    assert output is not None and len(output.objects) == 2


@every_pipeline
def test_a_run_without_messages_has_no_trajectories(name: str) -> None:
    assert ready(name).trajectories() == ()


@every_pipeline
def test_a_sensor_without_calibration_is_refused_by_name(name: str) -> None:
    with pytest.raises(ValueError, match="camera 'rear' has no calibration; known: front"):
        ready(name).update(replace(seen(), sensor="rear"))
    with pytest.raises(ValueError, match="LiDAR 'roof' has no calibration; known: front, lidar"):
        ready(name).update(lidar_scan(sensor="roof"))


@every_pipeline
def test_an_update_before_reset_is_refused(name: str) -> None:
    for message in (seen(), sweep()):
        with pytest.raises(RuntimeError, match="update before reset"):
            OURS[name]().update(message)


@pytest.mark.parametrize("rotation", [1.1 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.full((3, 3), NAN)])
def test_no_calibration_can_hold_a_rotation_that_is_none(rotation: np.ndarray) -> None:
    """So no pipeline ever sees one."""
    with pytest.raises(ValueError, match="rotation is not orthonormal"):
        Transform(rotation=rotation, translation_m=np.zeros(3))


def test_no_calibration_can_hold_a_camera_without_a_place() -> None:
    lidar = {"lidar": CALIBRATION.T_ego_sensor["lidar"]}
    with pytest.raises(ValueError, match="camera 'front' has intrinsics but no T_ego_sensor; known: lidar"):
        Calibration(T_ego_sensor=lidar, cameras=CALIBRATION.cameras)
