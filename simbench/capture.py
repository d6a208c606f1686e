"""From a world in motion to a recording: every sensor measures, every fault acts at its place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fusion.messages import CameraImage, CategorySize, Detections, LidarScan, Measurement
from scenarios.fault_set import FaultSet
from scenarios.scenario import System
from scenarios.seeding import stream
from simbench.faults.draw import Drawn, draw
from simbench.motion import Motion, at
from simbench.recording import Recording
from simbench.sensors import gnss, imu, lidar
from simbench.sensors.boxes import View, true_box
from simbench.sensors.clock import CameraTiming
from simbench.sensors.detector import Detector
from simbench.sensors.pictures import TakePicture
from simbench.sensors.rig import SensorRig
from simbench.sensors.row_view import RowView
from simbench.sensors.rows import exposure_at, row_times_ns
from simbench.truth import GnssReference, ImageTruth, ScanTruth, TrueBox, Truth
from simbench.world import World

FARTHEST_BOX_M = 90.0


def set_in_motion(world: World, rig: SensorRig, ego_name: str, drawn: Drawn | None) -> Motion:
    """The world's scripted motion with the ego's shake and flex in it (none: `drawn` is None)."""
    return Motion(
        world=world,
        ego_actor=next(i for i, actor in enumerate(world.actors) if actor.name == ego_name),
        T_ego_root=rig.T_ego_root,
        T_ego_sensor=rig.T_ego_sensor,
        body_shake=drawn.body_shake if drawn else None,
        flex=drawn.flex if drawn else {},
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Captured:
    """A recording, and what the receipts need beside it.

    timing: when each camera would have exposed without faults. script: the motion without shake and flex.
    """

    recording: Recording
    motion: Motion
    script: Motion
    timing: Mapping[str, CameraTiming]
    drawn: Drawn


def capture(
    system: System,
    rig: SensorRig,
    world: World,
    faults: FaultSet,
    categories: Mapping[str, CategorySize],
    seed: int,
    picture: TakePicture | None = None,
    ideal: bool = False,
) -> Captured:
    """Run all sensors over the system's duration. `picture` takes an image (motion, camera, count, true
    mid-exposure) or is None for no images; boxes and scores do not depend on it. `ideal` switches the
    sensors' own noise off.
    """
    timing = {name: rig.timing(name, system.duration_s, seed) for name in rig.cameras}
    drawn = draw(rig, world, faults, timing, system, seed)
    motion = set_in_motion(world, rig, system.ego, drawn)
    messages: list[Measurement] = []
    scans: list[ScanTruth] = []
    images: list[ImageTruth] = []
    for scan, scan_truth in _scans(rig, motion, system.duration_s, seed, ideal):
        messages.append(scan)
        scans.append(scan_truth)
    for name in rig.cameras:
        for delivered, image_truth in _shots(
            name, rig, motion, system.ego, timing[name], drawn, seed, picture
        ):
            messages += delivered
            images.append(image_truth)
    period_ns = lidar.period_ns(rig.lidar)
    end_ns = rig.end_ns(system.duration_s, timing)
    if rig.imu is not None and rig.imu_name is not None:
        messages += imu.measure(rig.imu_name, rig.imu, motion, end_ns, stream(seed, "imu"), rig.phases(seed))
    target_id = None if system.target is None else world.find(system.target).object_id
    return Captured(
        recording=Recording(
            calibration=drawn.told,
            categories=categories,
            messages=in_order_of_arrival(messages),
            truth=Truth(
                objects=world.objects,
                target_id=target_id,
                scans=tuple(scans),
                images=tuple(images),
                calibration=rig.calibration,
                poses=motion,
                reference=_reference(rig, motion, target_id, end_ns, seed),
                period_ns=period_ns,
            ),
        ),
        motion=motion,
        script=set_in_motion(world, rig, system.ego, None),
        timing=timing,
        drawn=drawn,
    )


def _scans(
    rig: SensorRig, motion: Motion, duration_s: float, seed: int, ideal: bool
) -> Iterator[tuple[LidarScan, ScanTruth]]:
    def rng(seq: int) -> np.random.Generator | None:
        return None if ideal else stream(seed, "lidar", rig.lidar_name, str(seq))

    return lidar.sweeps(rig.lidar_name, rig.lidar, motion, rig.sweeps(duration_s), rng)


def _shots(
    name: str,
    rig: SensorRig,
    motion: Motion,
    ego: str,
    timing: CameraTiming,
    drawn: Drawn,
    seed: int,
    picture: TakePicture | None,
) -> Iterator[tuple[list[Measurement], ImageTruth]]:
    """What one camera delivers for each exposure: detections, and the image where pictures are taken."""
    world, pinhole = motion.world, rig.pinholes[name]
    by_rows = timing.line_delay_ns != 0.0 or any(pinhole.distortion)
    taken_ns = timing.mid_ns + drawn.delays_ns.get(name, 0)
    sought = _Sought(world, rig.rig.detector.categories, ego)
    edge_errors = dict(drawn.edge_errors.get(name, {}))
    detector = Detector(rig.rig.detector, name, pinhole, world.objects, len(taken_ns), seed, edge_errors)
    poses, (rotation, position) = motion.sensor(name, taken_ns), motion.poses(taken_ns)
    for seq, capture_ns in enumerate(int(t) for t in taken_ns):
        T_world_camera = at(poses, seq)
        view: View
        if by_rows:
            t_ns = row_times_ns(capture_ns, timing.line_delay_ns, pinhole.height_px)
            view = RowView(exposure_at(motion, name, t_ns), pinhole)
        else:
            view = View(world.geoms, rotation[seq], position[seq], T_world_camera, pinhole)
        boxes = sought.boxes_in(view)
        detected = detector.detect(seq, boxes)
        late_ns = capture_ns - int(timing.mid_ns[seq])
        stamp_ns, arrival_ns = int(timing.stamp_ns[seq]), int(timing.arrival_ns[seq]) + late_ns
        delivered: list[Measurement] = [
            Detections(sensor=name, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, boxes=detected.boxes)
        ]
        if picture is not None:
            rgb = picture(motion, name, seq, capture_ns)
            delivered.append(
                CameraImage(sensor=name, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, rgb=rgb)
            )
        yield (
            delivered,
            ImageTruth(
                sensor=name,
                seq=seq,
                capture_ns=capture_ns,
                T_world_camera=T_world_camera,
                boxes=boxes,
                detection_object_id=detected.object_id,
            ),
        )


def _reference(
    rig: SensorRig, motion: Motion, target_id: int | None, end_ns: int, seed: int
) -> GnssReference | None:
    if rig.gnss is None or rig.gnss_name is None or target_id is None:
        return None
    antenna = rig.T_ego_sensor[rig.gnss_name].translation_m
    phase_ns = rig.phases(seed).gnss_ns
    return gnss.reference(rig.gnss, antenna, motion, target_id, end_ns, stream(seed, "gnss"), phase_ns)


def in_order_of_arrival(messages: list[Measurement]) -> tuple[Measurement, ...]:
    """Sorted by arrival; ties by kind, sensor and count, so that the order never depends on how it was
    made.
    """
    kinds = ("EgoMotion", "CameraImage", "Detections", "LidarScan")
    return tuple(
        sorted(messages, key=lambda m: (m.arrival_ns, kinds.index(type(m).__name__), m.sensor, m.seq))
    )


class _Sought:
    """The detectable objects of a world but the ego: by object id, with their geoms and sizes."""

    def __init__(self, world: World, categories: tuple[str, ...], ego: str) -> None:
        found = [o for o in world.objects if o.category in categories and o.name != ego]
        self.geoms = {o.object_id: np.flatnonzero(world.masks[o.object_id]) for o in found}
        self.first = np.array([world.first_geom[o.object_id] for o in found], dtype=np.int64)
        # Every geom of an object lies within its size of any other one's centre.
        self.reach_m = np.array([np.linalg.norm(o.size_m) for o in found], dtype=np.float64)

    def boxes_in(self, view: View) -> tuple[TrueBox, ...]:
        """True boxes of all of them that are near enough, in order of object id."""
        shown = view.may_show(self.first, self.reach_m)
        shown &= np.linalg.norm(view.centre_camera_m[self.first], axis=1) <= FARTHEST_BOX_M + self.reach_m
        found = (
            true_box(view, object_id, geoms, min_height_px=4.0)
            for (object_id, geoms), may_show in zip(self.geoms.items(), shown, strict=True)
            if may_show
        )
        return tuple(box for box in found if box is not None)
