"""A small analytic street with a person, a car and a hedge, seen by one camera, and answers to it."""

from __future__ import annotations

import numpy as np

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import Calibration, CategorySize, Detection, Detections, FusionOutput, LidarScan
from fusion.pipeline import Pipeline
from fusion.synthetic import Block, beams, cast
from tests.fusion.make import lidar_scan

OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
CAMERA = PinholeCamera(fx_px=500.0, fy_px=500.0, cx_px=480.0, cy_px=300.0, width_px=960, height_px=600)
CALIBRATION = Calibration(
    T_ego_sensor={
        "lidar": Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.8])),
        "front": Transform(rotation=OPTICAL, translation_m=np.array([0.2, 0.0, 1.6])),
    },
    cameras={"front": CAMERA},
)
CATEGORIES = {
    "board": CategorySize(mean_m=(1.0, 0.1, 1.0), spread=0.1),
    "car": CategorySize(mean_m=(4.5, 1.8, 1.5), spread=0.08),
    "pedestrian": CategorySize(mean_m=(0.5, 0.5, 1.75), spread=0.08),
}
PERSON = Block(centre_m=(8.0, 1.0, 0.9), size_m=(0.3, 0.5, 1.8))
CAR = Block(centre_m=(12.0, -2.0, 0.75), size_m=(4.5, 1.8, 1.5), yaw_rad=0.3)
HEDGE = Block(centre_m=(14.0, 3.0, 1.0), size_m=(0.5, 9.0, 2.0))
HEDGE_APART = Block(centre_m=(14.0, 4.2, 1.0), size_m=(0.5, 6.6, 2.0))  # 1.4 m from the car
BLOCKS = (PERSON, CAR, HEDGE)


def street(rings: int = 32, columns: int = 900, reach_m: float = 14.5) -> tuple[LidarScan, np.ndarray]:
    """A sweep, cut off before the region of step 1 ends however it is turned, and the block hit [n]."""
    origin = CALIBRATION.T_ego_sensor["lidar"].translation_m
    rays = beams(rings, columns, np.deg2rad(16.0))
    range_m, hit = cast(origin, rays, BLOCKS)
    seen = range_m < reach_m
    xyz = rays[seen] * range_m[seen, None]
    column = (np.arange(rings * columns) // rings)[seen]
    return lidar_scan(xyz, offset_ns=column * (100_000_000 // columns)), hit[seen]


def scene(rings: int = 32) -> tuple[LidarScan, np.ndarray]:
    """A sweep over the person, the car and the hedge, and the block hit [n]."""
    rays = beams(rings, 900, np.deg2rad(16.0))
    range_m, hit = cast(CALIBRATION.T_ego_sensor["lidar"].translation_m, rays, (PERSON, CAR, HEDGE_APART))
    near = range_m < 14.8  # so that the region of step 1 holds it however it is turned
    column = (np.arange(len(rays)) // rings)[near]
    return lidar_scan(rays[near] * range_m[near, None], offset_ns=column * (100_000_000 // 900)), hit[near]


def box_of(block: Block, shift_px: float = 0.0) -> tuple[float, float, float, float]:
    uv = CAMERA.project(CALIBRATION.T_ego_sensor["front"].inverse().apply(block.corners_m()))
    (x0, y0), (x1, y1) = uv.min(axis=0), uv.max(axis=0)
    return (float(x0) + shift_px, float(y0), float(x1) + shift_px, float(y1))


def seen(shift_px: float = 0.0) -> Detections:
    boxes = (
        Detection(track_id=1, category="pedestrian", box_px=box_of(PERSON, shift_px), confidence=0.9),
        Detection(track_id=2, category="car", box_px=box_of(CAR, shift_px), confidence=0.8),
    )
    return Detections(sensor="front", seq=0, stamp_ns=0, arrival_ns=0, boxes=boxes)


def answer(
    pipeline: Pipeline,
    scan: LidarScan,
    detections: Detections,
    calibration: Calibration = CALIBRATION,
) -> FusionOutput:
    pipeline.reset(calibration, CATEGORIES)
    assert pipeline.update(detections) is None
    output = pipeline.update(scan)
    assert output is not None
    return output


def with_points(scan: LidarScan, index: np.ndarray) -> LidarScan:
    return lidar_scan(scan.xyz_m[index], offset_ns=scan.offset_ns[index])


def same(a: FusionOutput, b: FusionOutput, index: np.ndarray) -> bool:
    """Whether b's points, at `index` in a's scan, are a's, and the objects are the same."""
    pairs = list(zip(a.objects, b.objects, strict=True))
    return bool(pairs) and all(
        np.array_equal(one.points, np.sort(index[other.points]))
        and np.array_equal(one.position_ego_m, other.position_ego_m)
        and one.stamp_ns == other.stamp_ns
        for one, other in pairs
    )
