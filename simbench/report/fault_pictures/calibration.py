"""Where LiDAR points lie in a camera's picture, and where the fusion is told that they lie."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera, inside_box, project_points
from fusion.geometry import Transform
from fusion.messages import BoxPx, Calibration
from scenarios.faults import FaultSpec
from simbench.motion import at
from simbench.proving.ground import swept
from simbench.report import palette
from simbench.report.fault_pictures.sketch import Sketch, drive_of

CAMERA = "cam-front-left"
FEW = 0.5  # share of the points that must stay in the picture for a part of it to be looked at
EVERY = 3  # of the points, so that single ones can be followed
SHARE = (0.55, 0.2)  # of the picture's width that is drawn, and its height over that width


def sketch(spec: FaultSpec, before: Any, after: Any) -> Sketch:
    """Of the points of the proving ground's first sweep that lie in the picture."""
    xyz_m = swept().captured.measured.sweeps[0].scan.xyz_m[::EVERY].astype(np.float64)
    lidar = swept().staged.rig.lidar_name
    lens = _true(before, before)[1]
    picture = (0.0, 0.0, float(lens.width_px), float(lens.height_px))

    def both(data: Any) -> tuple[np.ndarray, np.ndarray]:
        (T_ego_camera, bent), told = _true(data, before), _told(data)
        T_ego_lidar = _told(before).T_ego_sensor[lidar]
        return (
            project_points(xyz_m, T_ego_camera.inverse() @ T_ego_lidar, bent),
            project_points(xyz_m, told.T_camera_lidar(CAMERA, lidar), told.cameras[CAMERA]),
        )

    one, two = both(before), both(after)
    seen = inside_box(one[0], picture)
    true_px, told_px = (uv[seen] for uv in two)
    left = int(inside_box(told_px, picture).sum())
    view = _whole(picture, told_px) if left < FEW * len(told_px) else _part(true_px, told_px, lens)
    drawn = seen & inside_box(two[0], view)
    before_px, after_px = ({"true": true[drawn], "told": told[drawn]} for true, told in (one, two))

    def paint(figure: Any) -> None:
        axes = figure.subplots()
        true, told = after_px["true"], after_px["told"]
        gaps = np.full(len(true), np.nan)
        u, v = (np.stack([true[:, i], told[:, i], gaps], axis=1).ravel() for i in (0, 1))
        axes.plot(u, v, color=palette.RAW, linewidth=0.8, alpha=0.7)
        axes.plot(*true.T, "o", color=palette.CLEAN, markersize=3.0, mew=0, label="where they are")
        axes.plot(*told.T, "o", color=palette.RAW, markersize=3.0, mew=0, label="where the fusion is told")
        axes.plot([0, lens.width_px, lens.width_px, 0, 0], [0, 0, lens.height_px, lens.height_px, 0],
                  color=palette.MUTED, linewidth=0.8)  # fmt: skip
        axes.set_xlim(view[0], view[2])
        axes.set_ylim(view[3], view[1])
        axes.set_aspect("equal")
        axes.tick_params(length=0)
        axes.legend(
            ncols=2, loc="lower left", bbox_to_anchor=(-0.02, 0.99), markerscale=1.8, handletextpad=0.1
        )
        axes.set_xlabel(
            f"{CAMERA} (px); of {seen.sum()} LiDAR points in the picture, {left} are told to be in it",
            fontsize=9,
        )

    return Sketch(before=before_px, after=after_px, paint=paint, height=235.0)


def _told(data: Any) -> Calibration:
    return data if isinstance(data, Calibration) else drive_of(data[0]).drawn.told


def _true(data: Any, before: Any) -> tuple[Transform, PinholeCamera]:
    """T_ego_camera at the end of the drive, and the lens: as they are, whatever is told."""
    if isinstance(data, Calibration):
        return before.T_ego_sensor[CAMERA], before.cameras[CAMERA]
    drive, rig = drive_of(data[0]), data[1]
    end_ns = np.array([round(1e9 * drive.site.duration_s)], dtype=np.int64)
    body, camera = at(drive.motion.shaken_ego(end_ns)), at(drive.motion.sensor(CAMERA, end_ns))
    return body.inverse() @ camera, rig.pinholes[CAMERA]


def _part(
    true_px: Float64[np.ndarray, "n 2"], told_px: Float64[np.ndarray, "n 2"], lens: PinholeCamera
) -> BoxPx:
    """To the side where a point is told farthest from where it is, within the picture."""
    size = np.array([lens.width_px, lens.height_px], dtype=np.float64)
    half = 0.5 * lens.width_px * np.array(SHARE)
    worst = int(np.nan_to_num(np.hypot(*(told_px - true_px).T)).argmax())
    wanted = np.array([true_px[worst, 0], np.median(true_px[:, 1])])
    middle = np.clip(wanted, half, size - half)
    (left, top), (right, bottom) = middle - half, middle + half
    return (float(left), float(top), float(right), float(bottom))


def _whole(picture: BoxPx, told_px: Float64[np.ndarray, "n 2"]) -> BoxPx:
    """The picture, and what is told to lie within a picture's width of it."""
    x0, y0, x1, y1 = picture
    reach = x1 - x0
    near = told_px[inside_box(told_px, (x0 - reach, y0 - reach, x1 + reach, y1 + reach))]
    low, high = np.min([(x0, y0), *near], axis=0), np.max([(x1, y1), *near], axis=0)
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
