"""From the files of one recording to a `Recording`, as the simulator would have made it.

Labels are the truth: an object is where its 3-D box is, a point is on an object when it lies inside the box
(the smaller box where two overlap), and the boxes of the labels, or what the detector model makes of them,
are the detections. Two things no file knows: when each point was fired (all at the sweep's stamp), and what a
range would be without noise (the measured one).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int16, Int32, UInt8

from fusion.messages import (
    BoxPx,
    CameraImage,
    Detection,
    Detections,
    EgoMotion,
    LidarScan,
    Measurement,
)
from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet
from scenarios.faults.lidar import BeamLoss
from scenarios.scenario import DetectorSpec
from simbench.case import Boxes
from simbench.faults.delivery import in_order_of_arrival
from simbench.faults.receipt import Receipt
from simbench.formats.calibration import CAMERA, LIDAR, OXTS
from simbench.formats.inject import check_faults, draw_on_recording, moved_box
from simbench.formats.kitti import PERIOD_NS, Drive, Oxts, Snapshot
from simbench.formats.labels import SIZES, Label
from simbench.formats.poses import LabelledTrack, RecordedPoses
from simbench.formats.proof import recorded_receipts
from simbench.formats.rings import NONE, rings_of
from simbench.formats.scene import RecordedObject, RecordedScene
from simbench.recording import Recording
from simbench.sensors.detector import Detected, Detector, draw_track_ids
from simbench.truth import ImageTruth, ObjectInfo, ScanTruth, TrueBox, Truth

HALF_PX = 0.5  # KITTI counts pixels from the centre of the first one, the bench from its corner
DETECTOR = DetectorSpec().model_copy(update={"categories": tuple(SIZES)})  # a model of every labelled type


@dataclass(frozen=True, kw_only=True, eq=False)
class Recorded:
    """A recording with what its report needs. `shake`: how the body shook, in words, where that is known.
    missing: what of it is not there, in sentences."""

    scene: RecordedScene
    faults: FaultSet
    recording: Recording
    receipts: tuple[Receipt, ...]
    shake: str = ""
    missing: tuple[str, ...] = ()


class Player:
    """One recording, opened: sweeps and images are read when they are asked for.

    boxes: detections are the labels' own boxes, or what the detector model makes of them. seed: of all that
    is drawn (default: the drive's number). BadInput: a file cannot be read, or a fault cannot act here.
    """

    def __init__(
        self, drive: Drive, faults: FaultSet, *, boxes: Boxes = "labels", seed: int | None = None
    ) -> None:
        self.drive, self.faults, self.boxes = drive, faults, boxes
        self.seed = drive.number if seed is None else seed
        self.period_ns = period_of(drive)
        height_px, width_px = drive.folder.image(drive.snapshots[0].image).shape[:2]
        self.true = drive.calibration.as_message(width_px, height_px)
        self.objects, self.ids = objects_of(drive)
        self.poses = RecordedPoses(self.true, drive.calibration.T_ego_rect, _tracks(drive, self.ids))
        check_faults(faults, len(drive.snapshots), words(drive))
        rings = rings_of(self._points(0)[:, :3]) if faults.get(BeamLoss) is not None else None
        self.drawn = draw_on_recording(
            faults,
            self.true,
            self.objects,
            frames=len(drive.snapshots),
            rings=0 if rings is None else int(rings.max()) + 1,
            period_s=self.period_ns * 1e-9,
            seed=self.seed,
        )

    def _points(self, seq: int) -> Float32[np.ndarray, "n 4"]:
        return self.drive.folder.points(self.drive.snapshots[seq].points)

    def scan(self, seq: int) -> LidarScan:
        """Sweep `seq` as it is delivered. BadInput: it cannot be read, or has no rings to lose."""
        found, snapshot = self._points(seq), self.drive.snapshots[seq]
        ring = rings_of(found[:, :3])
        if self.faults.get(BeamLoss) is not None:
            if ring is None:
                raise BadInput(
                    f"{BeamLoss.name}: the points do not lie ring by ring, no beam can be told from another",
                    file=self.drive.folder.name_of(snapshot.points),
                )
            kept = ~np.isin(ring, self.drawn.lost_rings)
            found, ring = found[kept], ring[kept]
        known: Int16[np.ndarray, " n"] = np.full(len(found), NONE, dtype=np.int16) if ring is None else ring
        return LidarScan(
            sensor=LIDAR,
            seq=seq,
            stamp_ns=snapshot.stamp_ns,
            arrival_ns=snapshot.stamp_ns + self.period_ns // 2,
            xyz_m=found[:, :3],
            intensity=found[:, 3],
            offset_ns=np.zeros(len(found), dtype=np.int32),
            ring=known,
        )

    def picture(self, snapshot: Snapshot) -> UInt8[np.ndarray, "h w 3"]:
        """The image of a frame. BadInput: it is of another size than the first one."""
        rgb, camera = self.drive.folder.image(snapshot.image), self.true.cameras[CAMERA]
        if rgb.shape[:2] != (camera.height_px, camera.width_px):
            raise BadInput(
                f"{rgb.shape[1]}x{rgb.shape[0]} pixels, the recording's first image has "
                f"{camera.width_px}x{camera.height_px}",
                file=self.drive.folder.name_of(snapshot.image),
            )
        return rgb

    def play(self, *, images: bool = False) -> Recorded:
        """Read everything. images: deliver them too, for a pipeline that wants them."""
        messages: list[Measurement] = []
        scans: list[ScanTruth] = []
        views: list[ImageTruth] = []
        for seq, snapshot in enumerate(self.drive.snapshots):
            scan = self.scan(seq)
            messages.append(scan)
            scans.append(self._scan_truth(scan, snapshot))
            if snapshot.oxts is not None:
                messages.append(_ego_motion(self.drive, seq, snapshot.oxts))
        eye = _Eye(self)
        for seq in range(self.drawn.stale_frames, len(self.drive.snapshots)):
            delivered, view = eye.look(seq, images)
            messages += delivered
            views.append(view)
        targets = tuple(o.object_id for o in self.objects)
        recording = Recording(
            calibration=self.drawn.told,
            categories=SIZES,
            messages=in_order_of_arrival(messages),
            truth=Truth(
                objects=self.objects,
                target_id=targets[0] if targets else None,
                targets=targets,
                scans=tuple(scans),
                images=tuple(views),
                calibration=self.true,
                poses=self.poses,
                reference=None,
                period_ns=self.period_ns,
            ),
        )
        undisturbed = None if self.faults.get(BeamLoss) is None else self._points(0)[:, :3]
        return Recorded(
            scene=self._scene(),
            faults=self.faults,
            recording=recording,
            receipts=recorded_receipts(self.faults, self.drawn, recording, self.drive, self.ids, undisturbed),
        )

    def _scan_truth(self, scan: LidarScan, snapshot: Snapshot) -> ScanTruth:
        n = len(scan.xyz_m)
        labelled = [self.objects[self.ids[label.track]] for label in snapshot.labels]
        return ScanTruth(
            sensor=scan.sensor,
            seq=scan.seq,
            object_id=inside_boxes(scan, labelled, self.poses),
            part_id=np.full(n, -1, dtype=np.int32),  # a label has no parts
            true_range_m=np.linalg.norm(scan.xyz_m.astype(np.float64), axis=1),
            fire_ns=np.full(n, scan.stamp_ns, dtype=np.int64),
            incidence_rad=np.full(n, np.nan, dtype=np.float32),  # nor a surface
        )

    def _scene(self) -> RecordedScene:
        first, last = self.drive.snapshots[0], self.drive.snapshots[-1]
        n, labelled = len(self.drive.snapshots), len(self.objects)
        labels = [label for s in self.drive.snapshots for label in s.labels]
        known = {self.ids[label.track] for label in labels if label.occlusion_known}
        return RecordedScene(
            name=f"kitti-{self.drive.layout}",
            description=f"{words(self.drive)}: {n} sweep{'s' * (n != 1)}, {labelled} labelled "
            f"object{'s' * (labelled != 1)}",
            number=self.drive.number,
            frames=(first.frame, last.frame),
            sweeps=n,
            duration_s=1e-9 * (last.stamp_ns - first.stamp_ns + self.period_ns),
            boxes=self.boxes,
            objects=tuple(
                RecordedObject(
                    name=o.name,
                    category=o.category,
                    size_m=o.size_m,
                    occlusion_known=o.object_id in known,
                )
                for o in self.objects
            ),
            sha256=self.drive.folder.digest.hexdigest(),
        )


def words(drive: Drive) -> str:
    """How messages call a recording."""
    return f"{drive.layout} recording {drive.name}"


def period_of(drive: Drive) -> int:
    """Between two sweeps [ns]: the median where the times were recorded."""
    stamps = np.array([s.stamp_ns for s in drive.snapshots], dtype=np.int64)
    if drive.layout != "raw" or len(stamps) < 2:
        return PERIOD_NS
    return int(np.median(np.diff(stamps)))


# -- objects ----------------------------------------------------------------------------------------------


def objects_of(drive: Drive) -> tuple[tuple[ObjectInfo, ...], dict[int, int]]:
    """Every labelled object in order of first sight (its size by its first label), and its id by track."""
    first: dict[int, Label] = {}
    for snapshot in drive.snapshots:
        for label in snapshot.labels:
            first.setdefault(label.track, label)
    objects = tuple(
        ObjectInfo(
            object_id=number,
            name=f"{drive.name}-{label.category}-{track}",
            category=label.category,
            size_m=label.size_m,
        )
        for number, (track, label) in enumerate(first.items())
    )
    return objects, {track: number for number, track in enumerate(first)}


def _tracks(drive: Drive, ids: dict[int, int]) -> dict[int, LabelledTrack]:
    seen: dict[int, list[tuple[int, Label]]] = {i: [] for i in ids.values()}
    for snapshot in drive.snapshots:
        for label in snapshot.labels:
            seen[ids[label.track]].append((snapshot.stamp_ns, label))
    return {
        object_id: LabelledTrack(
            t_ns=np.array([t for t, _ in labels], dtype=np.int64),
            bottom_m=np.array([label.bottom_m for _, label in labels], dtype=np.float64),
            yaw_rad=np.unwrap([label.yaw_rad for _, label in labels]),
            height_m=labels[0][1].size_m[2],
        )
        for object_id, labels in seen.items()
    }


# -- LiDAR and motion ---------------------------------------------------------------------------------------


def inside_boxes(
    scan: LidarScan, labelled: Sequence[ObjectInfo], poses: RecordedPoses
) -> Int32[np.ndarray, " n"]:
    """The object of those labelled in this sweep whose box holds each point, -1 for none; of several the
    smallest.
    """
    at = np.array([scan.stamp_ns], dtype=np.int64)
    rotation, position = poses.sensor(scan.sensor, at)
    owner = np.full(len(scan.xyz_m), -1, dtype=np.int32)
    for info in sorted(labelled, key=lambda o: (-float(np.prod(o.size_m)), o.object_id)):
        R_ego_box, centre_ego_m = poses.object_centre(info.object_id, at)
        R_lidar_box, centre_m = rotation[0].T @ R_ego_box[0], rotation[0].T @ (centre_ego_m[0] - position[0])
        half_m = 0.5 * np.array(info.size_m)
        reach_m = float(np.linalg.norm(half_m)) + 0.01
        near = np.abs(scan.xyz_m[:, 0] - np.float32(centre_m[0])) <= reach_m
        near &= np.abs(scan.xyz_m[:, 1] - np.float32(centre_m[1])) <= reach_m
        points = np.flatnonzero(near)
        in_box = (scan.xyz_m[points].astype(np.float64) - centre_m) @ R_lidar_box
        owner[points[(np.abs(in_box) <= half_m).all(axis=1)]] = info.object_id
    return owner


def _ego_motion(drive: Drive, seq: int, oxts: Oxts) -> EgoMotion:
    """Of the GNSS/INS box, turned into the LiDAR's axes, which are the ego's."""
    turn = drive.calibration.R_lidar_imu
    turn = np.eye(3) if turn is None else turn
    return EgoMotion(
        sensor=OXTS,
        seq=seq,
        stamp_ns=oxts.stamp_ns,
        arrival_ns=oxts.stamp_ns,
        velocity_mps=turn @ oxts.velocity_mps,
        rate_radps=turn @ oxts.rate_radps,
        specific_force_mps2=turn @ oxts.specific_force_mps2,
    )


# -- camera -----------------------------------------------------------------------------------------------


class _Eye:
    """Camera and detector of a recording: what is delivered for each image."""

    def __init__(self, player: Player) -> None:
        self._player, self._drawn = player, player.drawn
        self._camera = player.true.cameras[CAMERA]
        self._category = {o.object_id: o.category for o in player.objects}
        self._track_id = draw_track_ids(player.objects, player.seed)
        self._model: Detector | None = None
        if player.boxes == "model":
            frames, errors = len(player.drive.snapshots), dict(player.drawn.edge_errors)
            self._model = Detector(
                DETECTOR, CAMERA, self._camera, player.objects, frames, player.seed, errors
            )

    def look(self, seq: int, images: bool) -> tuple[list[Measurement], ImageTruth]:
        """What stands under the stamp of image `seq`: with stale frames, what an earlier one showed."""
        snapshots = self._player.drive.snapshots
        now, shown = snapshots[seq], snapshots[seq - self._drawn.stale_frames]
        true_boxes = tuple(self._true_boxes(shown))
        if self._model is None:
            detected = self._by_labels(true_boxes, seq)
        else:
            detected = self._model.detect(seq, true_boxes)
        stamp_ns, arrival_ns = now.image_ns, now.image_ns + self._player.period_ns // 2
        delivered: list[Measurement] = [
            Detections(sensor=CAMERA, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, boxes=detected.boxes)
        ]
        if images:
            rgb = self._player.picture(shown)
            delivered.append(
                CameraImage(sensor=CAMERA, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, rgb=rgb)
            )
        view = ImageTruth(
            sensor=CAMERA,
            seq=seq,
            capture_ns=shown.image_ns,
            T_world_camera=self._player.true.T_ego_sensor[CAMERA],
            boxes=true_boxes,
            detection_object_id=detected.object_id,
        )
        return delivered, view

    def _true_boxes(self, shown: Snapshot) -> Iterator[TrueBox]:
        """The labels' boxes. KITTI draws them around all of an object that is in the image, seen or not."""
        for label in shown.labels:
            if label.box_px is None:
                continue
            x0, y0, x1, y1 = (edge + HALF_PX for edge in label.box_px)
            box = moved_box((x0, y0, x1, y1), None, self._camera.width_px, self._camera.height_px)
            if box is not None:
                yield TrueBox(
                    object_id=self._player.ids[label.track],
                    amodal_px=box,
                    visible_px=box if label.visible_fraction > 0.0 else None,
                    visible_fraction=label.visible_fraction,
                )

    def _by_labels(self, true_boxes: Sequence[TrueBox], seq: int) -> Detected:
        """Every labelled box is a detection."""
        found: list[tuple[Detection, int]] = []
        for true in true_boxes:
            error = self._drawn.edge_errors.get(true.object_id)
            box: BoxPx | None = true.visible_px
            if box is not None and error is not None:
                box = moved_box(box, error[seq], self._camera.width_px, self._camera.height_px)
            if box is not None:
                detection = Detection(
                    track_id=self._track_id[true.object_id],
                    category=self._category[true.object_id],
                    box_px=box,
                    confidence=1.0,
                )
                found.append((detection, true.object_id))
        return Detected(boxes=tuple(d for d, _ in found), object_id=tuple(i for _, i in found))
