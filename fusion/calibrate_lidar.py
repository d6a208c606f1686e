"""The board's four corners from the LiDAR points on it: a plane, then the rectangle of known size in it.

The plane by RANSAC and total least squares. Every point is moved along its own beam onto the plane, which
takes the noise of its range away. In the plane a rectangle of the board's size is shifted and turned until
the points fill it best: the beams end about half a beam's spacing before each edge, on either side alike, so
the sum over points of

    softplus((|x| - width / 2) / s) + softplus((|y| - height / 2) / s),   s = a third of the points' spacing,

is least where the gaps at opposite edges are equal. Only points near an edge count, and none counts more than
`MOST_MISFIT`, so that what stands beside the board in its plane does not pull it. The search starts from the
best of a coarse grid about the points' median.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Float64
from scipy.optimize import minimize

from fusion.calibrate_board import Board, CalibrationError

TOLERANCE_M = 0.08  # from the plane: about three standard deviations of a usual LiDAR's range
TRIALS = 100
LEAST_POINTS = 12
BEYOND_M = 0.10  # points in the plane so far beyond the rectangle are something else
MOST_MISFIT = 6.0  # of a point: of one that is two spacings beyond an edge
MOST_TURN_RAD = 0.9  # 45 degrees, and some for the fit
# The first steps of the search: 3 cm along either axis, 3 degrees.
SIMPLEX = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.0, 0.05]])


@dataclass(frozen=True, kw_only=True, eq=False)
class LidarBoard:
    """A board as the LiDAR sees it, LiDAR frame, metres. corners_m: as `Board.outer_m` orders them.

    plane_rms_m: RMS distance of the plane's points. points: how many were used.
    """

    corners_m: Float64[np.ndarray, "4 3"]
    plane_rms_m: float
    points: int


def board_in_lidar(
    xyz_lidar_m: Float[np.ndarray, "n 3"], board: Board, rng: np.random.Generator
) -> LidarBoard:
    """Find the board among points [n 3] that were cut out around it (LiDAR frame, z up).

    The board is held upright: its long side within 45 degrees of level, so that its corners have names.
    CalibrationError: fewer than 12 points lie in one plane, or they cover less than half of the board.
    """
    xyz = np.asarray(xyz_lidar_m, dtype=np.float64)
    xyz = xyz[np.isfinite(xyz).all(axis=1)]
    inside, normal, centre = _plane(xyz, rng)
    distance = (xyz[inside] - centre) @ normal
    on = _onto(xyz[inside], normal, centre)

    down = normal * normal[2] - np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(down) < 0.2:
        raise CalibrationError("the board lies nearly flat; hold it upright")
    down /= np.linalg.norm(down)
    right = np.cross(down, normal)
    flat = np.column_stack([(on - centre) @ right, (on - centre) @ down])
    x, y, turn, used = _rectangle(flat, board)
    corners = board.outer_m[:, :2] @ _turned(turn).T + np.array([x, y])
    return LidarBoard(
        corners_m=centre + corners[:, :1] * right + corners[:, 1:] * down,
        plane_rms_m=float(np.sqrt(np.mean(distance**2))),
        points=used,
    )


def _plane(
    xyz: Float64[np.ndarray, "n 3"], rng: np.random.Generator
) -> tuple[np.ndarray, Float64[np.ndarray, " 3"], Float64[np.ndarray, " 3"]]:
    """Which points lie in the plane of most points, its unit normal away from the LiDAR, a point of it."""
    if len(xyz) < LEAST_POINTS:
        raise CalibrationError(f"{len(xyz)} LiDAR points on the board; at least {LEAST_POINTS} are needed")
    inside = np.zeros(len(xyz), dtype=bool)
    for three in (xyz[rng.choice(len(xyz), 3, replace=False)] for _ in range(TRIALS)):
        normal = np.cross(three[1] - three[0], three[2] - three[0])
        length = float(np.linalg.norm(normal))
        if length < 1e-4:  # of three points nearly in a line
            continue
        near = np.abs((xyz - three[0]) @ (normal / length)) < TOLERANCE_M
        inside = near if near.sum() > inside.sum() else inside
    if inside.sum() < LEAST_POINTS:
        raise CalibrationError("the LiDAR points of the board do not lie in a plane")
    for _ in range(3):
        centre = xyz[inside].mean(axis=0)
        spread, axes = np.linalg.svd(xyz[inside] - centre, full_matrices=False)[1:]
        normal = axes[2] * (1.0 if axes[2] @ centre > 0.0 else -1.0)
        inside = np.abs((xyz - centre) @ normal) < TOLERANCE_M
    if spread[1] < 0.05 * np.sqrt(len(xyz)):
        raise CalibrationError("the LiDAR points of the board lie nearly in a line: too few beams meet it")
    if normal @ centre < 0.1 * np.linalg.norm(centre):
        raise CalibrationError("the LiDAR sees the board nearly edge on")
    return inside, normal, centre


def _onto(
    xyz: Float64[np.ndarray, "n 3"], normal: Float64[np.ndarray, " 3"], centre: Float64[np.ndarray, " 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Every point moved along its beam onto the plane."""
    moved: np.ndarray = xyz * ((normal @ centre) / (xyz @ normal))[:, None]
    return moved


def _rectangle(flat: Float64[np.ndarray, "n 2"], board: Board) -> tuple[float, float, float, int]:
    """Centre x, y and turn (rad, from right to down) of the board's rectangle; how many points it holds."""
    half = 0.5 * np.array([board.width_m, board.height_m])

    def beyond(at: np.ndarray, points: np.ndarray) -> np.ndarray:
        outside: np.ndarray = np.abs((points - at[:2]) @ _turned(at[2])) - half
        return outside

    scale_m = float(np.sqrt(4.0 * half.prod() / len(flat))) / 3.0

    def misfit(at: np.ndarray) -> float:
        each = np.logaddexp(0.0, beyond(at, flat) / scale_m).sum(axis=1)
        return float(-np.logaddexp(-each, -MOST_MISFIT).sum())

    middle = np.median(flat, axis=0)
    starts = [
        np.array([middle[0] + x, middle[1] + y, turn])
        for x in np.linspace(-0.2, 0.2, 5) * board.width_m
        for y in np.linspace(-0.2, 0.2, 5) * board.height_m
        for turn in np.deg2rad(np.arange(-40.0, 41.0, 10.0))
    ]
    at = minimize(
        misfit, start := min(starts, key=misfit), method="Nelder-Mead",
        options={"xatol": 1e-5, "fatol": 1e-6, "initial_simplex": start + SIMPLEX},
    ).x  # fmt: skip
    used = flat[(beyond(at, flat) < BEYOND_M).all(axis=1)]
    if len(used) < LEAST_POINTS:
        raise CalibrationError("the LiDAR points do not fill the board's rectangle")
    covered = float(cv2.contourArea(cv2.convexHull(used.astype(np.float32))))
    if covered < 0.5 * board.width_m * board.height_m:
        raise CalibrationError(
            f"the LiDAR points cover {covered:.2f} square metres, less than half of a board of "
            f"{board.width_m:g} x {board.height_m:g} m"
        )
    if abs(at[2]) > MOST_TURN_RAD:
        raise CalibrationError("the board's long side is far from level: hold it upright")
    return float(at[0]), float(at[1]), float(at[2]), len(used)


def _turned(turn_rad: float) -> Float64[np.ndarray, "2 2"]:
    """R_plane_board: points in the plane, as rows times this, are in the board's axes."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return np.array([[c, -s], [s, c]])
