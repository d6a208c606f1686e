"""What stands in the files, held against the truth by KITTI's own formulas (development kits)."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from fusion.camera import PinholeCamera
from fusion.geometry import rotation_rpy
from fusion.messages import Calibration, CameraImage, Detections, EgoMotion, LidarScan
from simbench.case import Job
from simbench.formats.kitti_write import write_kitti, write_kitti_object, write_kitti_raw
from simbench.formats.kitti_write.files import kitti_order
from simbench.formats.kitti_write.rectify import straight_box, straight_image
from simbench.formats.rings import rings_of
from simbench.recording import Recording
from simbench.run import recording_of
from simbench.truth import ObjectInfo

DAY, DRIVE = "2000_01_01", "2000_01_01_drive_0007_sync"


@pytest.fixture(scope="module")
def made() -> Recording:
    job = Job(
        scenario="overtake-approach", system="car", seed=0, pipelines=(),
        changes=("systems.car.duration_s=0.4",),
    )  # fmt: skip
    return recording_of(job)[2].recording


@pytest.fixture(scope="module")
def raw(made: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raw") / "new"
    assert write_kitti_raw(made, folder, number=7) == 4
    return folder / DAY


@pytest.fixture(scope="module")
def frames(made: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("object") / "new"
    assert write_kitti_object(made, folder) == 4
    return folder / "training"


def scans(recording: Recording) -> list[LidarScan]:
    return [m for m in recording.messages if isinstance(m, LidarScan)]


def matrices(path: Path) -> dict[str, np.ndarray]:
    pairs = (line.split(maxsplit=1) for line in path.read_text().splitlines() if "time" not in line)
    return {name.rstrip(":"): np.array(values.split(), dtype=float) for name, values in pairs}


def name_by_size(recording: Recording, sizes: Iterable[float]) -> ObjectInfo:
    """Height, width and length are random: they tell objects apart."""
    wanted = np.array(list(sizes))
    return min(
        recording.truth.objects, key=lambda o: float(np.abs(np.array(o.size_m)[[2, 1, 0]] - wanted).max())
    )


# -- the object layout --------------------------------------------------------------------------------------


def test_a_labelled_box_is_where_the_object_is_about_the_lidar_when_it_looks_ahead(
    made: Recording, frames: Path
) -> None:
    truth, told = made.truth, made.calibration
    for index, scan in enumerate(scans(made)):
        calib = matrices(frames / f"calib/{index:06d}.txt")
        T_velo_cam = calib["Tr_velo_to_cam"].reshape(3, 4)
        np.testing.assert_array_equal(calib["R0_rect"].reshape(3, 3), np.eye(3))
        np.testing.assert_array_equal(T_velo_cam[:, :3], told.T_camera_lidar("cam-front", "lidar").rotation)
        at = np.array([scan.stamp_ns + 25_000_000])  # a quarter turn after its start the LiDAR looks ahead
        (R_lidar,), (lidar,) = truth.poses.sensor("lidar", at)
        lines = (frames / f"label_2/{index:06d}.txt").read_text().splitlines()
        assert len(lines) >= 3
        for line in lines:
            kind, *numbers = line.split()
            if kind == "DontCare":
                continue
            assert len(numbers) == 14
            _, _, alpha, *box, h, w, length, x, y, z, yaw = map(float, numbers)
            info = name_by_size(made, (h, w, length))
            assert kind == {"car": "Car", "rider": "Cyclist", "pedestrian": "Pedestrian"}[info.category]
            (R_box,), (centre,) = truth.poses.object_centre(info.object_id, at)
            bottom = centre - R_box[:, 2] * h / 2
            in_cam = T_velo_cam @ [*(R_lidar.T @ (bottom - lidar)), 1.0]
            np.testing.assert_allclose((x, y, z), in_cam, atol=0.01)  # 25 ms to a tenth: an object moves 1 mm
            front = T_velo_cam[:, :3] @ R_lidar.T @ R_box[:, 0]
            assert np.cos(yaw) == pytest.approx(front[0], abs=1e-3)
            assert -np.sin(yaw) == pytest.approx(front[2], abs=1e-3)
            seen_from = yaw - np.arctan2(x, z)
            assert np.exp(1j * alpha) == pytest.approx(np.exp(1j * seen_from), abs=1e-9)
            assert -np.pi <= alpha <= np.pi
            shown = next(i for i in truth.images if (i.sensor, i.seq) == ("cam-front", index))
            amodal = next(b.amodal_px for b in shown.boxes if b.object_id == info.object_id)
            np.testing.assert_allclose(np.array(box) + 0.5, amodal, atol=1e-9)


def test_a_point_of_an_object_lies_in_its_labelled_box_and_in_its_image_box(
    made: Recording, frames: Path
) -> None:
    """Both by the files alone; the true owner by the truth, in the order that the file has."""
    inside_3d, inside_2d = [], []
    for index, scan in enumerate(scans(made)):
        calib = matrices(frames / f"calib/{index:06d}.txt")
        points = np.fromfile(frames / f"velodyne/{index:06d}.bin", dtype="<f4").reshape(-1, 4)
        owner = made.truth.scans[index].object_id[kitti_order(scan)]
        cam = points[:, :3] @ calib["Tr_velo_to_cam"].reshape(3, 4)[:, :3].T
        cam += calib["Tr_velo_to_cam"].reshape(3, 4)[:, 3]
        uvw = np.c_[cam, np.ones(len(cam))] @ calib["P2"].reshape(3, 4).T
        uv = uvw[:, :2] / uvw[:, 2:]
        for line in (frames / f"label_2/{index:06d}.txt").read_text().splitlines():
            if line.startswith("DontCare"):
                continue
            x0, y0, x1, y1, h, w, length, x, y, z, yaw = map(float, line.split()[4:])
            mine = owner == name_by_size(made, (h, w, length)).object_id
            if np.count_nonzero(mine) < 10:
                continue
            c, s = np.cos(yaw), np.sin(yaw)
            local = (cam[mine] - [x, y - h / 2, z]) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
            inside_3d += (np.abs(local) <= np.array([length, h, w]) / 2 + 0.05).all(axis=1).tolist()
            ahead = mine & (uv > -0.5).all(axis=1) & (uv < (959.5, 599.5)).all(axis=1)
            inside_2d += (
                ((uv[ahead] > (x0 - 3, y0 - 3)) & (uv[ahead] < (x1 + 3, y1 + 3))).all(axis=1).tolist()
            )
    assert len(inside_3d) > 500
    assert np.mean(inside_3d) > 0.97
    assert np.mean(inside_2d) > 0.97


def test_no_tree_is_labelled_and_the_car_itself_is_not(made: Recording, raw: Path) -> None:
    items = ElementTree.parse(raw / DRIVE / "tracklet_labels.xml").getroot().findall("tracklets/item")
    found = [name_by_size(made, [float(i.findtext(k, "")) for k in "hwl"]) for i in items]
    assert {o.category for o in found} == {"car", "rider", "pedestrian"}
    assert len({o.name for o in found}) == len(found) >= 4
    assert "car" not in {o.name for o in found}  # it carries the LiDAR


def test_what_nobody_sees_is_dont_care(made: Recording, tmp_path: Path) -> None:
    hidden = made.truth.target_id
    images = tuple(
        replace(
            image,
            boxes=tuple(
                replace(b, visible_px=None, visible_fraction=0.0) if b.object_id == hidden else b
                for b in image.boxes
            ),
        )
        for image in made.truth.images
    )
    recording = replace(made, truth=replace(made.truth, images=images))
    write_kitti(recording, tmp_path / "o", layout="object")
    text = (tmp_path / "o/training/label_2/000000.txt").read_text()
    (line,) = [line for line in text.splitlines() if line.startswith("DontCare")]
    assert line.split()[1:4] == ["-1", "-1", "-10"] and len(line.split()) == 15
    assert "Cyclist" not in text
    write_kitti(recording, tmp_path / "t", layout="tracking")
    rider = [line.split() for line in (tmp_path / "t/training/label_02/0000.txt").read_text().splitlines()]
    assert {line[3] for line in rider if line[2] == "Cyclist"} == {"2"}  # what labellers leave out


# -- sweeps -----------------------------------------------------------------------------------------------


def test_a_sweep_holds_the_same_points_ring_by_ring(made: Recording, raw: Path) -> None:
    for index, scan in enumerate(scans(made)):
        data = (raw / DRIVE / f"velodyne_points/data/{index:010d}.bin").read_bytes()
        points = list(struct.iter_unpack("<4f", data))
        own = zip(*scan.xyz_m.T.tolist(), scan.intensity.tolist(), strict=True)
        assert sorted(points) == sorted(own)
        assert points != list(zip(*scan.xyz_m.T.tolist(), scan.intensity.tolist(), strict=True))
        ring = rings_of(np.array(points, dtype=np.float32)[:, :3])
        assert ring is not None  # the reader can tell the beams apart
        lost = len(np.unique(scan.ring)) - (ring.max() + 1)
        assert 0 <= lost <= 6  # upper beams that met only the sky but for a few points run together


# -- times and motion ---------------------------------------------------------------------------------------


def times(path: Path) -> list[int]:
    """Nanoseconds after noon of the first of January 2000."""
    found = []
    for line in path.read_text().splitlines():
        whole, rest = line.split(".")
        assert len(rest) == 9
        since = datetime.fromisoformat(whole) - datetime(2000, 1, 1, 12)
        found.append((since.days * 86_400 + since.seconds) * 10**9 + int(rest))
    return found


def test_times_are_exact(made: Recording, raw: Path) -> None:
    sweeps = raw / DRIVE / "velodyne_points"
    first = [s.stamp_ns for s in scans(made)]
    last = [s.stamp_ns + int(s.offset_ns.max()) for s in scans(made)]
    assert times(sweeps / "timestamps_start.txt") == first
    assert times(sweeps / "timestamps_end.txt") == last
    for start, ahead in zip(first, times(sweeps / "timestamps.txt"), strict=True):
        assert ahead == pytest.approx(start + 25_000_000, abs=200_000)  # two columns
    front = [m for m in made.messages if isinstance(m, Detections) and m.sensor == "cam-front"]
    assert times(raw / DRIVE / "image_02/timestamps.txt") == [m.stamp_ns for m in front[:4]]


def poses_by_the_devkit(lines: list[list[float]]) -> np.ndarray:
    """convertOxtsToPose.m: Mercator about the first, Rz Ry Rx; [n 4 4] relative to the first."""
    radius = 6378137.0
    scale = np.cos(lines[0][0] * np.pi / 180)
    found = []
    for lat, lon, alt, roll, pitch, yaw, *_ in lines:
        pose = np.eye(4)
        pose[0, 3] = scale * lon * np.pi * radius / 180
        pose[1, 3] = scale * radius * np.log(np.tan((90 + lat) * np.pi / 360))
        pose[2, 3] = alt
        pose[:3, :3] = rotation_rpy(roll, pitch, yaw)
        found.append(pose)
    return np.linalg.inv(found[0]) @ np.array(found)


def test_the_devkit_finds_the_true_path_of_the_ego(made: Recording, raw: Path) -> None:
    files = sorted((raw / DRIVE / "oxts/data").iterdir())
    lines = [[float(word) for word in file.read_text().split()] for file in files]
    assert {len(line) for line in lines} == {30}
    found = poses_by_the_devkit(lines)
    at = np.array(times(raw / DRIVE / "velodyne_points/timestamps.txt"))
    rotation, position = made.truth.poses.ego(at)
    np.testing.assert_allclose(found[:, :3, 3], (position - position[0]) @ rotation[0], atol=1e-6)
    np.testing.assert_allclose(found[:, :3, :3], rotation[0].T @ rotation, atol=1e-9)
    assert np.linalg.norm(found[-1][:3, 3]) > 3.0


def test_motion_is_what_was_measured(made: Recording, raw: Path) -> None:
    measured = [m for m in made.messages if isinstance(m, EgoMotion)]
    stamps = times(raw / DRIVE / "oxts/timestamps.txt")
    sweeps = times(raw / DRIVE / "velodyne_points/timestamps.txt")
    for index, (stamp_ns, sweep_ns) in enumerate(zip(stamps, sweeps, strict=True)):
        line = (raw / DRIVE / f"oxts/data/{index:010d}.txt").read_text().split()
        (own,) = (m for m in measured if m.stamp_ns == stamp_ns)
        assert abs(stamp_ns - sweep_ns) == min(abs(m.stamp_ns - sweep_ns) for m in measured)
        assert [float(v) for v in line[8:11]] == own.velocity_mps.tolist()
        assert [float(v) for v in line[11:14]] == own.specific_force_mps2.tolist()
        assert [float(v) for v in line[17:20]] == own.rate_radps.tolist()
        assert np.hypot(float(line[6]), float(line[7])) == pytest.approx(np.hypot(*own.velocity_mps[:2]))
        assert line[25:] == ["0"] * 5


# -- calibration and tracklets ----------------------------------------------------------------------------


def test_the_raw_calibration_projects_as_the_told_one(made: Recording, raw: Path) -> None:
    cam, velo = matrices(raw / "calib_cam_to_cam.txt"), matrices(raw / "calib_velo_to_cam.txt")
    points = np.random.default_rng(1).uniform((4, -2, -1.5), (40, 2, 1), (100, 3))
    rect = cam["R_rect_00"].reshape(3, 3) @ (velo["R"].reshape(3, 3) @ points.T + velo["T"][:, None])
    uvw = cam["P_rect_02"].reshape(3, 4) @ np.vstack([rect, np.ones(100)])
    told = made.calibration
    own = told.cameras["cam-front"].project(told.T_camera_lidar("cam-front", "lidar").apply(points))
    np.testing.assert_allclose((uvw[:2] / uvw[2]).T, own - 0.5, atol=1e-9)
    assert cam["S_rect_02"].tolist() == [960, 600]
    imu = matrices(raw / "calib_imu_to_velo.txt")
    np.testing.assert_allclose(imu["T"], [0.0, 0.0, -1.85])


def test_tracklets_stand_on_the_ground_in_the_lidars_frame(made: Recording, raw: Path) -> None:
    root = ElementTree.parse(raw / DRIVE / "tracklet_labels.xml").getroot()
    items = root.findall("tracklets/item")
    assert int(root.findtext("tracklets/count", "")) == len(items)
    stamps = np.array(times(raw / DRIVE / "velodyne_points/timestamps.txt"))
    for item in items:
        info = name_by_size(made, [float(item.findtext(key, "")) for key in "hwl"])
        poses = item.findall("poses/item")
        assert int(item.findtext("poses/count", "")) == len(poses)
        first = int(item.findtext("first_frame", ""))
        for step, pose in enumerate(poses):
            at = stamps[first + step : first + step + 1]
            (R_lidar,), (lidar,) = made.truth.poses.sensor("lidar", at)
            (R_box,), (centre,) = made.truth.poses.object_centre(info.object_id, at)
            wanted = R_lidar.T @ (centre - R_box[:, 2] * info.size_m[2] / 2 - lidar)
            found = [float(pose.findtext(key, "")) for key in ("tx", "ty", "tz")]
            np.testing.assert_allclose(found, wanted, atol=1e-3)
            ahead, heading = R_lidar.T @ R_box[:, 0], float(pose.findtext("rz", ""))
            np.testing.assert_allclose((np.cos(heading), np.sin(heading)), ahead[:2], atol=1e-3)
            names = {child.tag for child in pose}
            assert {"rx", "ry", "state", "occlusion", "occlusion_kf", "truncation", "amt_border_kf"} <= names


# -- pictures ---------------------------------------------------------------------------------------------


def pictured(made: Recording, lens: PinholeCamera | None = None) -> Recording:
    """With a random picture for every image of the front camera."""
    messages = list(made.messages)
    for m in made.messages:
        if isinstance(m, Detections) and m.sensor == "cam-front":
            rgb = np.random.default_rng(m.seq).integers(0, 255, (600, 960, 3), dtype=np.uint8)
            messages.append(
                CameraImage(sensor=m.sensor, seq=m.seq, stamp_ns=m.stamp_ns, arrival_ns=m.arrival_ns, rgb=rgb)
            )
    told = made.calibration
    cameras = dict(told.cameras) | ({"cam-front": lens} if lens is not None else {})
    calibration = Calibration(T_ego_sensor=told.T_ego_sensor, cameras=cameras)
    return replace(made, messages=tuple(messages), calibration=calibration)


def read(path: Path) -> np.ndarray:
    bgr = cv2.imread(str(path))
    assert bgr is not None
    return np.asarray(bgr[..., ::-1])


def test_pictures_are_those_of_the_camera_and_black_without(
    made: Recording, frames: Path, tmp_path: Path
) -> None:
    write_kitti(pictured(made), tmp_path / "new", layout="object")
    for index in range(2):
        drawn = np.random.default_rng(index).integers(0, 255, (600, 960, 3), dtype=np.uint8)
        np.testing.assert_array_equal(read(tmp_path / f"new/training/image_2/{index:06d}.png"), drawn)
        black = read(frames / f"image_2/{index:06d}.png")
        assert black.shape == (600, 960, 3) and not black.any()


def test_another_camera_can_be_chosen(made: Recording, tmp_path: Path) -> None:
    write_kitti(made, tmp_path / "new", layout="object", camera="cam-front-right")
    mount = matrices(tmp_path / "new/training/calib/000000.txt")["Tr_velo_to_cam"].reshape(3, 4)
    wanted = made.calibration.T_camera_lidar("cam-front-right", "lidar")
    np.testing.assert_array_equal(mount[:, :3], wanted.rotation)


def test_pictures_and_boxes_of_a_bent_lens_are_straightened(made: Recording, tmp_path: Path) -> None:
    lens = replace(made.calibration.cameras["cam-front"], distortion=(-0.2, 0.0, 0.0, 0.0, 0.0))
    write_kitti(pictured(made, lens), tmp_path / "new", layout="raw")
    root = tmp_path / "new" / DAY
    cam = matrices(root / "calib_cam_to_cam.txt")
    assert cam["D_02"].tolist() == [-0.2, 0.0, 0.0, 0.0, 0.0]
    drawn = np.random.default_rng(0).integers(0, 255, (600, 960, 3), dtype=np.uint8)
    written = read(root / "2000_01_01_drive_0000_sync/image_02/data/0000000000.png")
    np.testing.assert_array_equal(written, straight_image(drawn, lens))
    assert (written != drawn).mean() > 0.5
    write_kitti(pictured(made, lens), tmp_path / "frames", layout="object")
    first = next(i for i in made.truth.images if (i.sensor, i.seq) == ("cam-front", 0))
    bent = {b.object_id: b.amodal_px for b in first.boxes}
    for line in (tmp_path / "frames/training/label_2/000000.txt").read_text().splitlines():
        kind, *numbers = line.split()
        if kind != "DontCare":
            was = bent[name_by_size(made, map(float, numbers[7:10])).object_id]
            wanted = straight_box(was, lens)
            assert wanted is not None and wanted != was
            np.testing.assert_allclose([float(n) + 0.5 for n in numbers[3:7]], wanted, atol=1e-9)
