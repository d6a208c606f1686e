"""A small KITTI data set that a test writes: known boxes on flat ground, swept by rays, in all three layouts.

Everything is made here by KITTI's own formulas (development kit): the code under test is not used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

HEIGHT_M = 1.73
WIDTH_PX, HEIGHT_PX = 620, 188
RINGS = tuple(np.linspace(2.0, -20.0, 24))  # degrees, the uppermost first
COLUMNS = 720
KIND = {"car": "Car", "rider": "Cyclist", "pedestrian": "Pedestrian", "van": "Van"}


def _rotation(axis: str, degrees: float) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    turned = np.eye(3)
    turned[i, i] = turned[j, j] = c
    turned[i, j], turned[j, i] = -s, s
    return turned


# velodyne -> camera 0: axes swapped, and turned a little, as a real one is
TR_R = _rotation("x", 0.6) @ _rotation("y", -0.4) @ np.array([[0, -1.0, 0], [0, 0, -1.0], [1.0, 0, 0]])
TR_T = np.array([-0.02, -0.07, -0.29])
R0 = _rotation("z", 0.5) @ _rotation("y", 0.3)
P2 = np.array([[360.0, 0, 305.0, 22.0], [0, 360.0, 90.0, -0.2], [0, 0, 1, 0.003]])
IMU_R, IMU_T = _rotation("z", 0.7), np.array([-0.81, 0.32, -0.80])


def rect(xyz_velo: np.ndarray) -> np.ndarray:
    """Velodyne to rectified camera coordinates."""
    return np.asarray((xyz_velo @ TR_R.T + TR_T) @ R0.T)


def project(xyz_velo: np.ndarray) -> np.ndarray:
    """Velodyne points [n 3] to KITTI's pixels [n 2]."""
    homogeneous = np.c_[rect(xyz_velo), np.ones(len(xyz_velo))] @ P2.T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


@dataclass(frozen=True, kw_only=True)
class Box:
    """An upright box in the velodyne's frame: centre of its bottom, heading about z."""

    track: int
    category: str
    size_m: tuple[float, float, float]
    xyz_m: tuple[float, float, float]
    heading_rad: float
    occluded: int = 0
    truncated: float = 0

    @property
    def corners_m(self) -> np.ndarray:
        signs = np.array([(a, b, c) for a in (-0.5, 0.5) for b in (-0.5, 0.5) for c in (0.0, 1.0)])
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        return np.asarray((signs * np.array(self.size_m)) @ turn.T + np.array(self.xyz_m))

    @property
    def box_px(self) -> tuple[float, float, float, float]:
        uv = project(self.corners_m)
        x0, y0 = np.maximum(uv.min(axis=0), 0.0)
        x1, y1 = np.minimum(uv.max(axis=0), (WIDTH_PX - 1, HEIGHT_PX - 1))
        return float(x0), float(y0), float(x1), float(y1)


CAR = Box(track=3, category="car", size_m=(4.0, 1.7, 1.5), xyz_m=(14.0, 2.0, -HEIGHT_M), heading_rad=0.4)
RIDER = Box(track=7, category="rider", size_m=(1.8, 0.6, 1.7), xyz_m=(9.0, -2.5, -HEIGHT_M), heading_rad=0.0)
SCENE = (CAR, RIDER)


def drive(frames: int, *, step_m: float = 0.35) -> list[tuple[Box, ...]]:
    """The rider goes ahead by step_m a frame and the car comes nearer; the car leaves in the last frame."""
    x, y, z = RIDER.xyz_m
    cx, cy, cz = CAR.xyz_m
    return [
        (
            *((replace(CAR, xyz_m=(cx - 0.3 * f, cy, cz)),) if f < frames - 1 else ()),
            replace(RIDER, xyz_m=(x + step_m * f, y, z), heading_rad=0.02 * f),
        )
        for f in range(frames)
    ]


