"""Where the board is held: the calibrated zone, and poses drawn in it and beyond it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from fusion.calibrate_board import Board
from fusion.camera import PinholeCamera
from fusion.geometry import Transform, rotation_rpy
from scenarios.errors import BadInput

TRIES = 2000
ABOVE_GROUND_M = 0.1
MARGIN_PX = 4.0
LEAST_FACING = 0.35  # cosine between the LiDAR's view of the board and its normal
TILT_DEG = (25.0, 40.0, 15.0)  # most about its long side, its short side, and its normal: as one holds it
STANDING_DEG = (0.0, 5.0, 0.0)  # of a board that is put up to be seen: upright, towards the LiDAR
MOST_M = 60.0


@dataclass(frozen=True, kw_only=True)
class Volume:
    """The calibrated zone of a camera: ranges of the board's centre from the camera, and image radius (share
    of half the picture's diagonal from its centre) that no corner of the board leaves."""

    near_m: float = 3.0
    far_m: float = 6.0
    radius: float = 0.6

    def __post_init__(self) -> None:
        if not 0.5 <= self.near_m < self.far_m <= MOST_M / 4.0:
            raise BadInput(
                f"the calibration volume from {self.near_m:g} to {self.far_m:g} m is empty or out of range",
                allowed=f"0.5 <= near < far <= {MOST_M / 4.0:g} m",
            )
        if not 0.0 < self.radius <= 1.0:
            raise BadInput(
                f"the volume's image radius {self.radius:g} is not a share", allowed="above 0, to 1"
            )


def parse_volume(text: str) -> Volume:
    """`near,far` in metres or `near,far,radius`. BadInput: not so."""
    words = text.split(",")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(np.isfinite(numbers)):
        raise BadInput(f"'{text[:40]}' is not a calibration volume", allowed="near,far,radius, e.g. 3,6,0.6")
    return Volume(near_m=numbers[0], far_m=numbers[1], **({"radius": numbers[2]} if numbers[2:] else {}))


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """What a LiDAR-camera pair sees: the true camera, where both stand, and between which elevations the
    LiDAR's beams lie (rad)."""

    camera: PinholeCamera
    T_world_camera: Transform
    T_world_lidar: Transform
    elevation_rad: tuple[float, float]

    @property
    def T_camera_lidar(self) -> Transform:
        """The true extrinsics."""
        return self.T_world_camera.inverse() @ self.T_world_lidar

    def radius(self, uv_px: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
        """Image radius of pixels: 0 at the picture's centre, 1 at its corners."""
        half = 0.5 * np.array([self.camera.width_px, self.camera.height_px])
        share: np.ndarray = np.linalg.norm(uv_px - half, axis=1) / np.linalg.norm(half)
        return share


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """Which poses to draw. inside: no corner beyond image radius `radius`; else the centre is beyond it, in
    the picture. whole: every corner is in the picture and between the LiDAR's beams; else the centre.
    standing: upright and towards the LiDAR but for its tilt; else towards the camera."""

    near_m: float
    far_m: float
    radius: float
    inside: bool
    whole: bool
    standing: bool
    tilt_deg: tuple[float, float, float]


def to_calibrate(volume: Volume) -> Wanted:
    """Boards held to calibrate."""
    return Wanted(
        near_m=volume.near_m, far_m=volume.far_m, radius=volume.radius, inside=True, whole=True,
        standing=False, tilt_deg=TILT_DEG,
    )  # fmt: skip


def draw_poses(
    sight: Sight, board: Board, wanted: Wanted, count: int, rng: np.random.Generator
) -> tuple[Transform, ...]:
    """T_world_board of up to `count` poses; fewer where the volume has no room for them in many tries.

    Ranges are drawn from equal shares of the volume's, one after the other, so that all are covered.
    """
    found: list[Transform] = []
    step = (wanted.far_m - wanted.near_m) / count
    for number in range(count):
        low = wanted.near_m + number * step
        for attempt in range(TRIES):
            # Where one range has no room the whole volume is tried.
            span = (low, low + step) if attempt < TRIES // 2 else (wanted.near_m, wanted.far_m)
            pose = _pose(sight, rng.uniform(*span), wanted, rng)
            if pose is not None and _fits(sight, board, pose, wanted):
                found.append(pose)
                break
        else:
            break
    return tuple(found)


def _pose(sight: Sight, range_m: float, wanted: Wanted, rng: np.random.Generator) -> Transform | None:
    """A board at a range whose centre is anywhere in the picture, facing the camera but for its tilt."""
    camera = sight.camera
    reach = wanted.radius if wanted.inside else 1.0
    half = 0.5 * np.array([camera.width_px, camera.height_px])
    box = np.minimum(half, reach * float(np.linalg.norm(half)))
    slope = camera.unproject((half + rng.uniform(-box, box))[None])[0]
    tilt = np.deg2rad(wanted.tilt_deg) * rng.uniform(-1.0, 1.0, 3)
    if not np.isfinite(slope).all():
        return None
    ahead = np.array([slope[0], slope[1], 1.0])
    ahead *= range_m / np.linalg.norm(ahead)
    centre = sight.T_world_camera.apply(ahead)
    towards = centre - sight.T_world_camera.translation_m
    if wanted.standing:
        towards = (centre - sight.T_world_lidar.translation_m) * np.array([1.0, 1.0, 0.0])
    towards = towards / np.linalg.norm(towards)
    across = np.cross(np.array([0.0, 0.0, -1.0]), towards)
    if np.linalg.norm(across) < 0.2:
        return None
    across /= np.linalg.norm(across)
    facing = np.column_stack([across, np.cross(towards, across), towards])
    pitch, yaw, roll = tilt
    return Transform(
        rotation=facing @ rotation_rpy(pitch, yaw, roll),  # about the board's x, y and z
        translation_m=centre,
    )


def _fits(sight: Sight, board: Board, T_world_board: Transform, wanted: Wanted) -> bool:
    corners = T_world_board.apply(board.outer_m)
    if corners[:, 2].min() < ABOVE_GROUND_M:
        return False
    centre = T_world_board.translation_m[None]
    looked = corners if wanted.whole else centre
    uv = sight.camera.project(sight.T_world_camera.inverse().apply(looked))
    size = np.array([sight.camera.width_px, sight.camera.height_px])
    if not ((uv >= MARGIN_PX) & (uv <= size - MARGIN_PX)).all():  # False for NaN too
        return False
    radius = sight.radius(uv)
    if (radius.max() > wanted.radius) if wanted.inside else (radius.min() <= wanted.radius):
        return False
    seen = sight.T_world_lidar.inverse().apply(looked)
    elevation = np.arctan2(seen[:, 2], np.linalg.norm(seen[:, :2], axis=1))
    if elevation.min() < sight.elevation_rad[0] or elevation.max() > sight.elevation_rad[1]:
        return False
    view = T_world_board.translation_m - sight.T_world_lidar.translation_m
    return bool(view @ T_world_board.rotation[:, 2] >= LEAST_FACING * np.linalg.norm(view))
