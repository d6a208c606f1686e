"""From a world in motion to a recording: every sensor measures, every fault acts at its place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64, UInt8

from fusion.camera import project_points
from fusion.geometry import Transform, rotation_log
from fusion.messages import Calibration, CameraImage, CategorySize, Detections, EgoMotion, Measurement
from scenarios.fault_set import FaultSet
from scenarios.faults import CalibrationRotation, EdgeError, Flex, TriggerOffset, Vibration
from scenarios.scenario import System
from scenarios.seeding import stream
from scenarios.severity import Profile
from simbench.faults import calibration as calibration_fault
from simbench.faults import detector as detector_fault
from simbench.faults import motion as motion_fault
from simbench.faults import timing as timing_fault
from simbench.faults.estimate import BodyAttitude, CameraEvidence, camera_pose, gyro_attitude
from simbench.faults.receipt import Receipt
from simbench.motion import Motion, Poses, at
from simbench.recording import Recording
from simbench.sensors import fiducials, gnss, imu, lidar
from simbench.sensors.boxes import View, true_box
from simbench.sensors.detector import Detector
from simbench.sensors.rig import CameraTiming, SensorRig
from simbench.shake import Shake
from simbench.truth import ImageTruth, TrueBox, Truth
from simbench.world import World

FARTHEST_BOX_M = 90.0
TakePicture = Callable[[Motion, str, int, Transform], UInt8[np.ndarray, "h w 3"]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """What this seed drew for each fault: the *realised* side of the receipts."""

    profile: Profile
    body_shake: Shake | None
    flex: Mapping[str, Shake]
    delays_ns: Mapping[str, Int64[np.ndarray, " f"]]
    edge_errors: Mapping[str, Mapping[int, Float64[np.ndarray, "f 4"]]]
    told: Calibration


def struck(spec: TriggerOffset | Flex | CalibrationRotation, rig: SensorRig) -> tuple[str, ...]:
    """The cameras that a fault acts on."""
    return spec.named_cameras or tuple(rig.cameras)


def draw(
    rig: SensorRig,
    world: World,
    faults: FaultSet,
    timing: Mapping[str, CameraTiming],
    duration_s: float,
    seed: int,
) -> Drawn:
    """Draw every fault from its own stream; none moves another's numbers."""
    vibration, rotation = faults.get(Vibration), faults.get(CalibrationRotation)
    offset, bend, edge_error = faults.get(TriggerOffset), faults.get(Flex), faults.get(EdgeError)
    profile: Profile = "car" if rig.rig.body == "vehicle" else "rider"
    if vibration is not None and vibration.profile != "auto":
        profile = vibration.profile
    told = rig.calibration
    if rotation is not None:
        told = calibration_fault.miscalibrate(told, rotation, struck(rotation, rig), seed)
    delays, flex, edges = {}, {}, {}
    if offset is not None:
        for name in struck(offset, rig):
            delays[name] = timing_fault.delays_ns(offset, name, len(timing[name].mid_ns), seed)
    if bend is not None:
        for name in struck(bend, rig):
            flex[name] = motion_fault.bracket_shake(bend, name, duration_s, seed)
    if edge_error is not None:
        for name, camera in rig.cameras.items():
            frames, period_s = len(timing[name].mid_ns), 1.0 / camera.rate_hz
            edges[name] = detector_fault.edge_errors(edge_error, name, world.objects, frames, period_s, seed)
    return Drawn(
        profile=profile,
        body_shake=motion_fault.body_shake(vibration, profile, duration_s, seed) if vibration else None,
        flex=flex,
        delays_ns=delays,
        edge_errors=edges,
        told=told,
    )


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
    """A recording, and what the receipts need beside it."""

    recording: Recording
    motion: Motion
    evidence: tuple[CameraEvidence, ...]
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
    """Run all sensors over the system's duration. `picture` renders an image (motion, camera, true time, true
    pose) or is None for no images; boxes and scores do not depend on it. `ideal` switches the sensors' own
    noise off.
    """
    duration_s = system.duration_s
    timing = {name: rig.timing(name, duration_s, seed) for name in rig.cameras}
    drawn = draw(rig, world, faults, timing, duration_s, seed)
    motion = set_in_motion(world, rig, system.ego, drawn)
    nominal = set_in_motion(world, rig, system.ego, None)
    messages: list[Measurement] = []

    scans = []
    for seq in range(rig.sweeps(duration_s)):
        rng = None if ideal else stream(seed, "lidar", rig.lidar_name, str(seq))
        start_ns = seq * lidar.period_ns(rig.lidar)
        scan, scan_truth = lidar.sweep(rig.lidar_name, rig.lidar, motion, start_ns, seq, rng)
        messages.append(scan)
        scans.append(scan_truth)

    images: list[ImageTruth] = []
    evidence = []
    last_ns = max(int(t.mid_ns[-1]) for t in timing.values()) if timing else 0
    end_ns = max(last_ns, len(scans) * lidar.period_ns(rig.lidar)) + 300_000_000
    for name, camera in rig.cameras.items():
        mid_ns = timing[name].mid_ns + drawn.delays_ns.get(name, 0)
        detector = Detector(
            rig.rig.detector,
            name,
            rig.pinholes[name],
            world.objects,
            len(mid_ns),
            seed,
            dict(drawn.edge_errors.get(name, {})),
        )
        poses = motion.sensor(name, mid_ns)
        bodies = motion.poses(mid_ns)
        latency_ns = round(camera.latency_ms * 1e6)
        for seq, capture_ns in enumerate(mid_ns):
            T_world_camera = at(poses, seq)
            view = View(world.geoms, bodies[0][seq], bodies[1][seq], T_world_camera, rig.pinholes[name])
            boxes = _boxes_in(view, world, rig.rig.detector.categories, system.ego)
            detected = detector.detect(seq, boxes)
            stamp_ns, arrival_ns = int(timing[name].stamp_ns[seq]), int(capture_ns) + latency_ns
            messages.append(
                Detections(
                    sensor=name, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, boxes=detected.boxes
                )
            )
            if picture is not None:
                rgb = picture(motion, name, int(capture_ns), T_world_camera)
                messages.append(
                    CameraImage(sensor=name, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, rgb=rgb)
                )
            images.append(
                ImageTruth(
                    sensor=name,
                    seq=seq,
                    capture_ns=int(capture_ns),
                    T_world_camera=T_world_camera,
                    boxes=boxes,
                    detection_object_id=detected.object_id,
                )
            )
        evidence.append(_evidence(name, rig, timing[name].mid_ns, mid_ns, poses, nominal))

    reference = None
    target_id = world.find(system.target).object_id if system.target is not None else None
    if rig.gnss is not None and rig.gnss_name is not None and target_id is not None:
        antenna = rig.T_ego_sensor[rig.gnss_name].translation_m
        reference = gnss.reference(rig.gnss, antenna, motion, target_id, end_ns, stream(seed, "gnss"))
    if rig.imu is not None and rig.imu_name is not None:
        messages += imu.measure(rig.imu_name, rig.imu, motion, end_ns, stream(seed, "imu"))

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
                reference=reference,
                period_ns=lidar.period_ns(rig.lidar),
            ),
        ),
        motion=motion,
        evidence=tuple(evidence),
        drawn=drawn,
    )


