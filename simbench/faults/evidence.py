"""What a run shows of where its sensors were and how its body turned: the evidence of the receipts."""

from __future__ import annotations

import numpy as np

from fusion.camera import project_points
from fusion.geometry import rotation_log
from simbench.capture import Captured
from simbench.faults.estimate import PLATES, PNP, BodyAttitude, PoseEvidence, camera_pose, gyro_attitude
from simbench.faults.lidar_pose import turned
from simbench.sensors import fiducials
from simbench.sensors.rig import SensorRig


def body_of(captured: Captured, rig: SensorRig) -> BodyAttitude | None:
    """The body's attitude by the gyro; None where the rig has none."""
    if rig.imu is None:
        return None
    gyro = captured.measured.motions
    R_ego, _ = captured.motion.ego(np.array([m.stamp_ns for m in gyro], dtype=np.int64))
    return gyro_attitude(gyro, np.arctan2(R_ego[:, 1, 0], R_ego[:, 0, 0]), rig.imu)


def cameras_of(captured: Captured, rig: SensorRig) -> tuple[PoseEvidence, ...]:
    """Per camera, PnP on the known points of every frame, against the pose that the script predicts: the
    place at the nominal mid-exposure, the attitude at the true one.
    """
    script = captured.script
    result = []
    for name, camera in rig.pinholes.items():
        taken = [shot.truth for shot in captured.measured.shots[name]]
        mid_ns = captured.timing[name].mid_ns
        taken_ns = np.array([image.capture_ns for image in taken], dtype=np.int64)
        R_ego, _ = script.ego(mid_ns)
        R_ego_taken, _ = script.ego(taken_ns)
        _, expected_m = script.sensor(name, mid_ns)
        attitude, _ = script.sensor(name, taken_ns)
        turns, shifts = [], []
        for f, image in enumerate(taken):
            # Surveyed points that lie in the real view: a camera may look far from where it should.
            field = fiducials.points_m(camera, image.T_world_camera)
            uv = project_points(field, image.T_world_camera.inverse(), camera)
            rotation, position = camera_pose(field, uv, camera)
            turns.append(rotation_log(R_ego_taken[f].T @ rotation @ attitude[f].T @ R_ego_taken[f]))
            shifts.append(R_ego[f].T @ (position - expected_m[f]))
        result.append(
            PoseEvidence(
                sensor=name,
                by=PNP,
                taken_ns=taken_ns,
                turn_rad=np.array(turns),
                shift_m=np.array(shifts),
                position_ego_m=rig.T_ego_sensor[name].translation_m,
                pivot_ego_m=np.array(script.pivot_m),
                speed_mps=script.world.actors[script.ego_actor].track.speed_at(mid_ns),
            )
        )
    return tuple(result)


def lidar_of(captured: Captured, rig: SensorRig) -> PoseEvidence:
    """The LiDAR by plates around it, at some firings of every sweep."""
    script, name = captured.script, rig.lidar_name
    found = turned(name, rig.lidar, captured.motion, script, len(captured.measured.sweeps))
    return PoseEvidence(
        sensor=name,
        by=PLATES,
        taken_ns=found.taken_ns,
        turn_rad=found.turn_rad,
        shift_m=found.shift_m,
        position_ego_m=rig.T_ego_sensor[name].translation_m,
        pivot_ego_m=np.array(script.pivot_m),
        speed_mps=script.world.actors[script.ego_actor].track.speed_at(found.taken_ns),
    )
