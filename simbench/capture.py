"""From a world in motion to a recording: every sensor measures, every fault acts at its place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fusion.messages import CameraImage, CategorySize, Detections, EgoMotion
from scenarios.fault_set import FaultSet
from scenarios.scenario import System
from scenarios.seeding import stream
from simbench.faults.deliver import deliver
from simbench.faults.delivery import Delivery, Shot, Sweep
from simbench.faults.draw import Drawn, draw
from simbench.faults.fault import Site, Step
from simbench.motion import Motion, at
from simbench.recording import Recording
from simbench.reuse import Kept, sweeps_key
from simbench.sensors import gnss, imu, lidar
from simbench.sensors.boxes import View, true_box
from simbench.sensors.clock import CameraTiming
from simbench.sensors.detector import Detector
from simbench.sensors.pictures import TakePicture
from simbench.sensors.rig import SensorRig
from simbench.sensors.row_view import RowView
from simbench.sensors.rows import exposure_at, row_times_ns
from simbench.truth import GnssReference, ImageTruth, TrueBox, Truth
from simbench.world import World

FARTHEST_BOX_M = 90.0
KeptSweeps = Kept[tuple[Sweep, ...]]


def set_in_motion(world: World, rig: SensorRig, ego_name: str, drawn: Drawn | None) -> Motion:
    """The world's scripted motion with the ego's shake and flex in it (none: `drawn` is None)."""
    return Motion(
        world=world,
        ego_actor=next(i for i, actor in enumerate(world.actors) if actor.name == ego_name),
        T_ego_root=rig.T_ego_root,
        T_ego_sensor=rig.T_ego_sensor,
        body_shake=drawn.body_shake if drawn else None,
        flex=drawn.brackets if drawn else {},
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Captured:
    """A recording, and what the receipts need beside it.

    timing: when each camera would have exposed without faults. script: the motion without shake and flex.
    measured: what the sensors measured; steps: what the faults of its delivery made of it, one by one.
    """

    recording: Recording
    motion: Motion
    script: Motion
    timing: Mapping[str, CameraTiming]
    drawn: Drawn
    measured: Delivery
    steps: tuple[Step, ...]
    site: Site


def capture(
    system: System,
    rig: SensorRig,
    world: World,
    faults: FaultSet,
    categories: Mapping[str, CategorySize],
    seed: int,
    picture: TakePicture | None = None,
    ideal: bool = False,
    kept: KeptSweeps | None = None,
) -> Captured:
    """Run all sensors over the system's duration. `picture` takes an image (motion, camera, count, true
    mid-exposure) or is None for no images; boxes and scores do not depend on it. `ideal` switches the
    sensors' own noise off. `kept`: sweeps of the same drive are taken from there, and left there.
    """
    timing = {name: rig.timing(name, system.duration_s, seed) for name in rig.cameras}
    drawn = draw(rig, world, faults, timing, system, seed)
    motion = set_in_motion(world, rig, system.ego, drawn)
    target_id = None if system.target is None else world.find(system.target).object_id
    duration_s = system.duration_s
    end_ns = rig.end_ns(duration_s, timing)

    def cast() -> tuple[Sweep, ...]:
        return tuple(_sweeps(rig, motion, duration_s, seed, ideal))

    measured = Delivery(
        sweeps=cast() if kept is None else kept.of(sweeps_key(rig, motion, duration_s, seed, ideal), cast),
        shots={
            name: tuple(_shots(name, rig, motion, system.ego, timing[name], drawn, seed, picture))
            for name in rig.cameras
        },
        motions=_motions(rig, motion, end_ns, seed),
        reference=_reference(rig, motion, target_id, end_ns, seed),
    )
    site = Site(rig=rig, motion=motion, duration_s=system.duration_s, seed=seed)
    delivered, steps = deliver(measured, faults, site)
    return Captured(
        recording=Recording(
            calibration=drawn.told,
            categories=categories,
            messages=delivered.messages,
            truth=Truth(
                objects=world.objects,
                target_id=target_id,
                scans=tuple(sweep.truth for sweep in delivered.sweeps),
                images=tuple(shot.truth for name in rig.cameras for shot in delivered.shots[name]),
                calibration=rig.calibration,
                poses=motion,
                reference=delivered.reference,
                period_ns=lidar.period_ns(rig.lidar),
            ),
        ),
        motion=motion,
        script=set_in_motion(world, rig, system.ego, None),
        timing=timing,
        drawn=drawn,
        measured=measured,
        steps=steps,
        site=site,
    )


def _sweeps(rig: SensorRig, motion: Motion, duration_s: float, seed: int, ideal: bool) -> Iterator[Sweep]:
    def rng(seq: int) -> np.random.Generator | None:
        return None if ideal else stream(seed, "lidar", rig.lidar_name, str(seq))

    for scan, truth in lidar.sweeps(rig.lidar_name, rig.lidar, motion, rig.sweeps(duration_s), rng):
        yield Sweep(scan=scan, truth=truth)


def _motions(rig: SensorRig, motion: Motion, end_ns: int, seed: int) -> tuple[EgoMotion, ...]:
    if rig.imu is None or rig.imu_name is None:
        return ()
    return imu.measure(rig.imu_name, rig.imu, motion, end_ns, stream(seed, "imu"), rig.phases(seed))


def _shots(
    name: str,
    rig: SensorRig,
    motion: Motion,
    ego: str,
    timing: CameraTiming,
    drawn: Drawn,
    seed: int,
    picture: TakePicture | None,
) -> Iterator[Shot]:
    """What one camera measures in each exposure."""
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
        image = None
        if picture is not None:
            rgb = picture(motion, name, seq, capture_ns)
            image = CameraImage(sensor=name, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, rgb=rgb)
        yield Shot(
            detections=Detections(
                sensor=name, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, boxes=detected.boxes
            ),
            image=image,
            truth=ImageTruth(
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
