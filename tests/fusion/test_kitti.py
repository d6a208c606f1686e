"""Three real frames: what projects into a labelled box lies where the label says. Skipped without data."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from fusion.ground import GroundConfig, remove_ground
from fusion.messages import Calibration, CategorySize, Detections, FusionOutput, LidarScan
from fusion.pipeline import Pipeline
from fusion.pipelines.probabilistic import Probabilistic
from fusion.pipelines.static_projection import StaticProjection, StaticProjectionGround
from scenarios.fault_set import FaultSet
from simbench.formats.calibration import LIDAR_HEIGHT_M
from simbench.formats.kitti import open_kitti
from simbench.formats.labels import SIZES
from simbench.formats.recorded import Player

DATA = Path(__file__).parents[3] / "shared" / "data" / "kitti"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the three KITTI frames are not here")

TRAILER = {"misc": CategorySize(mean_m=(2.4, 1.5, 1.6), spread=0.2)}  # what is misc in the third frame


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
    recording = Player(open_kitti(f"kitti:{DATA}").drive(index), FaultSet()).play().recording
    (scan,) = (m for m in recording.messages if isinstance(m, LidarScan))
    (detections,) = (m for m in recording.messages if isinstance(m, Detections))
    truth, labels = recording.truth, {}
    for detection, object_id in zip(detections.boxes, truth.images[0].detection_object_id, strict=True):
        rotation, centre = truth.poses.object_centre(object_id, np.array([0]))
        x, y = float(centre[0, 0]), float(centre[0, 1])
        length_m, width_m, _ = truth.objects[object_id].size_m
        distance = float(np.hypot(x, y))
        along = abs(float(rotation[0, :2, 0] @ (x, y))) / distance
        half = 0.5 * float(length_m * along + width_m * np.sqrt(max(0.0, 1 - along**2)))
        labels[detection.track_id] = Label(
            near_m=distance - half, centre_m=distance, azimuth_rad=float(np.arctan2(y, x))
        )
    return Frame(scan=scan, detections=detections, calibration=recording.calibration, labels=labels)


def answer(pipeline: Pipeline, frame: Frame) -> FusionOutput:
    pipeline.reset(frame.calibration, {**SIZES, **TRAILER})
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
    track_id = next(d.track_id for d in frame.detections.boxes if d.category == "misc")
    found = {o.track_id: o for o in answer(StaticProjectionGround(), frame).objects}[track_id]
    assert found.distance_m == pytest.approx(frame.labels[track_id].near_m, abs=0.8)


def test_the_six_steps_find_the_trailer_and_the_car_of_the_third_frame() -> None:
    frame = load(2)
    found = {o.category: o for o in answer(Probabilistic(), frame).objects}
    for category in ("misc", "car"):
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
