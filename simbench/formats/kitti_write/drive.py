"""What KITTI's layouts keep of a recording: one LiDAR, one camera, frames of a sweep and an image, 3-D boxes.

Two times of a frame are worth telling apart. A frame's *stamp* is when the LiDAR's clock claims to look along
the camera's axis, as in KITTI's own `timestamps.txt`; its *instant* is when it really did. The 3-D boxes are
the true ones at the instant, about the LiDAR as it really stood then, so that they fit the points. The 2-D
boxes are those of the image.

The rectified camera 0 of the files is the chosen camera itself: no rotation, no offset between the two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan
from scenarios.errors import BadInput, nearest, show
from simbench.formats.kitti_write.objects import Labelled, labelled_objects, labels_of
from simbench.formats.kitti_write.rectify import straight
from simbench.recording import Recording
from simbench.score.frames import nearest as nearest_stamp
from simbench.truth import ObjectInfo, ScanTruth

AXIS_RAD = np.deg2rad(10.0)  # points so near to the camera's axis say when the LiDAR looked along it


@dataclass(frozen=True, kw_only=True, eq=False)
class WrittenFrame:
    """A sweep with the image that is nearest to it. picture: None where the recording has none.

    T_world_ego: true, at the instant. ego: what was measured nearest to the stamp; None where nothing was.
    """

    scan: LidarScan
    picture: CameraImage | None
    stamp_ns: int
    instant_ns: int
    image_ns: int
    labels: tuple[Labelled, ...]
    T_world_ego: Transform
    ego: EgoMotion | None


@dataclass(frozen=True, kw_only=True, eq=False)
class WrittenDrive:
    """lens: as told, with its distortion; camera: the straight one that the files describe."""

    lens: PinholeCamera
    camera: PinholeCamera
    T_camera_lidar: Transform
    T_lidar_ego: Transform
    objects: tuple[ObjectInfo, ...]
    frames: tuple[WrittenFrame, ...]


def written_drive(recording: Recording, camera: str | None = None) -> WrittenDrive:
    """What the files are made of. camera: default, the one that looks most nearly where the LiDAR's x points.

    BadInput: there is no sweep, not one LiDAR, no such camera, or no image near any sweep.
    """
    scans = _scans(recording)
    name = _camera(recording, scans[0].sensor, camera)
    told = recording.calibration
    lens = told.cameras[name]
    T_camera_lidar = told.T_camera_lidar(name, scans[0].sensor)
    drive = WrittenDrive(
        lens=lens,
        camera=straight(lens),
        T_camera_lidar=T_camera_lidar,
        T_lidar_ego=told.T_ego_sensor[scans[0].sensor].inverse(),
        objects=labelled_objects(recording.truth.objects),
        frames=(),
    )
    frames = tuple(_frames(recording, drive, name, scans))
    if not frames:
        raise BadInput(f"no sweep of the recording has an image of {show(name)} within half a period")
    return replace(drive, frames=frames)


def _scans(recording: Recording) -> list[LidarScan]:
    """The sweeps by their stamps, each once."""
    found = {(m.sensor, m.seq): m for m in reversed(recording.messages) if isinstance(m, LidarScan)}
    sensors = sorted({sensor for sensor, _ in found})
    if not sensors:
        raise BadInput("the recording has no sweep of a LiDAR")
    if len(sensors) > 1:
        raise BadInput(f"the recording has {len(sensors)} LiDARs ({', '.join(sensors)}); KITTI has one")
    return sorted(found.values(), key=lambda scan: (scan.stamp_ns, scan.seq))


def _camera(recording: Recording, lidar: str, wanted: str | None) -> str:
    told = recording.calibration
    if not told.cameras:
        raise BadInput("the recording has no camera; KITTI needs one")
    if wanted is None:
        ahead = {name: float(told.T_camera_lidar(name, lidar).rotation[2, 0]) for name in told.cameras}
        return min(ahead, key=lambda name: (-ahead[name], name))
    if wanted not in told.cameras:
        known = sorted(told.cameras)
        raise BadInput(
            f"unknown camera {show(wanted)}", allowed=", ".join(known), hint=nearest(wanted, known)
        )
    return wanted


# -- frames -----------------------------------------------------------------------------------------------


def _frames(
    recording: Recording, drive: WrittenDrive, camera: str, scans: Sequence[LidarScan]
) -> Iterator[WrittenFrame]:
    truth = recording.truth
    known = {(t.sensor, t.seq): t for t in truth.scans}
    shown = {t.seq: t for t in truth.images if t.sensor == camera}
    stamps = {
        m.seq: m.stamp_ns
        for m in reversed(recording.messages)
        if isinstance(m, Detections | CameraImage) and m.sensor == camera and m.seq in shown
    }
    pictures = {m.seq: m for m in recording.messages if isinstance(m, CameraImage) and m.sensor == camera}
    measured = [m for m in recording.messages if isinstance(m, EgoMotion)]
    seqs, claimed = list(stamps), np.array(list(stamps.values()), dtype=np.int64)
    felt = np.array([m.stamp_ns for m in measured], dtype=np.int64)
    for scan in scans:
        hits = known[scan.sensor, scan.seq]
        stamp_ns, instant_ns = _passing(scan, hits, drive.T_camera_lidar)
        at = nearest_stamp(claimed, stamp_ns, truth.period_ns / 2)
        if at is None:
            continue
        view = shown[seqs[at]]
        ego = nearest_stamp(felt, stamp_ns, np.inf)
        (rotation,), (translation_m,) = truth.poses.ego(np.array([instant_ns], dtype=np.int64))
        yield WrittenFrame(
            scan=scan,
            picture=pictures.get(view.seq),
            stamp_ns=stamp_ns,
            instant_ns=instant_ns,
            image_ns=int(claimed[at]),
            labels=tuple(labels_of(truth, scan, hits, view, instant_ns, drive.T_camera_lidar, drive.lens)),
            T_world_ego=Transform(rotation=rotation, translation_m=translation_m),
            ego=None if ego is None else measured[ego],
        )


def _passing(scan: LidarScan, truth: ScanTruth, T_camera_lidar: Transform) -> tuple[int, int]:
    """When the LiDAR looks along the camera's axis: claimed and true. The middle of the sweep where nothing
    came back from there."""
    if len(scan.xyz_m) == 0:
        return scan.stamp_ns, scan.stamp_ns
    axis = T_camera_lidar.rotation[2]
    turn = np.arctan2(scan.xyz_m[:, 1], scan.xyz_m[:, 0]) - np.arctan2(axis[1], axis[0])
    near = np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi) <= AXIS_RAD
    if not near.any():
        near[:] = True
    claimed = scan.stamp_ns + int(_middle(scan.offset_ns[near].astype(np.int64)))
    return claimed, _middle(truth.fire_ns[near])


def _middle(t_ns: Int64[np.ndarray, " n"]) -> int:
    """The median, of two middle ones the earlier: a time that there was."""
    return int(np.sort(t_ns)[(len(t_ns) - 1) // 2])
