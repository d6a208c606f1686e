"""The raw layout: a day's calibration and one drive with exact times."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from simbench.files import write_text
from simbench.formats.kitti_write.drive import WrittenDrive
from simbench.formats.kitti_write.files import write_picture, write_sweep
from simbench.formats.kitti_write.oxts import oxts_text
from simbench.formats.kitti_write.text import EPOCH, projection, row, time_text
from simbench.formats.kitti_write.tracklets import tracklets_text

CAMERAS = ("00", "01", "02", "03")


def day_of() -> str:
    """The folder of a day, '2000_01_01'."""
    return f"{EPOCH:%Y_%m_%d}"


def write_raw_layout(drive: WrittenDrive, folder: Path, number: int) -> None:
    """Three calibration files and `DAY_drive_NNNN_sync` below the folder of the day."""
    root = folder / f"{folder.name}_drive_{number:04d}_sync"
    motion = oxts_text(drive)
    for part in ("velodyne_points", "image_02", *(() if motion is None else ("oxts",))):
        (root / part / "data").mkdir(parents=True)
    write_calibration(drive, folder)
    for index, frame in enumerate(drive.frames):
        write_sweep(frame.scan, root / f"velodyne_points/data/{index:010d}.bin")
        write_picture(frame, drive.lens, root / f"image_02/data/{index:010d}.png")
    frames = drive.frames
    ends = [f.scan.stamp_ns + int(f.scan.offset_ns.max(initial=0)) for f in frames]
    _write_times(root / "velodyne_points/timestamps_start.txt", [f.scan.stamp_ns for f in frames])
    _write_times(root / "velodyne_points/timestamps.txt", [f.stamp_ns for f in frames])
    _write_times(root / "velodyne_points/timestamps_end.txt", ends)
    _write_times(root / "image_02/timestamps.txt", [f.image_ns for f in frames])
    if motion is not None:
        for index, line in enumerate(motion):
            write_text(root / f"oxts/data/{index:010d}.txt", line + "\n")
        _write_times(root / "oxts/timestamps.txt", [f.ego.stamp_ns for f in frames if f.ego is not None])
    write_text(root / "tracklet_labels.xml", tracklets_text(drive))


def _write_times(path: Path, times_ns: list[int]) -> None:
    write_text(path, "".join(time_text(t_ns) + "\n" for t_ns in times_ns))


def write_calibration(drive: WrittenDrive, folder: Path) -> None:
    """calib_cam_to_cam.txt, calib_velo_to_cam.txt, calib_imu_to_velo.txt. All four cameras are the chosen
    one; K and D are its lens, P_rect its straight image."""
    size = row((drive.lens.width_px, drive.lens.height_px))
    straight = projection(drive.camera)
    when = f"calib_time: {EPOCH:%d-%b-%Y %H:%M:%S}\n"
    lines = ["corner_dist: 0.0"]
    for camera in CAMERAS:
        lines += [
            f"S_{camera}: {size}", f"K_{camera}: {row(straight[:, :3])}",
            f"D_{camera}: {row(drive.lens.distortion)}", f"R_{camera}: {row(np.eye(3))}",
            f"T_{camera}: {row(np.zeros(3))}", f"S_rect_{camera}: {size}",
            f"R_rect_{camera}: {row(np.eye(3))}", f"P_rect_{camera}: {row(straight)}",
        ]  # fmt: skip
    write_text(folder / "calib_cam_to_cam.txt", when + "\n".join(lines) + "\n")
    for name, mount in (("velo_to_cam", drive.T_camera_lidar), ("imu_to_velo", drive.T_lidar_ego)):
        text = f"R: {row(mount.rotation)}\nT: {row(mount.translation_m)}\n"
        unused = "delta_f: 0.0 0.0\ndelta_c: 0.0 0.0\n" if name == "velo_to_cam" else ""
        write_text(folder / f"calib_{name}.txt", when + text + unused)
