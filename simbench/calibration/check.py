"""How good a found calibration is, against the true one: boards put up in the calibrated zone and beyond it.

Per board that stands upright, turned towards the LiDAR within 5 degrees, with one sweep:

* **tpr**, the paper's for a static board: of all LiDAR points that the found calibration maps into the
  board's box in the image, the share whose planar distance from the LiDAR is within 15 % of the board's width
  around the surface distance (median planar distance of its true points). No mapped point counts 0. Assumed,
  because the paper only names "static calibration": one board at a time, whole in the picture and between the
  LiDAR's beams; the box of an ideal detector; no ground removal.
* **on_board**: of the board's own points that are in the picture, the share that is mapped onto its panel.
* **residual_px**: mean distance between where the found and the true calibration map the board's points.

tpr and on_board by the true calibration stand beside them (`_true`): they are below 1 too, because the LiDAR
sees past the board from where it stands, and because a beam, wider than a line, meets the board with its
centre outside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from fusion.calibrate_board import Board
from fusion.camera import PinholeCamera, inside_box
from fusion.geometry import Transform
from scenarios.seeding import stream
from simbench.calibration.held import Sweep, hold, sweep_over
from simbench.calibration.lot import Lot
from simbench.calibration.volume import STANDING_DEG, Sight, Volume, Wanted, draw_poses

OF_SIZE = 0.15
BOARDS = 8  # put up in each part of the volume
LEAST_POINTS = 5
OUTLINE = 12  # points along each side of the panel, for its box in the image


@dataclass(frozen=True, kw_only=True, eq=False)
class Mapping:
    """How LiDAR points come into the picture: T_camera_lidar and the camera."""

    T_camera_lidar: Transform
    camera: PinholeCamera

    def __call__(self, xyz_lidar_m: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 2"]:
        """Points [n 3] to pixels [n 2]; NaN behind the camera."""
        return self.camera.project(self.T_camera_lidar.apply(xyz_lidar_m))


@dataclass(frozen=True, kw_only=True)
class Score:
    """One board: see the module's text. points: of the board, in the picture."""

    range_m: float
    radius: float
    points: int
    residual_px: float
    on_board: float
    on_board_true: float
    tpr: float
    tpr_true: float


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of what the camera sees. band: 0 within the calibrated ranges, 1 to twice the farthest, 2 to
    four times. central: within the calibrated image radius. boards: as many as there was room for."""

    band: int
    near_m: float
    far_m: float
    central: bool
    boards: tuple[Score, ...]

    @property
    def calibrated(self) -> bool:
        """Whether it is the calibrated zone."""
        return self.band == 0 and self.central


def parts(
    lot: Lot, name: str, sight: Sight, board: Board, volume: Volume, found: Mapping
) -> tuple[Part, ...]:
    """Score the found calibration of a camera in the calibrated zone and around it: by range and radius."""
    true = Mapping(T_camera_lidar=sight.T_camera_lidar, camera=sight.camera)
    edges = (volume.near_m, volume.far_m, 2.0 * volume.far_m, 4.0 * volume.far_m)
    result = []
    for band in range(3):
        for central in (True, False):
            if not central and volume.radius >= 1.0:
                continue
            wanted = Wanted(
                near_m=edges[band], far_m=edges[band + 1], radius=volume.radius, inside=central,
                whole=central, standing=True, tilt_deg=STANDING_DEG,
            )  # fmt: skip
            path = (name, "check", str(band), str(central))
            poses = draw_poses(sight, board, wanted, BOARDS, stream(lot.seed, "calibration", *path))
            scores = _scores(lot, sight, board, poses, found, true, path)
            result.append(
                Part(band=band, near_m=edges[band], far_m=edges[band + 1], central=central, boards=scores)
            )
    return tuple(result)


def _scores(
    lot: Lot, sight: Sight, board: Board, poses: tuple[Transform, ...], found: Mapping, true: Mapping,
    path: tuple[str, ...],
) -> tuple[Score, ...]:  # fmt: skip
    def each() -> Iterator[Score | None]:
        for number, pose in enumerate(poses):
            sweep = sweep_over(lot, hold(lot, board, pose), *path, str(number))
            yield score(sweep, sight, board, pose, found, true)

    return tuple(one for one in each() if one is not None)


def score(
    sweep: Sweep, sight: Sight, board: Board, T_world_board: Transform, found: Mapping, true: Mapping
) -> Score | None:
    """One board; None where fewer than 5 of its points are in the picture."""
    xyz = sweep.xyz_m.astype(np.float64)
    uv, uv_true = found(xyz), true(xyz)
    own = sweep.on_board & _in_picture(uv_true, sight.camera)
    if own.sum() < LEAST_POINTS:
        return None
    T_camera_board = sight.T_world_camera.inverse() @ T_world_board
    outline = _outline(board)
    shown = sight.camera.project(T_camera_board.apply(outline))
    size = [sight.camera.width_px, sight.camera.height_px]
    (x0, y0), (x1, y1) = np.clip(shown.min(axis=0), 0, size), np.clip(shown.max(axis=0), 0, size)
    box = (float(x0), float(y0), float(x1), float(y1))
    distance_m = np.linalg.norm(xyz[:, :2], axis=1)
    right = np.abs(distance_m - np.median(distance_m[own])) <= OF_SIZE * board.width_m
    return Score(
        range_m=float(np.linalg.norm(T_camera_board.translation_m)),
        radius=float(sight.radius(sight.camera.project(T_camera_board.translation_m[None]))[0]),
        points=int(own.sum()),
        residual_px=float(np.linalg.norm(uv[own] - uv_true[own], axis=1).mean()),
        on_board=float(_lands_on(uv[own], sight.camera, T_camera_board, board).mean()),
        on_board_true=float(_lands_on(uv_true[own], sight.camera, T_camera_board, board).mean()),
        tpr=_share(right, inside_box(uv, box)),
        tpr_true=_share(right, inside_box(uv_true, box)),
    )


def _share(right: Bool[np.ndarray, " n"], mapped: Bool[np.ndarray, " n"]) -> float:
    return float(right[mapped].mean()) if mapped.any() else 0.0


def _in_picture(uv_px: Float64[np.ndarray, "n 2"], camera: PinholeCamera) -> Bool[np.ndarray, " n"]:
    return inside_box(uv_px, (0.0, 0.0, float(camera.width_px), float(camera.height_px)))


def _outline(board: Board) -> Float64[np.ndarray, "n 3"]:
    """Points along the panel's rim."""
    corners = board.outer_m
    share = np.linspace(0.0, 1.0, OUTLINE)[:, None]
    return np.concatenate(
        [a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )


def _lands_on(
    uv_px: Float64[np.ndarray, "n 2"], camera: PinholeCamera, T_camera_board: Transform, board: Board
) -> Bool[np.ndarray, " n"]:
    """At which pixels [n] the picture shows the panel: where the line of sight meets its plane."""
    towards = np.column_stack([camera.unproject(uv_px), np.ones(len(uv_px))])
    normal, centre = T_camera_board.rotation[:, 2], T_camera_board.translation_m
    met = towards * ((normal @ centre) / (towards @ normal))[:, None]
    on = np.abs(T_camera_board.inverse().apply(met))
    half = np.array([0.5 * board.width_m, 0.5 * board.height_m])
    shown: np.ndarray = (on[:, :2] <= half).all(axis=1)
    return shown
