"""One drive of KITTI's raw layout: exact times, and tracklets instead of label lines.

A tracklet's boxes stand upright in the LiDAR's frame; they become labels in the frame of the rectified camera
(the tilt between the two, below one degree, is neglected). Tracklets have no 2-D boxes: the box is the
outline of the projected 3-D box, cut at the image's border; None behind the camera or outside the image.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx
from scenarios.errors import BadInput, show
from simbench.formats.calibration import (
    NAMES,
    SHAPE,
    KittiCalibration,
    Row,
    calibration_of,
    found,
    matrix,
)
from simbench.formats.folder import Folder, Line
from simbench.formats.kitti import Drive, Oxts, Snapshot, Span, image_named, oxts_of, sweeps
from simbench.formats.labels import CATEGORY, VISIBLE_SHARE, Label

CAMERA_FILE, LIDAR_FILE, IMU_FILE = "calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt"
TEN_DIGITS = re.compile(r"(\d{10})\.bin")
OCCLUDED = {-1: 1.0, 0: VISIBLE_SHARE[0], 1: VISIBLE_SHARE[1], 2: 0.0}  # 2: fully; -1: not said
TRUNCATED = {-1: 0.0, 0: 0.0, 1: 0.5, 2: 1.0, 99: 1.0}  # 2: outside the image, 99: behind it
NEAREST_M = 0.5


def read_raw(folder: Folder, name: str, number: int, span: Span | None) -> Drive:
    """A drive with its calibration, times, motion and labels. BadInput: a file is missing or malformed."""
    calibration = raw_calibration(folder)
    files = sweeps(folder, f"{name}/velodyne_points/data", TEN_DIGITS, span)
    swept = timestamps_ns(folder, f"{name}/velodyne_points/timestamps.txt")
    taken = timestamps_ns(folder, f"{name}/image_02/timestamps.txt")
    with_oxts = folder.has(f"{name}/oxts")
    measured = timestamps_ns(folder, f"{name}/oxts/timestamps.txt") if with_oxts else []
    snapshots = []
    start_ns = _at(swept, files[0][0], folder, name) if files else 0
    pinhole = None
    labels: dict[int, list[Label]] = {}
    for frame, file in files:
        image = image_named(folder, f"{name}/image_02/data/{frame:010d}")
        if pinhole is None:
            height_px, width_px = folder.image(image).shape[:2]
            pinhole = calibration.camera(width_px, height_px)
            labels = tracklets(folder, f"{name}/tracklet_labels.xml", calibration, pinhole)
        oxts: Oxts | None = None
        if with_oxts:
            part = f"{name}/oxts/data/{frame:010d}.txt"
            lines = folder.lines(part)
            if len(lines) != 1:
                raise BadInput(f"holds {len(lines)} lines, must hold one", file=folder.name_of(part))
            oxts = oxts_of(lines[0], _at(measured, frame, folder, f"{name}/oxts") - start_ns)
        snapshots.append(
            Snapshot(
                frame=frame,
                stamp_ns=_at(swept, frame, folder, f"{name}/velodyne_points") - start_ns,
                image_ns=_at(taken, frame, folder, f"{name}/image_02") - start_ns,
                points=f"{name}/velodyne_points/data/{file}",
                image=image,
                labels=tuple(labels.get(frame, ())),
                oxts=oxts,
            )
        )
    if any(b.stamp_ns <= a.stamp_ns for a, b in pairwise(snapshots)):
        raise BadInput("times do not ascend", file=folder.name_of(f"{name}/velodyne_points/timestamps.txt"))
    return Drive(
        layout="raw",
        number=number,
        name=name,
        folder=folder,
        calibration=calibration,
        snapshots=tuple(snapshots),
    )


def raw_calibration(folder: Folder) -> KittiCalibration:
    """From the day's three files; the IMU's may be missing."""
    by_key = {line.words[0].rstrip(":"): line for line in folder.lines(CAMERA_FILE)}
    rows: dict[str, Row | None] = {}
    for name in ("projection", "rectification"):
        key = NAMES[name][-1]
        rows[name] = matrix(found(by_key.get(key), (key,), folder.name_of(CAMERA_FILE)), SHAPE[name])
    rows["lidar"] = _rigid(folder, LIDAR_FILE)
    rows["imu"] = _rigid(folder, IMU_FILE) if folder.has(IMU_FILE) else None
    return calibration_of(rows)


def _rigid(folder: Folder, part: str) -> Row:
    """[R | t] of a file with a line R and a line T."""
    by_key = {line.words[0].rstrip(":"): line for line in folder.lines(part)}
    line, rotation = matrix(found(by_key.get("R"), ("R",), folder.name_of(part)), (3, 3))
    _, shift = matrix(found(by_key.get("T"), ("T",), folder.name_of(part)), (3, 1))
    return line, np.hstack([rotation, shift])


def timestamps_ns(folder: Folder, part: str) -> list[int]:
    """Nanoseconds since 1970 (as if the clock were UTC) of every line '2011-09-26 13:02:25.964389445'."""
    return [_time_ns(line) for line in folder.lines(part)]


def _time_ns(line: Line) -> int:
    text = " ".join(line.words)
    whole, _, fraction = text.partition(".")
    if not re.fullmatch(r"\d{1,9}", fraction or "0"):
        raise line.error(f"{show(text)} is no time")
    try:
        since = datetime.strptime(whole, "%Y-%m-%d %H:%M:%S") - datetime(1970, 1, 1)
    except ValueError:
        raise line.error(f"{show(text)} is no time", allowed="2011-09-26 13:02:25.964389445") from None
    return (since.days * 86_400 + since.seconds) * 10**9 + int((fraction or "0").ljust(9, "0"))


def _at(times_ns: Sequence[int], frame: int, folder: Folder, part: str) -> int:
    if frame >= len(times_ns):
        name = folder.name_of(f"{part}/timestamps.txt")
        raise BadInput(f"holds {len(times_ns)} times, frame {frame} has none", file=name)
    return times_ns[frame]


# -- tracklets --------------------------------------------------------------------------------------------


def tracklets(
    folder: Folder, part: str, calibration: KittiCalibration, camera: PinholeCamera
) -> dict[int, list[Label]]:
    """Labels by frame; a tracklet's number is its track. BadInput: no XML, or not of tracklets."""
    name = folder.name_of(part)
    try:
        text = folder.text(part).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise BadInput("not UTF-8 text", file=name) from None
    if "<!ENTITY" in text:
        raise BadInput("defines an XML entity, which no tracklet needs", file=name)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise BadInput(f"not XML: {error.msg}", file=name, line=error.position[0]) from None
    items = root.findall("./tracklets/item")
    if root.find("./tracklets") is None:
        raise BadInput("holds no tracklets", file=name)
    labels: dict[int, list[Label]] = {}
    for track, item in enumerate(items):
        one = _Node(file=name, words=f"tracklet {track}", item=item)
        kind = one.word("objectType").replace(" ", "_").replace("Person_(sitting)", "Person_sitting")
        if kind not in CATEGORY:
            raise one.error(f"unknown type {show(kind)}; known are {', '.join(CATEGORY)}")
        height, width, length = (one.number(key) for key in ("h", "w", "l"))
        if not all(0.0 < side < 100.0 for side in (height, width, length)):
            raise one.error(f"a side of {length:g} x {width:g} x {height:g} m is no size")
        first = int(one.number("first_frame"))
        for step, pose in enumerate(item.findall("./poses/item")):
            at = _Node(file=name, words=f"tracklet {track}, pose {step}", item=pose)
            label = _label(
                at, first + step, track, CATEGORY[kind], (length, width, height), calibration, camera
            )
            labels.setdefault(first + step, []).append(label)
    return labels


