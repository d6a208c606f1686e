"""calibration.click_noise_px: the fusion is told the extrinsics that a calibration with noisy clicks finds.

Boards are held in the zone of each camera (`calibration/volume.py`), the corners of their panel are clicked
with Gaussian noise, and fusion.calibrate finds T_camera_lidar from them: T_told = T_before * D, D the error
of the found pose in the camera's frame.
Receipt: RMS of the clicks' noise, times how often known points are moved in the picture as D moves them.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.special import chdtri

from fusion.calibrate import LEAST_POSES, Pairs, find_extrinsics
from fusion.calibrate_board import Board, CalibrationError
from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import Calibration
from scenarios.faults import ClickNoise
from scenarios.seeding import stream
from simbench.calibration.volume import Sight, Volume, draw_poses, to_calibrate
from simbench.faults.estimate import gain
from simbench.faults.known import AHEAD_M, pixels, told_pose
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import spared, struck
from simbench.faults.telling import CalibrationFault, Place, Telling, Told, Witness

NOTE = "known points by the told pose, before and after, against the drawn error of the pose"
SD_PX = 0.002
SD_SHARE = 0.003
RARE = 1e-6
SPAN = (-0.5 * np.pi, 0.5 * np.pi)  # rad: the LiDAR's points of the board are exact wherever it is
TWIST = ("x", "y", "z", "about x", "about y", "about z")


def clicked(spec: ClickNoise, told: Calibration, place: Place) -> Told:
    """The calibration with the poses that are found; a camera in whose zone no boards fit keeps its own."""
    poses, realised = dict(told.T_ego_sensor), dict[str, float]()
    for camera in struck(spec, place):
        found = _error(spec, camera, told.cameras[camera], place)
        if found is None:
            realised[f"{camera} numbers"] = 0.0
            continue
        error, clicks_px = found
        poses[camera] = told.T_ego_sensor[camera] @ error
        realised[f"{camera} clicks"] = float(np.sqrt(np.mean(clicks_px**2)))
        realised[f"{camera} numbers"] = float(clicks_px.size)
        realised.update({f"{camera} {a}": float(x) for a, x in zip(TWIST, error.log(), strict=True)})
    return Told(calibration=Calibration(T_ego_sensor=poses, cameras=told.cameras), realised=realised)


def _error(
    spec: ClickNoise, camera: str, told: PinholeCamera, place: Place
) -> tuple[Transform, Float64[np.ndarray, "v 4 2"]] | None:
    """T_true_found of a camera that is taken for `told`, and the clicks' noise; None where no calibration
    comes about."""
    lens, true, board = place.true.cameras[camera], place.true.T_ego_sensor, Board()
    sight = Sight(
        camera=lens, T_world_camera=true[camera], T_world_lidar=true[place.lidar_name], elevation_rad=SPAN
    )
    wanted = to_calibrate(Volume(near_m=spec.near_m, far_m=spec.far_m))
    held = draw_poses(
        sight, board, wanted, spec.boards, stream(place.seed, "fault", spec.name, camera, "boards")
    )
    if len(held) < LEAST_POSES:
        return None
    noise = stream(place.seed, "fault", spec.name, camera, "clicks")
    noise_px = spec.noise_px * noise.standard_normal((len(held), 4, 2))
    corners = [pose.apply(board.outer_m) for pose in held]
    at_px = np.array([lens.project(true[camera].inverse().apply(xyz)) for xyz in corners])
    lidar_m = np.array([true[place.lidar_name].inverse().apply(xyz) for xyz in corners])
    try:
        found = find_extrinsics(Pairs(lidar_m=lidar_m, image_px=at_px + noise_px), told)
    except CalibrationError:
        return None
    return place.true.T_camera_lidar(camera, place.lidar_name) @ found.T_camera_lidar.inverse(), noise_px


def receipts(spec: ClickNoise, step: Telling, witness: Witness) -> tuple[Receipt, ...]:
    """Per struck camera. Where the fault names cameras: that the others are told what was told before."""
    result: list[Receipt] = []
    for camera in struck(spec, witness.place):
        if step.realised.get(f"{camera} numbers") == 0.0:
            result.append(_none_found(spec, camera))
            continue
        realised = step.realised.get(f"{camera} clicks", 0.0)
        drawn = Transform.exp(np.array([step.realised.get(f"{camera} {a}", 0.0) for a in TWIST]))
        numbers = max(int(step.realised.get(f"{camera} numbers", 1)), 1)
        share = gain(_moved_px(step, camera, _found(step, camera)), _moved_px(step, camera, drawn))
        result.append(
            judge(
                fault=spec.name, quantity=f"{camera} clicks", unit="px", requested=spec.noise_px,
                realised=realised, measured=realised * share if np.isfinite(share) else share,
                systematic=5.0 * (SD_PX + SD_SHARE * realised), allowed=_allowed_px(spec.noise_px, numbers),
                note=NOTE,
            )
        )  # fmt: skip
    others = [
        (float(np.abs(_moved_px(step, name, _found(step, name))).max()), SD_PX)
        for name in spared(spec, witness.place)
        if name in witness.place.cameras
    ]
    result += untouched(fault=spec.name, quantity="the other cameras", unit="px", found=others, note=NOTE)
    return tuple(result)


def _none_found(spec: ClickNoise, camera: str) -> Receipt:
    """The camera is told what was told before: the fault took no effect."""
    return judge(
        fault=spec.name, quantity=f"{camera} clicks", unit="px", requested=spec.noise_px,
        realised=0.0, measured=0.0, systematic=5.0 * SD_PX, allowed=0.0,
        note="no calibration comes about: too few boards fit into the zone, or they do not determine a pose",
    )  # fmt: skip


def _found(step: Telling, camera: str) -> Transform:
    """How the told pose moved, in the camera's frame."""
    return told_pose(step.before, camera).inverse() @ told_pose(step.after, camera)


def _moved_px(step: Telling, camera: str, error: Transform) -> Float64[np.ndarray, "n 2"]:
    """What an error of the pose does to known points in the picture."""
    lens = step.before.cameras[camera]
    moved: np.ndarray = pixels(lens, error.inverse().apply(AHEAD_M)) - pixels(lens, AHEAD_M)
    return moved


def _allowed_px(noise_px: float, numbers: int) -> float:
    """How far the RMS of so many normal numbers may lie from its SD: beyond in one of a million draws."""
    low, high = np.sqrt(chdtri(numbers, [1.0 - 0.5 * RARE, 0.5 * RARE]) / numbers)
    return float(noise_px * max(1.0 - low, high - 1.0))


TOLD: tuple[CalibrationFault, ...] = (CalibrationFault(spec=ClickNoise, tell=clicked, receipts=receipts),)
