"""Recordings written as KITTI's layouts, which our own reader (`formats/kitti.py`) and others' read.

    object     training/{velodyne, image_2, calib, label_2}/000000.*            one frame each
    tracking   training/{velodyne, image_02}/0000/000000.*, {calib, label_02, oxts}/0000.txt
    raw        2000_01_01/calib_*.txt and 2000_01_01/2000_01_01_drive_0000_sync/, in which
               {velodyne_points, image_02, oxts}/ and tracklet_labels.xml       with exact times

What is lost stands in docs/formats.md. Each function makes or takes an empty folder and returns the number of
frames written. BadInput: there is something in the folder, or the recording has not what KITTI needs.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from simbench.files import prepare_empty_folder
from simbench.formats.kitti_write.drive import WrittenDrive, written_drive
from simbench.formats.kitti_write.lines import write_object_layout, write_tracking_layout
from simbench.formats.kitti_write.raw import day_of, write_raw_layout
from simbench.recording import Recording

WrittenLayout = Literal["object", "tracking", "raw"]


def write_kitti(
    recording: Recording,
    folder: Path,
    *,
    layout: WrittenLayout = "raw",
    camera: str | None = None,
    number: int = 0,
) -> int:
    """Write a recording; the number of frames. camera: default, the one that looks most nearly where the
    LiDAR's x points. number: of the drive, the sequence or the first frame; our reader takes it for the seed.
    """
    drive = written_drive(recording, camera)
    prepare_empty_folder(folder)
    name, write = LAYOUTS[layout]
    write(drive, folder / name, number)
    return len(drive.frames)


LAYOUTS: dict[WrittenLayout, tuple[str, Callable[[WrittenDrive, Path, int], None]]] = {
    "object": ("training", write_object_layout),
    "tracking": ("training", write_tracking_layout),
    "raw": (day_of(), write_raw_layout),
}
"""Of every layout, the folder in the folder that a reader is pointed at, and who fills it."""


def write_kitti_object(recording: Recording, folder: Path, camera: str | None = None, number: int = 0) -> int:
    """`write_kitti` of the object layout."""
    return write_kitti(recording, folder, layout="object", camera=camera, number=number)


def write_kitti_tracking(
    recording: Recording, folder: Path, camera: str | None = None, number: int = 0
) -> int:
    """`write_kitti` of the tracking layout."""
    return write_kitti(recording, folder, layout="tracking", camera=camera, number=number)


def write_kitti_raw(recording: Recording, folder: Path, camera: str | None = None, number: int = 0) -> int:
    """`write_kitti` of the raw layout."""
    return write_kitti(recording, folder, layout="raw", camera=camera, number=number)
