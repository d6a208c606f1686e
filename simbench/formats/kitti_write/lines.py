"""The layouts whose labels are lines of text: object and tracking."""

from __future__ import annotations

from pathlib import Path

from simbench.files import write_text
from simbench.formats.kitti_write.drive import WrittenDrive
from simbench.formats.kitti_write.files import write_picture, write_sweep
from simbench.formats.kitti_write.kinds import kind_of, occlusion
from simbench.formats.kitti_write.objects import Labelled
from simbench.formats.kitti_write.oxts import oxts_text
from simbench.formats.kitti_write.text import calibration_text, label_words, region_words
from simbench.formats.labels import OUTSIDE_SHARE, UNKNOWN, VISIBLE_SHARE

SHARES = {level: share for level, share in enumerate(VISIBLE_SHARE) if level != UNKNOWN}
PARTLY_OUTSIDE = 0.5 * OUTSIDE_SHARE[1]  # from here on the level 1 is nearer than 0
HIDDEN = 2  # the tracking layout's level of truncation for what the labellers left out


def write_object_layout(drive: WrittenDrive, folder: Path, number: int) -> None:
    """`training` with a file per frame in velodyne, image_2, calib and label_2, from `number` on."""
    for part in ("velodyne", "image_2", "calib", "label_2"):
        (folder / part).mkdir(parents=True)
    calibration = calibration_text(drive.camera, drive.T_camera_lidar, drive.T_lidar_ego, tracking=False)
    for index, frame in enumerate(drive.frames, start=number):
        stem = f"{index:06d}"
        write_sweep(frame.scan, folder / f"velodyne/{stem}.bin")
        write_picture(frame, drive.lens, folder / f"image_2/{stem}.png")
        write_text(folder / f"calib/{stem}.txt", calibration)
        shown = [label for label in frame.labels if label.known and label.box_px is not None]
        lines = [_object_words(label) for label in shown if label.visible_fraction > 0.0]
        lines += [region_words(label) for label in shown if label.visible_fraction == 0.0]
        write_text(folder / f"label_2/{stem}.txt", "".join(line + "\n" for line in lines))


def _object_words(label: Labelled) -> str:
    kind = kind_of(label.category)
    assert kind is not None
    level = occlusion(label.visible_fraction, label.outside, SHARES)
    return label_words(label, kind, label.outside, level)


def write_tracking_layout(drive: WrittenDrive, folder: Path, number: int) -> None:
    """`training` with one sequence of this number in velodyne, image_02, calib, label_02 and oxts."""
    name = f"{number:04d}"
    for part in (f"velodyne/{name}", f"image_02/{name}", "calib", "label_02"):
        (folder / part).mkdir(parents=True)
    calibration = calibration_text(drive.camera, drive.T_camera_lidar, drive.T_lidar_ego, tracking=True)
    write_text(folder / f"calib/{name}.txt", calibration)
    lines = []
    for index, frame in enumerate(drive.frames):
        write_sweep(frame.scan, folder / f"velodyne/{name}/{index:06d}.bin")
        write_picture(frame, drive.lens, folder / f"image_02/{name}/{index:06d}.png")
        lines += [
            f"{index} {label.object_id} {tracking_words(label)}"
            for label in frame.labels
            if label.known and label.box_px is not None
        ]
    write_text(folder / f"label_02/{name}.txt", "".join(line + "\n" for line in lines))
    motion = oxts_text(drive)
    if motion is not None:
        (folder / "oxts").mkdir()
        write_text(folder / f"oxts/{name}.txt", "".join(line + "\n" for line in motion))


def tracking_words(label: Labelled) -> str:
    """A label of the tracking layout after frame and track."""
    kind = kind_of(label.category)
    assert kind is not None
    outside = int(label.outside >= PARTLY_OUTSIDE)
    level = occlusion(label.visible_fraction, OUTSIDE_SHARE[outside], SHARES)
    if label.visible_fraction == 0.0:
        outside = HIDDEN
    return label_words(label, "Person" if kind == "Person_sitting" else kind, outside, level)