def sweep(boxes: Sequence[Box], rings: Sequence[float] = RINGS) -> tuple[np.ndarray, np.ndarray]:
    """Points [n 4] ring by ring, each once around counter-clockwise from straight ahead, and the track that
    each hits (-1: the ground). Surfaces lie 10 % inside the boxes: KITTI's boxes stand upright in the
    camera's frame, which is tilted by a degree, and that must not decide.
    """
    azimuth = (np.arange(COLUMNS) + 0.5) * 2.0 * np.pi / COLUMNS
    elevation = np.deg2rad(np.repeat(rings, COLUMNS))
    azimuth = np.tile(azimuth, len(rings))
    flat = np.cos(elevation)
    ray = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=1)
    with np.errstate(divide="ignore"):
        far = np.where(ray[:, 2] < 0.0, -HEIGHT_M / ray[:, 2], np.inf)
    far[far > 80.0] = np.inf
    owner = np.full(len(ray), -1)
    for box in boxes:
        c, s = np.cos(box.heading_rad), np.sin(box.heading_rad)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        middle = np.add(box.xyz_m, (0.0, 0.0, 0.5 * box.size_m[2]))
        origin, direction = -middle @ turn, ray @ turn
        half = 0.45 * np.array(box.size_m)
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (-half - origin) / direction, (half - origin) / direction
        enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
        hit = (enter < leave) & (enter > 0.0) & (enter < far)
        far[hit], owner[hit] = enter[hit], box.track
    seen = np.isfinite(far)
    xyz = ray[seen] * far[seen, None]
    reflectance = np.where(owner[seen] >= 0, 0.6, 0.2)
    return np.c_[xyz, reflectance].astype("<f4"), owner[seen]


def label_words(box: Box, *, tracking: bool) -> str:
    """The 15 words of a label."""
    x, y, z = rect(np.array([box.xyz_m]))[0]
    ahead = R0 @ TR_R @ np.array([np.cos(box.heading_rad), np.sin(box.heading_rad), 0.0])
    rotation_y = np.arctan2(-ahead[2], ahead[0])
    length, width, height = box.size_m
    truncated = f"{int(box.truncated)}" if tracking else f"{box.truncated:.2f}"
    numbers = (*box.box_px, height, width, length, x, y, z, rotation_y)
    alpha = rotation_y - np.arctan2(x, z)
    return f"{KIND[box.category]} {truncated} {box.occluded} {alpha:.6f} " + " ".join(
        f"{v:.6f}" for v in numbers
    )


DONT_CARE = "DontCare -1 -1 -10 5.00 5.00 20.00 20.00 -1 -1 -1 -1000 -1000 -1000 -10"


def image(frame: int) -> np.ndarray:
    """Noise whose brightness tells the frame."""
    rng = np.random.default_rng(frame)
    return (20 * frame + rng.integers(0, 20, (HEIGHT_PX, WIDTH_PX, 3))).astype(np.uint8)


def _row(values: np.ndarray) -> str:
    return " ".join(f"{v:.12e}" for v in np.asarray(values).ravel())


def calibration_text(*, tracking: bool = False) -> str:
    """As the object layout writes it, or the tracking layout."""
    mount, imu = np.c_[TR_R, TR_T], np.c_[IMU_R, IMU_T]
    names = (
        ("R_rect", "Tr_velo_cam", "Tr_imu_velo")
        if tracking
        else ("R0_rect:", "Tr_velo_to_cam:", "Tr_imu_to_velo:")
    )
    lines = [f"P{i}: {_row(P2)}" for i in range(4)]
    lines += [f"{name} {_row(value)}" for name, value in zip(names, (R0, mount, imu), strict=True)]
    return "\n".join(lines) + "\n"


def oxts_words(frame: int) -> str:
    """30 numbers; forward speed 5 + frame, yaw rate 0.1, gravity."""
    values = [
        49.0,
        8.4,
        110.0,
        0.0,
        0.0,
        0.3,
        0.0,
        0.0,
        5.0 + frame,
        0.1,
        0.0,
        0.2,
        0.3,
        9.81,
        0.2,
        0.3,
        9.81,
    ]
    values += [0.01, 0.02, 0.1, 0.01, 0.02, 0.1, 0.05, 0.01, 4, 9, 4, 4, 0]
    assert len(values) == 30
    return " ".join(f"{v:g}" for v in values)


def _write(path: Path, data: str | bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.encode() if isinstance(data, str) else data)


def _picture(path: Path, frame: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image(frame)[..., ::-1])


def write_object(root: Path, frames: Mapping[int, Sequence[Box]]) -> Path:
    """The object layout."""
    for number, boxes in frames.items():
        stem = f"{number:06d}"
        _write(root / f"velodyne/{stem}.bin", sweep(boxes)[0].tobytes())
        _picture(root / f"image_2/{stem}.png", number)
        _write(root / f"calib/{stem}.txt", calibration_text())
        labels = [label_words(box, tracking=False) for box in boxes]
        _write(root / f"label_2/{stem}.txt", "\n".join([*labels, DONT_CARE]) + "\n")
    return root


