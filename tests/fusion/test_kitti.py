"""Three real frames: what projects into a labelled box lies where the label says. Skipped without data."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.ground import GroundConfig, remove_ground
from fusion.messages import Calibration, CategorySize, Detection, Detections, FusionOutput, LidarScan
from fusion.pipeline import Pipeline
from fusion.pipelines.probabilistic import Probabilistic
from fusion.pipelines.static_projection import StaticProjection, StaticProjectionGround
from tests.fusion.make import lidar_scan

DATA = Path(__file__).parents[3] / "shared" / "data" / "kitti"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the three KITTI frames are not here")

LIDAR_HEIGHT_M = 1.73
CATEGORY = {"Pedestrian": "pedestrian", "Cyclist": "rider", "Car": "car", "Truck": "truck", "Misc": "trailer"}
SIZES = {"trailer": CategorySize(mean_m=(2.4, 1.5, 1.6), spread=0.2)}


class Label(NamedTuple):
    """Planar distances of a labelled box from the LiDAR, and its centre's azimuth."""

    near_m: float
    centre_m: float
    azimuth_rad: float


class Frame(NamedTuple):
    scan: LidarScan
    detections: Detections
    calibration: Calibration
    labels: dict[int, Label]  # by track id


def load(index: int) -> Frame:
    text = (DATA / "calib" / f"{index:06d}.txt").read_text().splitlines()
    rows = {key: np.array(v.split(), float) for key, _, v in (line.partition(":") for line in text) if v}
    projection = rows["P2"].reshape(3, 4)
    rectified = rows["R0_rect"].reshape(3, 3)
    mount = rows["Tr_velo_to_cam"].reshape(3, 4)
    u, _, vt = np.linalg.svd(rectified @ mount[:, :3])  # seven printed digits are not orthonormal enough
    offset = np.linalg.solve(projection[:, :3], projection[:, 3])
    T_camera_lidar = Transform(rotation=u @ vt, translation_m=rectified @ mount[:, 3] + offset)
    camera = PinholeCamera(
        fx_px=float(projection[0, 0]),
        fy_px=float(projection[1, 1]),
        cx_px=float(projection[0, 2]),
        cy_px=float(projection[1, 2]),
        width_px=1224 if index == 0 else 1242,
        height_px=370 if index == 0 else 375,
    )
    T_ego_lidar = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, LIDAR_HEIGHT_M]))
    points = np.fromfile(DATA / "velodyne" / f"{index:06d}.bin", np.float32).reshape(-1, 4)
    boxes, labels = [], {}
    for track_id, line in enumerate((DATA / "label_2" / f"{index:06d}.txt").read_text().splitlines()):
        name, *numbers = line.split()
        if name == "DontCare":
            continue
        value = np.array(numbers, float)
        x0, y0, x1, y1 = value[3:7].tolist()
        boxes.append(
            Detection(track_id=track_id, category=CATEGORY[name], box_px=(x0, y0, x1, y1), confidence=1.0)
        )
        length, right, forward, yaw = value[9], value[10], value[12], value[13]
        distance = float(np.hypot(right, forward + 0.27))  # the LiDAR is 27 cm behind the camera
        along = abs(np.cos(yaw - np.arctan2(-forward, right)))
        half = 0.5 * float(length * along + value[8] * np.sqrt(1 - along**2))
        labels[track_id] = Label(
            near_m=distance - half,
            centre_m=distance,
            azimuth_rad=float(np.arctan2(-right, forward + 0.27)),
        )
    return Frame(
        scan=lidar_scan(points[:, :3], offset_ns=np.zeros(len(points))),
        detections=Detections(sensor="camera", seq=0, stamp_ns=0, arrival_ns=0, boxes=tuple(boxes)),
        calibration=Calibration(
            T_ego_sensor={"lidar": T_ego_lidar, "camera": T_ego_lidar @ T_camera_lidar.inverse()},
            cameras={"camera": camera},
        ),
        labels=labels,
    )


def answer(pipeline: Pipeline, frame: Frame) -> FusionOutput:
    pipeline.reset(frame.calibration, SIZES)
    pipeline.update(frame.detections)
    output = pipeline.update(frame.scan)
    assert output is not None
    return output


@pytest.mark.parametrize(("index", "count"), [(1, 2), (2, 2)])
def test_the_static_projection_measures_unoccluded_objects_between_their_near_side_and_their_centre(
    index: int, count: int
) -> None:
    frame = load(index)
    found = [o for o in answer(StaticProjection(), frame).objects if o.distance_m < 60.0]
    assert len(found) == count
    for one in found:
        label = frame.labels[one.track_id]
        assert label.near_m - 0.5 < one.distance_m < label.centre_m + 0.5
        assert one.azimuth_rad == pytest.approx(label.azimuth_rad, abs=0.1)


def test_clearing_the_ground_brings_the_trailer_nearer_to_its_label() -> None:
    frame = load(2)
    track_id = next(d.track_id for d in frame.detections.boxes if d.category == "trailer")
    found = {o.track_id: o for o in answer(StaticProjectionGround(), frame).objects}[track_id]
    assert found.distance_m == pytest.approx(frame.labels[track_id].near_m, abs=0.8)


def test_the_six_steps_find_the_trailer_and_the_car_of_the_third_frame() -> None:
    frame = load(2)
    found = {o.category: o for o in answer(Probabilistic(), frame).objects}
    for category in ("trailer", "car"):
        assert found[category].distance_m == pytest.approx(
            frame.labels[found[category].track_id].near_m, abs=1.5
        )


@pytest.mark.parametrize("index", [0, 1, 2])
def test_the_ground_plane_lies_at_the_height_of_the_mount(index: int) -> None:
    frame = load(index)
    removal = remove_ground(frame.scan.xyz_m, frame.calibration.T_ego_sensor["lidar"], GroundConfig())
    assert removal.plane is not None
    assert removal.plane.offset_m == pytest.approx(LIDAR_HEIGHT_M, abs=0.12)
    assert removal.plane.normal_lidar[2] > np.cos(np.deg2rad(3.0))
