"""A rig file with its sensor files read: who measures, from where, and when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import Calibration
from scenarios.scenario import CameraSensor, GnssSensor, ImuSensor, LidarSensor, Rig, Sensor
from scenarios.seeding import stream
from simbench.axes import T_parent_body, T_parent_optical, pinhole
from simbench.sensors.lidar import passing_offset_ns, period_ns

TRAILING_SWEEPS = 3  # cameras and IMU go on after the last sweep, so that late messages still settle it


@dataclass(frozen=True, kw_only=True)
class CameraTiming:
    """When one camera exposes. `mid_ns` [f]: true mid-exposure without faults; `stamp_ns` [f]: what it
    claims."""

    mid_ns: Int64[np.ndarray, " f"]
    stamp_ns: Int64[np.ndarray, " f"]


@dataclass(frozen=True, kw_only=True)
class SensorRig:
    """The sensors of a rig. Poses are in the ego frame at rest; `pinholes` are the true intrinsics."""

    rig: Rig
    lidar_name: str
    lidar: LidarSensor
    cameras: Mapping[str, CameraSensor]
    pinholes: Mapping[str, PinholeCamera]
    gnss_name: str | None
    gnss: GnssSensor | None
    imu_name: str | None
    imu: ImuSensor | None
    T_ego_sensor: Mapping[str, Transform]
    T_ego_root: Transform

    @property
    def calibration(self) -> Calibration:
        """The true calibration at rest of LiDAR and cameras."""
        names = (self.lidar_name, *self.cameras)
        return Calibration(
            T_ego_sensor={name: self.T_ego_sensor[name] for name in names}, cameras=self.pinholes
        )

    def sweeps(self, duration_s: float) -> int:
        """How many whole sweeps fit into the duration."""
        return int(duration_s * 1e9 + 0.5) // period_ns(self.lidar)

    def timing(self, camera: str, duration_s: float, seed: int) -> CameraTiming:
        """Exposures of one camera over the run, and a few more."""
        sensor = self.cameras[camera]
        period = period_ns(self.lidar)
        offset = passing_offset_ns(self.lidar, sensor.trigger_deg) + round(sensor.exposure_ms * 0.5e6)
        if sensor.trigger == "free_run":
            phase_ms = stream(seed, "camera", camera, "phase").uniform(-sensor.phase_ms, sensor.phase_ms)
            offset = max(offset + round(phase_ms * 1e6), 0)
            period = round(1e9 / sensor.rate_hz)
        count = int(np.ceil(self.sweeps(duration_s) * period_ns(self.lidar) / period)) + TRAILING_SWEEPS
        mid = offset + period * np.arange(count, dtype=np.int64)
        late = {
            "mid_exposure": 0,
            "trigger": -round(sensor.exposure_ms * 0.5e6),
            "arrival": round(sensor.latency_ms * 1e6),
        }[sensor.stamp]
        return CameraTiming(mid_ns=mid, stamp_ns=mid + late)


def assemble(rig: Rig, sensors: Mapping[str, Sensor]) -> SensorRig:
    """A rig and its sensor declarations by name on the rig. ValueError when it has not exactly one LiDAR."""
    poses = {}
    lidars: dict[str, LidarSensor] = {}
    cameras: dict[str, CameraSensor] = {}
    gnss: dict[str, GnssSensor] = {}
    imus: dict[str, ImuSensor] = {}
    for name, mount in rig.sensors.items():
        sensor = sensors[name]
        poses[name] = T_parent_body(mount.pose)
        if isinstance(sensor, LidarSensor):
            lidars[name] = sensor
        elif isinstance(sensor, CameraSensor):
            poses[name] = T_parent_optical(mount.pose)
            if mount.trigger_deg is not None:
                sensor = sensor.model_copy(update={"trigger_deg": mount.trigger_deg})
            cameras[name] = sensor
        elif isinstance(sensor, GnssSensor):
            gnss[name] = sensor
        else:
            imus[name] = sensor
    if len(lidars) != 1:
        raise ValueError(f"rig {rig.name} has {len(lidars)} LiDARs; exactly one is needed")
    (lidar_name, lidar), *_ = lidars.items()
    x, y = rig.ego_origin_m
    root_ego = Transform(rotation=np.eye(3), translation_m=np.array([x, y, 0.0]))
    return SensorRig(
        rig=rig,
        lidar_name=lidar_name,
        lidar=lidar,
        cameras=cameras,
        pinholes={name: pinhole(camera) for name, camera in cameras.items()},
        gnss_name=next(iter(gnss), None),
        gnss=next(iter(gnss.values()), None),
        imu_name=next(iter(imus), None),
        imu=next(iter(imus.values()), None),
        T_ego_sensor=poses,
        T_ego_root=root_ego.inverse(),
    )


def resized(rig: SensorRig, width_px: int, height_px: int) -> SensorRig:
    """The same rig with another image size (same horizontal field of view)."""
    cameras = {
        name: camera.model_copy(update={"width_px": width_px, "height_px": height_px})
        for name, camera in rig.cameras.items()
    }
    return replace(rig, cameras=cameras, pinholes={name: pinhole(c) for name, c in cameras.items()})
