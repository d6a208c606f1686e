"""Where the board is held: the calibrated zone, and poses drawn in it and beyond it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from fusion.calibrate_board import Board
from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from scenarios.errors import BadInput

TRIES = 2000
AT_ONCE = 100  # tries that are looked at together
PER_TRY = 6  # numbers: range, pixel, tilt
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

    Ranges are drawn from equal shares of the volume's, one after the other, so that all are covered. Numbers
    are drawn beyond the last pose: `rng` is for these poses alone.
    """
    found: list[Transform] = []
    step = (wanted.far_m - wanted.near_m) / count
    drawn = np.zeros((0, PER_TRY))
    for number in range(count):
        low, tried = wanted.near_m + number * step, 0
        while tried < TRIES:
            if not len(drawn):
                drawn = rng.random((AT_ONCE, PER_TRY))
            # Where one range has no room the whole volume is tried.
            first = tried < TRIES // 2
            span = (low, low + step) if first else (wanted.near_m, wanted.far_m)
            some = drawn[: (TRIES // 2 if first else TRIES) - tried]
            poses = _poses(sight, span[0] + (span[1] - span[0]) * some[:, 0], some[:, 1:], wanted)
            good = np.flatnonzero(_fit(sight, board, *poses, wanted))
            used = int(good[0]) + 1 if len(good) else len(some)
            drawn, tried = drawn[used:], tried + used
            if len(good):
                rotation, translation_m = poses
                found.append(Transform(rotation=rotation[used - 1], translation_m=translation_m[used - 1]))
                break
        else:
            break
    return tuple(found)


def _poses(
    sight: Sight, range_m: Float64[np.ndarray, " n"], drawn: Float64[np.ndarray, "n 5"], wanted: Wanted
) -> tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"]]:
    """Rotation and place in the world of boards at these ranges whose centre is anywhere in the picture,
    facing the camera but for their tilt; NaN where there is none. drawn: in 0..1, pixel and tilt."""
    camera = sight.camera
    reach = wanted.radius if wanted.inside else 1.0
    half = 0.5 * np.array([camera.width_px, camera.height_px])
    box = np.minimum(half, reach * float(np.linalg.norm(half)))
    slope = camera.unproject(half + box * (2.0 * drawn[:, :2] - 1.0))
    ahead = np.column_stack([slope, np.ones(len(slope))])
    ahead *= (range_m / np.linalg.norm(ahead, axis=1))[:, None]
    centre = sight.T_world_camera.apply(ahead)
    towards = centre - sight.T_world_camera.translation_m
    if wanted.standing:
        towards = (centre - sight.T_world_lidar.translation_m) * np.array([1.0, 1.0, 0.0])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    across = np.cross(np.array([0.0, 0.0, -1.0]), towards)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(length < 0.2, np.nan, across / np.maximum(length, 0.2))
    facing = np.stack([across, np.cross(towards, across), towards], axis=-1)
    pitch, yaw, roll = (np.deg2rad(wanted.tilt_deg) * (2.0 * drawn[:, 2:] - 1.0)).T
    return facing @ _turned(pitch, yaw, roll), centre  # about the board's x, y and z


def _turned(
    x_rad: Float64[np.ndarray, " n"], y_rad: Float64[np.ndarray, " n"], z_rad: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, "n 3 3"]:
    """`rotation_rpy` of many angles."""
    (cx, cy, cz), (sx, sy, sz) = np.cos([x_rad, y_rad, z_rad]), np.sin([x_rad, y_rad, z_rad])
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    turned: np.ndarray = np.array(rows).transpose(2, 0, 1)
    return turned


def _fit(
    sight: Sight,
    board: Board,
    rotation: Float64[np.ndarray, "n 3 3"],
    centre_m: Float64[np.ndarray, "n 3"],
    wanted: Wanted,
) -> Bool[np.ndarray, " n"]:
    """Which of the boards are where they are wanted; False for NaN too."""
    corners = board.outer_m @ rotation.swapaxes(1, 2) + centre_m[:, None]
    looked = corners if wanted.whole else centre_m[:, None]
    uv = sight.camera.project(sight.T_world_camera.inverse().apply(looked).reshape(-1, 3))
    size = np.array([sight.camera.width_px, sight.camera.height_px])
    radius = sight.radius(uv).reshape(looked.shape[:2])
    seen = sight.T_world_lidar.inverse().apply(looked)
    elevation = np.arctan2(seen[..., 2], np.linalg.norm(seen[..., :2], axis=-1))
    lowest, highest = sight.elevation_rad
    view = centre_m - sight.T_world_lidar.translation_m
    faced = (view * rotation[:, :, 2]).sum(axis=1) >= LEAST_FACING * np.linalg.norm(view, axis=1)
    pictured = np.all((uv >= MARGIN_PX) & (uv <= size - MARGIN_PX), axis=1).reshape(radius.shape)
    placed = (radius <= wanted.radius).all(axis=1) if wanted.inside else (radius > wanted.radius).all(axis=1)
    fits: np.ndarray = (
        (corners[..., 2] >= ABOVE_GROUND_M).all(axis=1)
        & np.all(pictured, axis=1)
        & placed
        & ((elevation >= lowest) & (elevation <= highest)).all(axis=1)
        & faced
    )
    return fits
