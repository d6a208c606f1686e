"""KITTI's calibration, in the words of all three layouts.

    x_rect = R0_rect (R x_velo + t)          Tr_velo_to_cam = [R | t]
    u ~ P2 [x_rect; 1] = K (x_rect + K^-1 p)  P2 = [K | p]: camera 2 sits beside the rectified camera 0

KITTI counts pixels from the centre of the first one, the bench from its outer corner: half a pixel is added.
The ego frame is the LiDAR's, lowered to the ground; the LiDAR stands 1.73 m above it (data sheet of the
recording car) and is taken as level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform, readonly
from fusion.messages import Calibration
from scenarios.errors import BadInput
from simbench.formats.folder import Line

LIDAR, CAMERA, OXTS = "lidar", "cam-2", "oxts"
LIDAR_HEIGHT_M = 1.73
HALF_PX = 0.5
T_EGO_LIDAR = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, LIDAR_HEIGHT_M]))
NAMES: Mapping[str, tuple[str, ...]] = {
    # ours: as the object, the tracking and the raw layout call it
    "projection": ("P2", "P_rect_02"),
    "rectification": ("R0_rect", "R_rect", "R_rect_00"),
    "lidar": ("Tr_velo_to_cam", "Tr_velo_cam"),
    "imu": ("Tr_imu_to_velo", "Tr_imu_velo"),
}
SHAPE = {"projection": (3, 4), "rectification": (3, 3), "lidar": (3, 4), "imu": (3, 4)}
Row = tuple[Line, np.ndarray]
LEAST_ORTHONORMAL = 1e-3  # printed digits leave 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class KittiCalibration:
    """`K_px` [3 3] counts pixels as the bench does. `T_camera_rect` shifts from the rectified camera 0 to
    camera 2. `R_lidar_imu` [3 3] is None where the file names no IMU.
    """

    K_px: Float64[np.ndarray, "3 3"]
    T_camera_rect: Transform
    T_rect_lidar: Transform
    R_lidar_imu: Float64[np.ndarray, "3 3"] | None

    @property
    def T_ego_rect(self) -> Transform:
        """From the frame of the labels to the ego frame."""
        return T_EGO_LIDAR @ self.T_rect_lidar.inverse()

    def camera(self, width_px: int, height_px: int) -> PinholeCamera:
        """Camera 2 for images of this size."""
        return PinholeCamera(
            fx_px=float(self.K_px[0, 0]),
            fy_px=float(self.K_px[1, 1]),
            cx_px=float(self.K_px[0, 2]),
            cy_px=float(self.K_px[1, 2]),
            width_px=width_px,
            height_px=height_px,
        )

    def as_message(self, width_px: int, height_px: int) -> Calibration:
        """What a pipeline is told."""
        T_ego_camera = self.T_ego_rect @ self.T_camera_rect.inverse()
        return Calibration(
            T_ego_sensor={LIDAR: T_EGO_LIDAR, CAMERA: T_ego_camera},
            cameras={CAMERA: self.camera(width_px, height_px)},
        )


def parse_calibration(lines: Sequence[Line], file: str) -> KittiCalibration:
    """The calibration of one file, `KEY: numbers` or `KEY numbers` a line. BadInput: something is missing, is
    no number, or is no camera or rotation.
    """
    by_key = {line.words[0].rstrip(":"): line for line in lines}
    return calibration_of({name: _row(name, by_key, file) for name in SHAPE})


def _row(name: str, by_key: Mapping[str, Line], file: str) -> Row | None:
    """The line of a matrix and its numbers; None for an IMU that is not there."""
    line = next((by_key[key] for key in NAMES[name] if key in by_key), None)
    if line is None and name == "imu":
        return None
    return matrix(found(line, NAMES[name], file), SHAPE[name])


def found(line: Line | None, names: Sequence[str], file: str) -> Line:
    """The line, if there is one. BadInput: there is none of these names."""
    if line is None:
        raise BadInput(f"there is no line {' or '.join(names)}", file=file)
    return line


def matrix(line: Line, shape: tuple[int, int]) -> Row:
    """The line, and the numbers after its key as a matrix. BadInput: too many or too few."""
    values = line.numbers(1, line.words[0].rstrip(":"))
    if len(values) != shape[0] * shape[1]:
        wanted = f"{shape[0]} x {shape[1]}"
        raise line.error(f"holds {len(values)} numbers, a {wanted} matrix has {shape[0] * shape[1]}")
    return line, np.array(values).reshape(shape)


def calibration_of(rows: Mapping[str, Row | None]) -> KittiCalibration:
    """The calibration of its matrices, each with the line that it comes from. BadInput as above."""
    projection, rectification, mount = (rows[k] for k in ("projection", "rectification", "lidar"))
    assert projection is not None and rectification is not None and mount is not None
    line, P = projection
    K = P[:, :3].copy()
    rest = (K[0, 1], K[1, 0], K[2, 0], K[2, 1])
    if not (K[0, 0] > 0 and K[1, 1] > 0 and K[2, 2] == 1.0 and max(map(abs, rest)) < 1e-9 * K[0, 0]):
        raise line.error("is not the projection of a rectified camera")
    offset_m = np.linalg.solve(K, P[:, 3])
    K[:2, 2] += HALF_PX
    R_rect = _rotation(rectification[0], rectification[1])
    R = _rotation(mount[0], mount[1][:, :3])
    imu = rows["imu"]
    return KittiCalibration(
        K_px=readonly(K),
        T_camera_rect=Transform(rotation=np.eye(3), translation_m=offset_m),
        T_rect_lidar=Transform(rotation=R_rect @ R, translation_m=R_rect @ mount[1][:, 3]),
        R_lidar_imu=None if imu is None else readonly(_rotation(imu[0], imu[1][:, :3])),
    )


def _rotation(line: Line, given: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "3 3"]:
    """The rotation nearest to the printed one: its digits are not orthonormal enough."""
    if not (np.abs(given @ given.T - np.eye(3)).max() < LEAST_ORTHONORMAL and np.linalg.det(given) > 0.0):
        raise line.error("is not a rotation")
    u, _, vt = np.linalg.svd(given)
    return np.asarray(u @ vt)