class _Node:
    """One XML element and how messages name it."""

    def __init__(self, *, file: str, words: str, item: ElementTree.Element) -> None:
        self._file, self._words, self._item = file, words, item

    def error(self, problem: str) -> BadInput:
        return BadInput(f"{self._words}: {problem}", file=self._file)

    def word(self, key: str) -> str:
        text = self._item.findtext(key)
        if text is None:
            raise self.error(f"has no <{key}>")
        return text.strip()

    def number(self, key: str) -> float:
        text = self.word(key)
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not abs(value) < 1e6:
            raise self.error(f"<{key}> must be a number, is {show(text)}")
        return value


def _label(
    at: _Node,
    frame: int,
    track: int,
    category: str,
    size_m: tuple[float, float, float],
    calibration: KittiCalibration,
    camera: PinholeCamera,
) -> Label:
    bottom = np.array([at.number(key) for key in ("tx", "ty", "tz")])
    heading = at.number("rz")
    occluded, truncated = int(at.number("occlusion")), int(at.number("truncation"))
    if occluded not in OCCLUDED or truncated not in TRUNCATED:
        raise at.error(f"unknown levels: occlusion {occluded}, truncation {truncated}")
    T_rect_lidar = calibration.T_rect_lidar
    ahead = T_rect_lidar.rotation @ np.array([np.cos(heading), np.sin(heading), 0.0])
    yaw = float(np.arctan2(-ahead[2], ahead[0]))
    x, y, z = (float(v) for v in T_rect_lidar.apply(bottom))
    box = None if truncated in (2, 99) else _outline(bottom, heading, size_m, calibration, camera)
    return Label(
        frame=frame,
        track=track,
        category=category,
        box_px=box,
        visible_fraction=OCCLUDED[occluded] * (1.0 - TRUNCATED[truncated]),
        occlusion_known=occluded >= 0,
        size_m=size_m,
        bottom_m=(x, y, z),
        yaw_rad=yaw,
    )


def _outline(
    bottom_lidar_m: np.ndarray,
    heading_rad: float,
    size_m: tuple[float, float, float],
    calibration: KittiCalibration,
    camera: PinholeCamera,
) -> BoxPx | None:
    """Around the projected corners, in KITTI's pixels."""
    signs = np.array([(a, b, c) for a in (-0.5, 0.5) for b in (-0.5, 0.5) for c in (0.0, 1.0)])
    corners = signs * np.array(size_m)
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    turned = corners @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T + bottom_lidar_m
    in_camera = (calibration.T_camera_rect @ calibration.T_rect_lidar).apply(turned)
    if in_camera[:, 2].min() < NEAREST_M:
        return None
    uv = camera.project(in_camera)
    x0, y0 = np.maximum(uv.min(axis=0), 0.0)
    x1, y1 = np.minimum(uv.max(axis=0), (camera.width_px, camera.height_px))
    return (
        (float(x0) - 0.5, float(y0) - 0.5, float(x1) - 0.5, float(y1) - 0.5) if x0 < x1 and y0 < y1 else None
    )
