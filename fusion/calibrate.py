"""The calibration of a LiDAR-camera pair as the paper makes it (section "System Calibration"), from pictures
and LiDAR points of a checkerboard held in several poses.

1. Intrinsics (eq. 6's first matrix): the inner corners of the squares, then `cv2.calibrateCamera` (Zhang
   2000, "A flexible new technique for camera calibration", IEEE TPAMI 22(11)). The paper takes its lenses'
   distortion to be minimal and leaves it out; so do we unless `fit_distortion`.
2. Pairs: the panel's four corners in the LiDAR frame (`calibrate_lidar.py`) and in the picture.
3. Extrinsics (eq. 6's second matrix, T_camera_lidar): `cv2.solvePnP` over the pairs of all poses, which ends
   in Levenberg-Marquardt on the reprojection error.
4. Fine tuning. The paper's is by hand and not told. Ours: reprojection over all poses again, with residuals
   beyond twice their robust scale (1.4826 median) weighing less and less (soft L1), so that one wrong click
   or a badly seen board does not turn the rest.

Pixels: the centre of the first one is (0.5, 0.5). Nothing here knows how pictures and points came about.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Float64, UInt8
from scipy.optimize import least_squares

from fusion.calibrate_board import Board, CalibrationError, find_corners
from fusion.calibrate_lidar import board_in_lidar
from fusion.camera import PinholeCamera
from fusion.geometry import Transform, rotation_exp

LEAST_POSES = 3
LEAST_TILT_DEG = 5.0  # that the boards must differ by: else focal length and distance trade places
LEAST_SCALE_PX = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class Intrinsics:
    """camera: as found. T_camera_board: where the board was in each view. residual_px [v k]: how far each
    inner corner was found from where the camera says it should be."""

    camera: PinholeCamera
    T_camera_board: tuple[Transform, ...]
    residual_px: Float64[np.ndarray, "v k"]

    @property
    def rms_px(self) -> float:
        """The reprojection error as it is usually told: RMS over corners."""
        return float(np.sqrt(np.mean(self.residual_px**2)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """The panel's corners in both sensors, view by view, ordered as `Board.outer_m`."""

    lidar_m: Float64[np.ndarray, "v 4 3"]
    image_px: Float64[np.ndarray, "v 4 2"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Extrinsics:
    """T_camera_lidar after the fine tuning, and before it (`first`). residual_px [v 4]: of all pairs."""

    T_camera_lidar: Transform
    first: Transform
    residual_px: Float64[np.ndarray, "v 4"]

    @property
    def rms_px(self) -> float:
        """RMS over pairs."""
        return float(np.sqrt(np.mean(self.residual_px**2)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """Steps 1 and 2 of one pair. used: which views took part; left_out: why the others did not."""

    intrinsics: Intrinsics
    pairs: Pairs
    used: tuple[int, ...]
    left_out: Mapping[int, str]


@dataclass(frozen=True, kw_only=True, eq=False)
class PairCalibration:
    """What one LiDAR-camera pair is found to be."""

    measured: Measured
    extrinsics: Extrinsics


def calibrate_pair(
    pictures: Sequence[UInt8[np.ndarray, "_ _"]],
    scans_m: Sequence[Float[np.ndarray, "_ 3"]],
    board: Board,
    rng: np.random.Generator,
    *,
    fit_distortion: bool = False,
) -> PairCalibration:
    """The whole way: grey pictures of the board, and of each pose the LiDAR points around it (LiDAR frame).

    CalibrationError as `measure_pairs` and `find_extrinsics`.
    """
    measured = measure_pairs(pictures, scans_m, board, rng, fit_distortion=fit_distortion)
    extrinsics = find_extrinsics(measured.pairs, measured.intrinsics.camera)
    return PairCalibration(measured=measured, extrinsics=extrinsics)


def measure_pairs(
    pictures: Sequence[UInt8[np.ndarray, "_ _"]],
    scans_m: Sequence[Float[np.ndarray, "_ 3"]],
    board: Board,
    rng: np.random.Generator,
    *,
    fit_distortion: bool = False,
) -> Measured:
    """Intrinsics and pairs. Views in which the board is not found, by camera or LiDAR, are left out.

    CalibrationError: pictures and scans differ in number, pictures in size; no board is found in any picture;
    fewer than 3 views are left, or they do not determine the camera.
    """
    if len(pictures) != len(scans_m):
        raise CalibrationError(f"{len(pictures)} pictures and {len(scans_m)} LiDAR scans do not go together")
    if len({picture.shape for picture in pictures}) > 1:
        raise CalibrationError("the pictures differ in size")
    inner: list[np.ndarray] = []
    lidar: list[np.ndarray] = []
    used: list[int] = []
    left_out: dict[int, str] = {}
    unseen = 0
    for number, (picture, scan_m) in enumerate(zip(pictures, scans_m, strict=True)):
        corners = find_corners(picture, board)
        if corners is None:
            left_out[number] = "the board's corners are not found in the picture"
            unseen += 1
            continue
        try:
            lidar.append(board_in_lidar(scan_m, board, rng).corners_m)
        except CalibrationError as error:
            left_out[number] = str(error)
            continue
        inner.append(corners)
        used.append(number)
    if unseen == len(pictures):
        raise CalibrationError(f"the board's corners are found in none of {len(pictures)} pictures")
    if len(used) < LEAST_POSES:
        why = f"; of view {min(left_out)}: {left_out[min(left_out)]}" if left_out else ""
        raise CalibrationError(
            f"the board is found in {len(used)} of {len(pictures)} views; {LEAST_POSES} are needed{why}"
        )
    height_px, width_px = pictures[0].shape
    intrinsics = find_intrinsics(inner, board, (width_px, height_px), fit_distortion=fit_distortion)
    pairs = Pairs(lidar_m=np.array(lidar), image_px=outer_corners_px(intrinsics, board))
    return Measured(intrinsics=intrinsics, pairs=pairs, used=tuple(used), left_out=left_out)


def find_intrinsics(
    corners_px: Sequence[Float64[np.ndarray, "k 2"]],
    board: Board,
    size_px: tuple[int, int],
    *,
    fit_distortion: bool = False,
) -> Intrinsics:
    """The camera from the inner corners of several views. size_px: width, height of the pictures.

    CalibrationError: fewer than 3 views, or the boards face the same way within 5 degrees.
    """
    if len(corners_px) < LEAST_POSES:
        raise CalibrationError(
            f"the board is found in {len(corners_px)} pictures; at least {LEAST_POSES} are needed"
        )
    flags = 0
    if not fit_distortion:
        flags = cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    if _tilt_apart_deg(corners_px, board, size_px) < LEAST_TILT_DEG:
        raise CalibrationError(
            f"all boards face the same way within about {LEAST_TILT_DEG:g} degrees: tilt it from view to view"
        )
    world = [board.inner_m.astype(np.float32)] * len(corners_px)
    image = [np.asarray(corners, dtype=np.float32) for corners in corners_px]
    with _one_thread():
        _, matrix, lens, turns, shifts = cv2.calibrateCamera(
            world, image, size_px, np.eye(3), np.zeros(5), flags=flags
        )
    k1, k2, p1, p2, k3 = (float(v) for v in np.ravel(lens)[:5])
    camera = PinholeCamera(
        fx_px=float(matrix[0, 0]), fy_px=float(matrix[1, 1]), cx_px=float(matrix[0, 2]),
        cy_px=float(matrix[1, 2]), width_px=size_px[0], height_px=size_px[1], distortion=(k1, k2, p1, p2, k3),
    )  # fmt: skip
    poses = tuple(
        Transform(rotation=rotation_exp(np.ravel(turn)), translation_m=np.ravel(shift))
        for turn, shift in zip(turns, shifts, strict=True)
    )
    if not all(np.isfinite([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])):
        raise CalibrationError("the views do not determine the camera")
    shown = np.array([camera.project(pose.apply(board.inner_m)) for pose in poses])
    residual = np.linalg.norm(shown - np.array(corners_px), axis=2)
    return Intrinsics(camera=camera, T_camera_board=poses, residual_px=residual)


@contextmanager
def _one_thread() -> Iterator[None]:
    """OpenCV on one thread: its threads add the views' sums in the order in which they end, and the last
    digits of the camera change from call to call."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def _tilt_apart_deg(
    corners_px: Sequence[Float64[np.ndarray, "k 2"]], board: Board, size_px: tuple[int, int]
) -> float:
    """By how much the boards' normals differ at most, roughly: from the lines where their planes vanish, seen
    by a camera whose focal length is the picture's width. Parallel boards share that line whatever the camera
    is, and then no camera can be found (Zhang 2000, section 3.4)."""
    guess = np.array([[size_px[0], 0, 0.5 * size_px[0]], [0, size_px[0], 0.5 * size_px[1]], [0, 0, 1.0]])
    facing = []
    for corners in corners_px:
        homography, _ = cv2.findHomography(board.inner_m[:, :2], corners)
        if homography is None:
            raise CalibrationError("the corners of a board lie in a line")
        normal = guess.T @ np.linalg.solve(homography.T, np.array([0.0, 0.0, 1.0]))
        facing.append(normal / np.linalg.norm(normal) * np.sign(normal[2]))
    cosine = np.clip(np.array(facing) @ np.array(facing).T, -1.0, 1.0)
    return float(np.rad2deg(np.arccos(cosine)).max())


def outer_corners_px(intrinsics: Intrinsics, board: Board) -> Float64[np.ndarray, "v 4 2"]:
    """The panel's four corners in each view, from the pose that its squares give it: what a perfect hand
    would click."""
    shown: np.ndarray = np.array(
        [intrinsics.camera.project(pose.apply(board.outer_m)) for pose in intrinsics.T_camera_board]
    )
    return shown


def find_extrinsics(pairs: Pairs, camera: PinholeCamera) -> Extrinsics:
    """T_camera_lidar from 3-D-2-D pairs of all views. CalibrationError: fewer than 3 views, a pair that is
    not finite, all boards in nearly one place, or no solution with the boards before the camera."""
    if len(pairs.lidar_m) < LEAST_POSES:
        raise CalibrationError(f"{len(pairs.lidar_m)} poses of the board; at least {LEAST_POSES} are needed")
    xyz, uv = pairs.lidar_m.reshape(-1, 3), pairs.image_px.reshape(-1, 2)
    if not (np.isfinite(xyz).all() and np.isfinite(uv).all()):
        raise CalibrationError("a corner of the board is not finite")
    spread = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    if spread[2] < 0.01 * spread[0]:
        raise CalibrationError("all corners of the boards lie nearly in one plane: hold it elsewhere too")
    lens = np.array(camera.distortion)
    done, turn, shift = cv2.solvePnP(xyz, uv, camera.matrix, lens, flags=cv2.SOLVEPNP_SQPNP)
    if done:
        done, turn, shift = cv2.solvePnP(
            xyz, uv, camera.matrix, lens, turn, shift, useExtrinsicGuess=True, flags=cv2.SOLVEPNP_ITERATIVE
        )
    if not done:
        raise CalibrationError("solvePnP finds no pose of the camera")
    first = Transform(rotation=rotation_exp(np.ravel(turn)), translation_m=np.ravel(shift))
    if first.apply(xyz)[:, 2].min() <= 0.0:
        raise CalibrationError("solvePnP puts a board behind the camera: the pairs do not fit together")
    tuned = fine_tune(first, xyz, uv, camera)
    residual = np.linalg.norm(camera.project(tuned.apply(xyz)) - uv, axis=1)
    return Extrinsics(T_camera_lidar=tuned, first=first, residual_px=residual.reshape(-1, 4))


def fine_tune(
    first: Transform,
    xyz_lidar_m: Float64[np.ndarray, "n 3"],
    image_px: Float64[np.ndarray, "n 2"],
    camera: PinholeCamera,
) -> Transform:
    """The T_camera_lidar near `first` with the least robust reprojection error (see the module's text)."""

    def residual(twist: np.ndarray) -> np.ndarray:
        moved = Transform.exp(twist) @ first
        shown: np.ndarray = (camera.project(moved.apply(xyz_lidar_m)) - image_px).ravel()
        return np.where(np.isfinite(shown), shown, 1e3)

    scale_px = max(2.0 * 1.4826 * float(np.median(np.abs(residual(np.zeros(6))))), LEAST_SCALE_PX)
    found = least_squares(
        residual, np.zeros(6), loss="soft_l1", f_scale=scale_px, x_scale=np.array([0.01] * 3 + [0.001] * 3),
        xtol=1e-12, ftol=1e-12, gtol=1e-12,
    )  # fmt: skip
    return Transform.exp(found.x) @ first