def in_order_of_arrival(messages: list[Measurement]) -> tuple[Measurement, ...]:
    """Sorted by arrival; ties by kind, sensor and count, so that the order never depends on how it was
    made.
    """
    kinds = ("EgoMotion", "CameraImage", "Detections", "LidarScan")
    return tuple(
        sorted(messages, key=lambda m: (m.arrival_ns, kinds.index(type(m).__name__), m.sensor, m.seq))
    )


def _boxes_in(view: View, world: World, categories: tuple[str, ...], ego: str) -> tuple[TrueBox, ...]:
    """True boxes of all detectable objects near enough, in order of object id; the ego itself is not one."""
    result = []
    for info in world.objects:
        if info.category not in categories or info.name == ego:
            continue
        mask = world.masks[info.object_id]
        centre_m = view.centre_camera_m[world.first_geom[info.object_id]]
        reach_m = float(np.linalg.norm(info.size_m))  # every geom lies within this of any other one's centre
        if np.linalg.norm(centre_m) > FARTHEST_BOX_M + reach_m or not view.may_show(centre_m, reach_m):
            continue
        box = true_box(view, info.object_id, mask, min_height_px=4.0)
        if box is not None:
            result.append(box)
    return tuple(result)


def _evidence(
    name: str,
    rig: SensorRig,
    mid_ns: Int64[np.ndarray, " f"],
    taken_ns: Int64[np.ndarray, " f"],
    poses: Poses,
    nominal: Motion,
) -> CameraEvidence:
    """PnP on the known points of every frame, against the pose that the script predicts: the place at the
    nominal mid-exposure, the attitude at the true one.
    """
    camera = rig.pinholes[name]
    R_ego, _ = nominal.ego(mid_ns)
    R_ego_taken, _ = nominal.ego(taken_ns)
    expected = nominal.sensor(name, mid_ns)
    attitude, _ = nominal.sensor(name, taken_ns)
    turns, shifts = [], []
    for f in range(len(mid_ns)):
        # The surveyed points that lie in the real view: a camera may look far away from where it should.
        field = fiducials.points_m(camera, at(poses, f))
        uv = project_points(field, at(poses, f).inverse(), camera)
        rotation, position = camera_pose(field, uv, camera)
        turn = R_ego_taken[f].T @ rotation @ attitude[f].T @ R_ego_taken[f]
        turns.append(rotation_log(turn))
        shifts.append(R_ego[f].T @ (position - expected[1][f]))
    return CameraEvidence(
        camera=name,
        taken_ns=taken_ns,
        turn_rad=np.array(turns),
        shift_m=np.array(shifts),
        R_ego_camera=rig.T_ego_sensor[name].rotation,
        position_ego_m=rig.T_ego_sensor[name].translation_m,
        pivot_ego_m=np.array(nominal.pivot_m),
        speed_mps=nominal.world.actors[nominal.ego_actor].track.speed_at(mid_ns),
    )


