"""A tiny world in pure NumPy: an ego that stands (turned and off the origin), a target that moves straight.

LiDAR sweep k starts at k x 100 ms. Of every sweep the target's near face gives 30 points around 50 ms, a
parked car 15 points around 30 ms and a wall 20 points around 70 ms. One camera looks forward and takes its
picture 10 ms after the sweep's start. Track 7 is the target, 9 the parked car, 99 a false box.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from fusion.camera import PinholeCamera
from fusion.geometry import Transform, rotation_exp, rotation_rpy
from fusion.messages import (
    Calibration,
    CategorySize,
    Detection,
    Detections,
    FusionOutput,
    LidarScan,
    LocalizedObject,
    Trajectory,
)
from simbench.recording import Recording
from simbench.truth import GnssReference, ImageTruth, ObjectInfo, ScanTruth, TrueBox, Truth

PERIOD = 100_000_000
MS = 1_000_000
TARGET, PARKED = 0, 1
TARGET_TRACK, PARKED_TRACK, FALSE_TRACK = 7, 9, 99
SIZE = (1.5, 0.6, 1.7)
CAMERA = PinholeCamera(fx_px=600, fy_px=600, cx_px=480, cy_px=300, width_px=960, height_px=600)
T_WORLD_EGO = Transform(rotation=rotation_rpy(0, 0, 0.5), translation_m=np.array([10.0, -4.0, 0.0]))
T_EGO_LIDAR = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.8]))
OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])


@dataclass(frozen=True)
class Poses:
    """Static ego, straight target at `start + velocity t` in the ego frame, LiDAR that pitches by
    `shake_rad`.
    """

    start_m: tuple[float, float] = (20.0, -3.0)
    velocity_mps: tuple[float, float] = (-5.2, 0.0)
    shake_rad: float = 0.0

    def _still(self, T: Transform, n: int) -> tuple[np.ndarray, np.ndarray]:
        return np.tile(T.rotation, (n, 1, 1)), np.tile(T.translation_m, (n, 1))

    def ego(self, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._still(T_WORLD_EGO, len(t_ns))

    def object_centre(self, object_id: int, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t_s = np.asarray(t_ns) * 1e-9
        at = np.zeros((len(t_s), 3))
        at[:, 2] = SIZE[2] / 2
        if object_id == TARGET:
            at[:, :2] = np.array(self.start_m) + t_s[:, None] * np.array(self.velocity_mps)
        else:
            at[:, :2] = (15.0, 4.0)
        return np.tile(T_WORLD_EGO.rotation, (len(t_s), 1, 1)), T_WORLD_EGO.apply(at)

    def sensor(self, sensor: str, t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation, position = self._still(T_WORLD_EGO @ T_EGO_LIDAR, len(t_ns))
        if self.shake_rad:
            angle = self.shake_rad * np.sin(2 * np.pi * 7.0 * np.asarray(t_ns) * 1e-9 + 1.0)
            shake = np.stack([rotation_exp(np.array([0.3, 1.0, 0.2]) * a) for a in angle])
            rotation = rotation @ shake.reshape(-1, 3, 3)
        return rotation, position


@dataclass(frozen=True)
class World:
    """Knobs of the little world; `record()` runs it."""

    frames: int = 20
    poses: Poses = field(default_factory=Poses)
    category_m: tuple[float, float, float] = (1.5, 0.6, 1.7)
    missed: frozenset[int] = frozenset()  # frames in which the detector misses the target
    false_box: bool = False
    visible_fraction: float = 1.0
    noise_m: float = 0.0
    gnss: bool = True
    has_target: bool = True
    cameras: tuple[str, ...] = ("front",)
    image_after_ns: int = 10 * MS
    told_yaw_rad: float = 0.0  # calibration error of the LiDAR

    def record(self) -> Recording:
        rng = np.random.default_rng(5)
        scans, scan_truth, images, messages = [], [], [], []
        for k in range(self.frames):
            scan, true = self._scan(k, rng)
            scans.append(scan)
            scan_truth.append(true)
            messages.append(scan)
            for camera in self.cameras:
                image, boxes = self._image(camera, k)
                images.append(image)
                messages.append(boxes)
        mounted = Transform(rotation=OPTICAL, translation_m=np.array([0.2, 0.0, 1.5]))
        at_rest = {"lidar": T_EGO_LIDAR, **{c: mounted for c in self.cameras}}
        models = {c: CAMERA for c in self.cameras}
        turned = T_EGO_LIDAR @ Transform(
            rotation=rotation_rpy(0, 0, self.told_yaw_rad), translation_m=np.zeros(3)
        )
        truth = Truth(
            objects=(
                ObjectInfo(object_id=TARGET, name="rider", category="rider", size_m=SIZE),
                ObjectInfo(object_id=PARKED, name="parked", category="car", size_m=(4.5, 1.8, 1.5)),
            ),
            target_id=TARGET if self.has_target else None,
            scans=tuple(scan_truth),
            images=tuple(images),
            calibration=Calibration(T_ego_sensor=at_rest, cameras=models),
            poses=self.poses,
            reference=self._gnss() if self.gnss else None,
            period_ns=PERIOD,
        )
        return Recording(
            calibration=Calibration(T_ego_sensor={**at_rest, "lidar": turned}, cameras=models),
            categories={
                "rider": CategorySize(mean_m=self.category_m, spread=0.08),
                "car": CategorySize(mean_m=(4.5, 1.8, 1.5), spread=0.08),
            },
            messages=tuple(sorted(messages, key=lambda m: m.arrival_ns)),
            truth=truth,
        )

    def _scan(self, k: int, rng: np.random.Generator) -> tuple[LidarScan, ScanTruth]:
        start = k * PERIOD
        y, z = np.meshgrid(np.linspace(-0.25, 0.25, 6), np.linspace(-0.8, 0.8, 5))
        face = np.stack([np.full(30, -SIZE[0] / 2), y.ravel(), z.ravel()], axis=1)
        object_id = np.repeat([PARKED, TARGET, -1], [15, 30, 20])
        offset_ms = np.concatenate(
            [np.linspace(28, 32, 15), np.linspace(48, 52, 30), np.linspace(68, 72, 20)]
        )
        fire = start + np.rint(offset_ms * MS).astype(np.int64)
        world = np.empty((65, 3))
        world[:15] = T_WORLD_EGO.apply(
            np.stack([np.full(15, 12.75), np.linspace(3.2, 4.8, 15), np.full(15, 0.7)], axis=1)
        )
        rotation, centre = self.poses.object_centre(TARGET, fire[15:45])
        world[15:45] = np.einsum("nij,nj->ni", rotation, face) + centre
        world[45:] = T_WORLD_EGO.apply(
            np.stack([np.full(20, 40.0), np.linspace(-6, 6, 20), np.full(20, 1.0)], axis=1)
        )
        rotation, position = self.poses.sensor("lidar", fire)
        xyz = np.einsum("nji,nj->ni", rotation, world - position)
        ranges = np.linalg.norm(xyz, axis=1)
        noisy = xyz * (1 + self.noise_m * rng.standard_normal(65) / ranges)[:, None]
        scan = LidarScan(
            sensor="lidar",
            seq=k,
            stamp_ns=start,
            arrival_ns=start + PERIOD,
            xyz_m=noisy.astype(np.float32),
            intensity=np.full(65, 0.5, dtype=np.float32),
            offset_ns=(fire - start).astype(np.int32),
            ring=np.zeros(65, dtype=np.int16),
        )
        true = ScanTruth(
            sensor="lidar",
            seq=k,
            object_id=object_id.astype(np.int32),
            part_id=np.zeros(65, dtype=np.int32),
            true_range_m=ranges,
            fire_ns=fire,
            incidence_rad=np.zeros(65, dtype=np.float32),
        )
        return scan, true

    def _image(self, camera: str, k: int) -> tuple[ImageTruth, Detections]:
        capture = k * PERIOD + self.image_after_ns
        T_world_camera = T_WORLD_EGO @ Transform(rotation=OPTICAL, translation_m=np.array([0.2, 0.0, 1.5]))
        rotation, centre = self.poses.object_centre(TARGET, np.array([capture]))
        corners = np.stack(np.meshgrid(*[[-s / 2, s / 2] for s in SIZE]), axis=-1).reshape(-1, 3)
        uv = CAMERA.project(T_world_camera.inverse().apply(corners @ rotation[0].T + centre[0]))
        box = (*uv.min(axis=0), *uv.max(axis=0))
        box = (float(box[0]), float(box[1]), float(box[2]), float(box[3]))
        parked = (200.0, 250.0, 300.0, 320.0)
        found = [(PARKED_TRACK, "car", parked, PARKED)]
        if k not in self.missed:
            found.append((TARGET_TRACK, "rider", box, TARGET))
        if self.false_box:
            found.append((FALSE_TRACK, "rider", (10.0, 10.0, 50.0, 90.0), -1))
        image = ImageTruth(
            sensor=camera,
            seq=k,
            capture_ns=capture,
            T_world_camera=T_world_camera,
            boxes=(
                TrueBox(
                    object_id=TARGET,
                    amodal_px=box,
                    visible_px=box,
                    visible_fraction=self.visible_fraction,
                ),
                TrueBox(object_id=PARKED, amodal_px=parked, visible_px=parked, visible_fraction=1.0),
            ),
            detection_object_id=tuple(f[3] for f in found),
        )
        detections = Detections(
            sensor=camera,
            seq=k,
            stamp_ns=capture,
            arrival_ns=capture + 20 * MS,
            boxes=tuple(Detection(track_id=t, category=c, box_px=b, confidence=0.9) for t, c, b, _ in found),
        )
        return image, detections

    def _gnss(self) -> GnssReference:
        fix = np.arange(0, self.frames * PERIOD, 2 * PERIOD, dtype=np.int64)
        _, centre = self.poses.object_centre(TARGET, fix)
        exact = T_WORLD_EGO.inverse().apply(centre)
        lever = np.tile([1.2, 0.1, 0.0], (len(fix), 1))
        heading = np.stack([0.01 * exact[:, 1], 0.02 * exact[:, 0], np.zeros(len(fix))], axis=1)
        noise = np.tile([0.02, -0.01, 0.03], (len(fix), 1))
        return GnssReference(
            fix_ns=fix,
            available_ns=fix + 20 * MS,
            position_ego_m=exact + lever + heading + noise,
            centre_ego_m=exact,
            lever_m=lever,
            heading_m=heading,
            noise_m=noise,
        )


Choose = Callable[[LidarScan, ScanTruth], np.ndarray]


def target_points(scan: LidarScan, true: ScanTruth) -> np.ndarray:
    return np.flatnonzero(true.object_id == TARGET)


@dataclass(frozen=True)
class Answer:
    """A pipeline that may look at the truth. Its position is the true centre `shift_ns` after its stamp."""

    points: Choose = target_points
    shift_ns: int = 0
    frames: frozenset[int] | None = None  # None: all
    track_id: int = TARGET_TRACK
    sensor: str = "front"
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    confidence: float = 0.5

    def objects(self, recording: Recording, k: int) -> tuple[LocalizedObject, ...]:
        if self.frames is not None and k not in self.frames:
            return ()
        scan = next(m for m in recording.messages if isinstance(m, LidarScan) and m.seq == k)
        points = self.points(scan, recording.truth.scans[k])
        stamp = scan.stamp_ns + 50 * MS
        position = recording.truth.target_centre_ego_m(np.array([stamp + self.shift_ns]))[0]
        position = position + np.array(self.offset_m)
        found = LocalizedObject(
            track_id=self.track_id,
            category="rider",
            sensor=self.sensor,
            stamp_ns=stamp,
            points=points,
            position_ego_m=position,
            distance_m=float(np.hypot(position[0], position[1])),
            azimuth_rad=0.0,
            confidence=self.confidence,
        )
        return (found,)

    def run(self, recording: Recording) -> tuple[tuple[FusionOutput, ...], tuple[Trajectory, ...]]:
        return together(recording, self)


def together(
    recording: Recording, *answers: Answer
) -> tuple[tuple[FusionOutput, ...], tuple[Trajectory, ...]]:
    """Several answers in one output per scan, and one trajectory per track of the raw positions as they
    are.
    """
    outputs = []
    samples: dict[int, dict[int, np.ndarray]] = {}
    for k in range(len(recording.truth.scans)):
        objects = tuple(o for a in answers for o in a.objects(recording, k))
        outputs.append(FusionOutput(scan_sensor="lidar", scan_seq=k, objects=objects))
        for found in objects:
            samples.setdefault(found.track_id, {})[found.stamp_ns] = found.position_ego_m
    tracks = tuple(
        Trajectory(
            track_id=track,
            stamp_ns=np.array(list(by_stamp), dtype=np.int64),
            position_ego_m=np.stack(list(by_stamp.values())),
            inlier=np.ones(len(by_stamp), dtype=bool),
        )
        for track, by_stamp in samples.items()
    )
    return tuple(outputs), tracks


@dataclass(frozen=True)
class Kit:
    """What the tests of this folder share."""

    World = World
    Poses = Poses
    Answer = Answer
    together = staticmethod(together)
    target_points = staticmethod(target_points)
    replace = staticmethod(replace)


@pytest.fixture(scope="session")
def kit() -> Kit:
    return Kit()


@pytest.fixture(scope="session")
def recording() -> Recording:
    """20 frames, no errors."""
    return World().record()
