"""A rig calibrated as the paper does it, on data that the bench makes; and how wrong the outcome is.

    lot -> board held in poses through each camera's view -> pictures and LiDAR points -> `fusion.calibrate`
        -> against the truth

Two errors of hand are added to the pairs of corners, because nothing in the bench makes them:
`click_noise_px` (1 SD, either axis: how well a hand clicks a panel's corner in the picture) and
`corner_noise_m` (1 SD, every axis: how well it picks the corner among the LiDAR's points, beside what the
beams' spacing does already). With both at 0 the corners are as the estimators find them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fusion.calibrate import (
    LEAST_POSES,
    Extrinsics,
    Measured,
    Pairs,
    find_extrinsics,
    measure_pairs,
)
from fusion.calibrate_board import Board, CalibrationError
from fusion.geometry import Transform, rotation_log
from fusion.messages import Calibration
from scenarios.errors import BadInput, nearest, show
from scenarios.seeding import stream
from simbench.calibration import check
from simbench.calibration.held import cut_out, hold, sweep_over
from simbench.calibration.lot import Lot, make_lot
from simbench.calibration.picture import take_still
from simbench.calibration.volume import Sight, Volume, draw_poses, to_calibrate


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How a rig is calibrated. cameras: empty for all. size_px: of pictures, None as the sensor files say.
    beside: the folder of a scenario file, where its rigs may lie.

    Defaults, all judgement: 20 poses; a click is good to a pixel; a corner among LiDAR points to 10 mm;
    boards are held 3 to 6 m away, where a person can hold one and the squares are still found.
    """

    rig: str
    cameras: tuple[str, ...] = ()
    poses: int = 20
    seed: int = 0
    click_noise_px: float = 1.0
    corner_noise_m: float = 0.010
    volume: Volume = field(default_factory=Volume)
    fit_distortion: bool = False
    size_px: tuple[int, int] | None = None
    beside: Path | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PairStudy:
    """One LiDAR-camera pair: what was found, how far it is from the truth, how well it maps.

    rotation_deg, translation_m: of T_camera_lidar found against true. focal: relative error of fx.
    """

    camera: str
    held: int
    measured: Measured
    extrinsics: Extrinsics
    rotation_deg: float
    translation_m: float
    focal: float
    parts: tuple[check.Part, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """A calibrated rig. calibration: what was found, cameras that were left out as they truly are."""

    settings: Settings
    pairs: tuple[PairStudy, ...]
    calibration: Calibration


def calibrate_rig(settings: Settings, done: Callable[[PairStudy], None] = lambda _: None) -> Study:
    """Calibrate every chosen LiDAR-camera pair. `done` hears of each.

    BadInput: unknown rig or camera, fewer than 3 poses, a negative error of hand, a volume without room for
    the board, or no calibration comes out.
    """
    if settings.poses < LEAST_POSES:
        raise BadInput(f"{settings.poses} poses are too few", allowed=f"at least {LEAST_POSES}")
    for what, value in (("click", settings.click_noise_px), ("corner", settings.corner_noise_m)):
        if not (np.isfinite(value) and value >= 0.0):
            raise BadInput(f"the {what} noise {show(value)} is no spread", allowed="0 or more")
    lot, board = make_lot(settings.rig, settings.seed, settings.size_px, settings.beside), Board()
    known = tuple(lot.rig.cameras)
    for name in settings.cameras:
        if name not in known:
            raise BadInput(
                f"rig {settings.rig} has no camera {show(name)}",
                allowed=", ".join(known),
                hint=nearest(name, known),
            )
    pairs = []
    for name in settings.cameras or known:
        pairs.append(calibrate_camera(lot, name, board, settings))
        done(pairs[-1])
    return Study(settings=settings, pairs=tuple(pairs), calibration=_as_told(lot, pairs))


def calibrate_camera(lot: Lot, name: str, board: Board, settings: Settings) -> PairStudy:
    """One pair, from poses to scores. BadInput as `calibrate_rig`."""
    sight = sight_of(lot, name)

    def rng(*path: str) -> np.random.Generator:
        return stream(lot.seed, "calibration", name, *path)

    wanted = to_calibrate(settings.volume)
    poses = draw_poses(sight, board, wanted, settings.poses, rng("poses"))
    if len(poses) < settings.poses:
        raise BadInput(
            f"{name}: a board of {board.width_m:g} x {board.height_m:g} m does not fit into the volume of "
            f"{wanted.near_m:g} to {wanted.far_m:g} m and image radius {wanted.radius:g}, whole in the "
            "picture and between the LiDAR's beams"
        )
    pictures, scans = [], []
    for number, pose in enumerate(poses):
        held, at = hold(lot, board, pose), str(number)
        outline = sight.camera.project((sight.T_world_camera.inverse() @ pose).apply(board.outer_m))
        noise = rng("noise", at)
        pictures.append(take_still(held, name, lot.rig.cameras[name], sight.camera, outline, noise))
        centre = (sight.T_world_lidar.inverse() @ pose).translation_m
        scans.append(cut_out(sweep_over(lot, held, name, at), centre, board, rng("cut", at)))
    try:
        measured = measure_pairs(
            pictures, scans, board, rng("planes"), fit_distortion=settings.fit_distortion
        )
        pairs = by_hand(measured.pairs, settings, rng("clicks"), rng("corners"))
        extrinsics = find_extrinsics(pairs, measured.intrinsics.camera)
    except CalibrationError as error:
        raise BadInput(f"{name}: {error}") from error
    apart = extrinsics.T_camera_lidar @ sight.T_camera_lidar.inverse()
    mapping = check.Mapping(T_camera_lidar=extrinsics.T_camera_lidar, camera=measured.intrinsics.camera)
    return PairStudy(
        camera=name,
        held=len(poses),
        measured=measured,
        extrinsics=extrinsics,
        rotation_deg=float(np.rad2deg(np.linalg.norm(rotation_log(apart.rotation)))),
        translation_m=_shift_m(extrinsics.T_camera_lidar, sight.T_camera_lidar),
        focal=measured.intrinsics.camera.fx_px / sight.camera.fx_px - 1.0,
        parts=check.parts(lot, name, sight, board, settings.volume, mapping),
    )


def sight_of(lot: Lot, name: str) -> Sight:
    """The pair of the rig's LiDAR and one of its cameras."""
    elevation = np.deg2rad(lot.rig.lidar.elevation_deg)
    return Sight(
        camera=lot.rig.pinholes[name],
        T_world_camera=lot.T_world_sensor(name),
        T_world_lidar=lot.T_world_sensor(lot.rig.lidar_name),
        elevation_rad=(float(elevation.min()), float(elevation.max())),
    )


def by_hand(
    pairs: Pairs, settings: Settings, click: np.random.Generator, corner: np.random.Generator
) -> Pairs:
    """The pairs as a hand picks them."""
    return Pairs(
        lidar_m=pairs.lidar_m + settings.corner_noise_m * corner.standard_normal(pairs.lidar_m.shape),
        image_px=pairs.image_px + settings.click_noise_px * click.standard_normal(pairs.image_px.shape),
    )


def _shift_m(found: Transform, true: Transform) -> float:
    """How far the camera's place in the LiDAR frame is off."""
    return float(np.linalg.norm(found.inverse().translation_m - true.inverse().translation_m))


def _as_told(lot: Lot, pairs: list[PairStudy]) -> Calibration:
    """What a fusion is told: the LiDAR defines the ego frame, cameras stand where they were found."""
    true = lot.rig.calibration
    T_ego_lidar = true.T_ego_sensor[lot.rig.lidar_name]
    poses: Mapping[str, Transform] = {
        pair.camera: T_ego_lidar @ pair.extrinsics.T_camera_lidar.inverse() for pair in pairs
    }
    cameras = {pair.camera: pair.measured.intrinsics.camera for pair in pairs}
    return Calibration(T_ego_sensor={**true.T_ego_sensor, **poses}, cameras={**true.cameras, **cameras})