def receipts(captured: Captured, rig: SensorRig, faults: FaultSet, duration_s: float) -> tuple[Receipt, ...]:
    """Requested, realised and measured of every fault that is on."""
    drawn, truth = captured.drawn, captured.recording.truth
    evidence, body = captured.evidence, _body(captured, rig)
    result: list[Receipt] = []
    if (offset := faults.get(TriggerOffset)) is not None:
        result += timing_fault.receipts(offset, struck(offset, rig), drawn.delays_ns, evidence, body)
    if (vibration := faults.get(Vibration)) is not None:
        result += motion_fault.vibration_receipts(vibration, drawn.body_shake, duration_s, body, evidence)
    if (bend := faults.get(Flex)) is not None:
        result += motion_fault.flex_receipts(bend, struck(bend, rig), drawn.flex, duration_s, evidence, body)
    if (rotation := faults.get(CalibrationRotation)) is not None:
        told = captured.recording.calibration
        result += calibration_fault.receipts(
            rotation, struck(rotation, rig), truth.calibration, drawn.told, told, evidence, body
        )
    if (edge_error := faults.get(EdgeError)) is not None:
        sizes = {name: (c.width_px, c.height_px) for name, c in rig.pinholes.items()}
        period_s = {1.0 / camera.rate_hz for camera in rig.cameras.values()}
        detections = [m for m in captured.recording.messages if isinstance(m, Detections)]
        result += detector_fault.receipts(
            edge_error, drawn.edge_errors, detections, truth.images, sizes, max(period_s, default=1.0)
        )
    return tuple(result)


def _body(captured: Captured, rig: SensorRig) -> BodyAttitude | None:
    """The body's attitude by the gyro; None where the rig has none."""
    if rig.imu is None:
        return None
    gyro = [m for m in captured.recording.messages if isinstance(m, EgoMotion)]
    R_ego, _ = captured.motion.ego(np.array([m.stamp_ns for m in gyro], dtype=np.int64))
    return gyro_attitude(gyro, np.arctan2(R_ego[:, 1, 0], R_ego[:, 0, 0]), rig.imu.gyro_noise_dps_rthz)
