"""What a fusion pipeline receives and returns.

Every message has `sensor`, `seq` (counts this sensor's deliveries from 0), `stamp_ns` (what the sensor's
clock claims; it may lie) and `arrival_ns` (when it was delivered, on the bench's clock). Arrays are
read-only and own their memory. Frames follow ROS REP-103: ego and LiDAR x forward, y left, z up; camera
optical x right, y down, z forward. The ego frame's origin lies on the ground below the LiDAR's rest
position, x along the path.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int16, Int32, Int64, UInt8

from fusion.camera import PinholeCamera
from fusion.geometry import Transform, readonly

BoxPx: TypeAlias = tuple[float, float, float, float]


def _own(message: object, **dtypes: type) -> None:
    for name, dtype in dtypes.items():
        object.__setattr__(message, name, readonly(getattr(message, name), dtype))


@dataclass(frozen=True, kw_only=True, eq=False)
class LidarScan:
    """One sweep. `stamp_ns` is the first firing; points are not motion-compensated; misses are not points."""

    sensor: str
    seq: int
    stamp_ns: int
    arrival_ns: int
    xyz_m: Float32[np.ndarray, "n 3"]  # LiDAR frame, in firing order
    intensity: Float32[np.ndarray, " n"]  # 0..1
    offset_ns: Int32[np.ndarray, " n"]  # >= 0, from stamp_ns
    ring: Int16[np.ndarray, " n"]

    def __post_init__(self) -> None:
        _own(self, xyz_m=np.float32, intensity=np.float32, offset_ns=np.int32, ring=np.int16)


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraImage:
    """One picture, [h w 3]; a monochrome camera has equal channels."""

    sensor: str
    seq: int
    stamp_ns: int
    arrival_ns: int
    rgb: UInt8[np.ndarray, "h w 3"]

    def __post_init__(self) -> None:
        _own(self, rgb=np.uint8)


@dataclass(frozen=True, kw_only=True)
class Detection:
    """One tracked 2-D box; track ids are global over cameras and drawn at random per run."""

    track_id: int
    category: str  # "car", "rider", "pedestrian", ...
    box_px: BoxPx  # (x0, y0, x1, y1)
    confidence: float


@dataclass(frozen=True, kw_only=True)
class Detections:
    """The detector's boxes for one image of camera `sensor`; `seq` and `stamp_ns` are the image's."""

    sensor: str
    seq: int
    stamp_ns: int
    arrival_ns: int
    boxes: tuple[Detection, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class EgoMotion:
    """*Measured* motion of the ego's body, in its own axes (the ego frame's, at rest).

    velocity_mps: by the odometer. rate_radps: by the gyro. specific_force_mps2: by the accelerometer, its
    acceleration less gravity where the IMU sits; at rest it reads about (0, 0, 9.81).
    """

    sensor: str
    seq: int
    stamp_ns: int
    arrival_ns: int
    velocity_mps: Float64[np.ndarray, "3"]
    rate_radps: Float64[np.ndarray, "3"]
    specific_force_mps2: Float64[np.ndarray, "3"]

    def __post_init__(self) -> None:
        _own(self, velocity_mps=np.float64, rate_radps=np.float64, specific_force_mps2=np.float64)


Measurement: TypeAlias = LidarScan | CameraImage | Detections | EgoMotion


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """What the fusion is told: `T_ego_sensor[name]` at rest for every sensor, `cameras[name]` intrinsics.

    ValueError: a camera without a `T_ego_sensor`.
    """

    T_ego_sensor: Mapping[str, Transform]
    cameras: Mapping[str, PinholeCamera]

    def __post_init__(self) -> None:
        for name in self.cameras:
            if name not in self.T_ego_sensor:
                known = ", ".join(sorted(self.T_ego_sensor)) or "none"
                raise ValueError(f"camera {name!r} has intrinsics but no T_ego_sensor; known: {known}")
        object.__setattr__(self, "T_ego_sensor", MappingProxyType(dict(self.T_ego_sensor)))
        object.__setattr__(self, "cameras", MappingProxyType(dict(self.cameras)))
        object.__setattr__(self, "_T_camera_lidar", {})

    def T_camera_lidar(self, camera: str, lidar: str) -> Transform:
        """LiDAR coordinates to the camera's optical coordinates; worked out once for every pair."""
        known: dict[tuple[str, str], Transform] = self.__dict__["_T_camera_lidar"]
        if (camera, lidar) not in known:
            known[camera, lidar] = self.T_ego_sensor[camera].inverse() @ self.T_ego_sensor[lidar]
        return known[camera, lidar]


@dataclass(frozen=True, kw_only=True)
class CategorySize:
    """Mean length, width, height of a category in metres, and the relative spread (1 SD) of each."""

    mean_m: tuple[float, float, float]
    spread: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalizedObject:
    """One object that the fusion found, seen by camera `sensor` under `track_id`.

    stamp_ns: the instant that the position describes, within the sweep (without deskew: the firing time of
    the representative point). points: indices [k] into the scan: the mapping. position_ego_m: [3], ego frame.
    distance_m: planar, from the LiDAR. azimuth_rad: atan2(y, x) in the LiDAR's frame. confidence: 0..1.
    """

    track_id: int
    category: str
    sensor: str
    stamp_ns: int
    points: Int64[np.ndarray, " k"]
    position_ego_m: Float64[np.ndarray, "3"]
    distance_m: float
    azimuth_rad: float
    confidence: float

    def __post_init__(self) -> None:
        _own(self, points=np.int64, position_ego_m=np.float64)


@dataclass(frozen=True, kw_only=True)
class FusionOutput:
    """What a pipeline returns for one delivered scan; at most one per scan."""

    scan_sensor: str
    scan_seq: int
    objects: tuple[LocalizedObject, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """The track of one object over the run: stamps [t] ascending, positions [t 3] in the ego frame.

    inlier [t]: False where the smoother threw the raw sample away (or interpolated it).
    """

    track_id: int
    stamp_ns: Int64[np.ndarray, " t"]
    position_ego_m: Float64[np.ndarray, "t 3"]
    inlier: Bool[np.ndarray, " t"]

    def __post_init__(self) -> None:
        _own(self, stamp_ns=np.int64, position_ego_m=np.float64, inlier=np.bool_)


__all__ = [
    "BoxPx",
    "Calibration",
    "CameraImage",
    "CategorySize",
    "Detection",
    "Detections",
    "EgoMotion",
    "FusionOutput",
    "LidarScan",
    "LocalizedObject",
    "Measurement",
    "PinholeCamera",
    "Trajectory",
    "Transform",
]