def write_tracking(
    root: Path, boxes: Sequence[Sequence[Box]], *, sequence: str = "0000", oxts: bool = True
) -> Path:
    """One sequence of the tracking layout."""
    labels = []
    for frame, here in enumerate(boxes):
        _write(root / f"velodyne/{sequence}/{frame:06d}.bin", sweep(here)[0].tobytes())
        _picture(root / f"image_02/{sequence}/{frame:06d}.png", frame)
        labels += [f"{frame} {box.track} {label_words(box, tracking=True)}" for box in here]
        labels.append(f"{frame} -1 {DONT_CARE}")
    _write(root / f"calib/{sequence}.txt", calibration_text(tracking=True))
    _write(root / f"label_02/{sequence}.txt", "\n".join(labels) + "\n")
    if oxts:
        _write(root / f"oxts/{sequence}.txt", "\n".join(oxts_words(f) for f in range(len(boxes))) + "\n")
    return root


DAY, DRIVE = "2011_09_26", "2011_09_26_drive_0005_sync"
RAW_PERIOD_S = 0.1036


def times_text(frames: int, late_s: float) -> str:
    """timestamps.txt."""
    lines = []
    for frame in range(frames):
        seconds = 25.5 + RAW_PERIOD_S * frame + late_s
        lines.append(f"2011-09-26 13:02:{seconds:012.9f}")
    return "\n".join(lines) + "\n"


def write_raw(root: Path, boxes: Sequence[Sequence[Box]]) -> Path:
    """One drive of a day of the raw layout; images are taken 2 ms before the sweeps' stamps."""
    rows = [f"P_rect_02: {_row(P2)}", f"R_rect_00: {_row(R0)}"]
    _write(root / "calib_cam_to_cam.txt", "calib_time: 09-Jan-2012 13:57:47\n" + "\n".join(rows) + "\n")
    for name, rotation, shift in (("velo_to_cam", TR_R, TR_T), ("imu_to_velo", IMU_R, IMU_T)):
        _write(root / f"calib_{name}.txt", f"calib_time: x\nR: {_row(rotation)}\nT: {_row(shift)}\n")
    for frame, here in enumerate(boxes):
        _write(root / DRIVE / f"velodyne_points/data/{frame:010d}.bin", sweep(here)[0].tobytes())
        _picture(root / DRIVE / f"image_02/data/{frame:010d}.png", frame)
        _write(root / DRIVE / f"oxts/data/{frame:010d}.txt", oxts_words(frame) + "\n")
    for folder, late_s in (("velodyne_points", 0.0), ("image_02", -0.002), ("oxts", 0.001)):
        _write(root / DRIVE / folder / "timestamps.txt", times_text(len(boxes), late_s))
    _write(root / DRIVE / "tracklet_labels.xml", tracklets_text(boxes))
    return root


def tracklets_text(boxes: Sequence[Sequence[Box]]) -> str:
    """tracklet_labels.xml; every track is labelled in consecutive frames."""
    tracks: dict[int, list[tuple[int, Box]]] = {}
    for frame, here in enumerate(boxes):
        for box in here:
            tracks.setdefault(box.track, []).append((frame, box))
    items = []
    for seen in tracks.values():
        first, box = seen[0]
        poses = "".join(
            f"<item><tx>{b.xyz_m[0]:.6f}</tx><ty>{b.xyz_m[1]:.6f}</ty><tz>{b.xyz_m[2]:.6f}</tz>"
            f"<rx>0</rx><ry>0</ry><rz>{b.heading_rad:.6f}</rz><state>2</state>"
            f"<occlusion>{b.occluded}</occlusion><truncation>{int(b.truncated)}</truncation></item>"
            for _, b in seen
        )
        length, width, height = box.size_m
        items.append(
            f"<item><objectType>{KIND[box.category]}</objectType><h>{height}</h><w>{width}</w><l>{length}</l>"
            f"<first_frame>{first}</first_frame><poses><count>{len(seen)}</count>{poses}</poses></item>"
        )
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<!DOCTYPE boost_serialization>\n'
        '<boost_serialization signature="serialization::archive" version="9">\n'
        f"<tracklets><count>{len(items)}</count>"
        + "\n".join(items)
        + "</tracklets>\n</boost_serialization>\n"
    )
