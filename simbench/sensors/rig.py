"""A rig file with its sensor files read: who measures, from where, and when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import Calibration
from scenarios.scenario import CameraSensor, GnssSensor, ImuSensor, LidarSensor, Rig, Sensor
from scenarios.seeding import stream
from simbench.axes import T_parent_body, T_parent_optical, pinhole
from simbench.sensors.clock import CameraTiming, camera_timing, drawn_ns
from simbench.sensors.lidar import beam_table, passing_offset_ns, period_ns

TRAILING_SWEEPS = 3  # cameras and IMU go on after the last sweep, so that late messages still settle it
BEYOND_NS = 300_000_000  # and so much longer GNSS and IMU


@dataclass(frozen=True, kw_only=True)
class Phases:
    """When sensors that run on their own measure first, after time 0."""

    gnss_ns: int
    imu_ns: int
    odometer_ns: int


@dataclass(frozen=True, kw_only=True)
class SensorRig:
    """The sensors of a rig. Poses are in the ego frame at rest; `pinholes` are the true intrinsics.

    trigger_deg: the spin angle (LiDAR frame) that fires each triggered camera, the rig's pulse or its own.
    in_phase: whatever fires them, all cameras are in the middle of an exposure when the scan fires along
    their axes (`switches.py`).
    """

    rig: Rig
    lidar_name: str
    lidar: LidarSensor
    cameras: Mapping[str, CameraSensor]
    pinholes: Mapping[str, PinholeCamera]
    trigger_deg: Mapping[str, float]
    gnss_name: str | None
    gnss: GnssSensor | None
    imu_name: str | None
    imu: ImuSensor | None
    T_ego_sensor: Mapping[str, Transform]
    T_ego_root: Transform
    in_phase: bool = False

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
        sensor, period = self.cameras[camera], period_ns(self.lidar)
        run_ns = self.sweeps(duration_s) * period
        if self.in_phase:
            open_ns, readout_ns = round(sensor.exposure_ms * 1e6), round(sensor.readout_ms * 1e6)
            first_ns = fire_offset_ns(self, axis_deg(self, camera)) - (open_ns + readout_ns) // 2
            period //= max(round(sensor.rate_hz / self.lidar.rate_hz), 1)
        elif sensor.trigger == "free_run":
            first_ns = drawn_ns(sensor.phase_ms, stream(seed, "camera", camera, "phase"))
            period = round(1e9 / sensor.rate_hz)
        else:
            pulse_ns = passing_offset_ns(self.lidar, self.trigger_deg[camera])
            first_ns = pulse_ns + round(sensor.delay_ms * 1e6)
        frames = int(np.ceil(run_ns / period)) + TRAILING_SWEEPS
        return camera_timing(sensor, first_ns, period, frames, stream(seed, "camera", camera, "host"))

    def end_ns(self, duration_s: float, timing: Mapping[str, CameraTiming]) -> int:
        """Until when GNSS and IMU go on: past the last sweep and the last image."""
        last_ns = max((int(t.mid_ns[-1]) for t in timing.values()), default=0)
        return max(last_ns, self.sweeps(duration_s) * period_ns(self.lidar)) + BEYOND_NS

    def phases(self, seed: int) -> Phases:
        """The first instants of GNSS, IMU and odometer in a run; 0 for what the rig does not carry."""

        def drawn(phase_ms: float | tuple[float, float], *path: str) -> int:
            return drawn_ns(phase_ms, stream(seed, *path, "phase"))

        gnss, imu = self.gnss, self.imu
        return Phases(
            gnss_ns=drawn(gnss.phase_ms, "gnss") if gnss is not None else 0,
            imu_ns=drawn(imu.phase_ms, "imu") if imu is not None else 0,
            odometer_ns=drawn(imu.odometer_phase_ms, "odometer") if imu is not None else 0,
        )


def axis_deg(rig: SensorRig, camera: str) -> float:
    """The azimuth of a camera's axis in the LiDAR's frame, -180 to 180."""
    R_ego_lidar = rig.T_ego_sensor[rig.lidar_name].rotation
    forward = R_ego_lidar.T @ rig.T_ego_sensor[camera].rotation[:, 2]
    return float(np.rad2deg(np.arctan2(forward[1], forward[0])))


def fire_offset_ns(rig: SensorRig, azimuth_deg: float) -> int:
    """When, after the start of a sweep, the LiDAR fires the columns that look along an azimuth of its frame
    (mean over the beams)."""
    turning = beam_table(rig.lidar.model_copy(update={"rolling": True})).fire_offset_ns.mean(axis=1)
    gap_ns = np.abs(turning - passing_offset_ns(rig.lidar, azimuth_deg))
    at = np.argmin(np.minimum(gap_ns, period_ns(rig.lidar) - gap_ns))
    return round(float(beam_table(rig.lidar).fire_offset_ns.mean(axis=1)[at]))


def assemble(rig: Rig, sensors: Mapping[str, Sensor]) -> SensorRig:
    """A rig and its sensor declarations by name on the rig. ValueError: it has not exactly one LiDAR, or a
    triggered camera has no angle."""
    poses = {}
    lidars: dict[str, LidarSensor] = {}
    cameras: dict[str, CameraSensor] = {}
    gnss: dict[str, GnssSensor] = {}
    imus: dict[str, ImuSensor] = {}
    trigger_deg: dict[str, float] = {}
    for name, mount in rig.sensors.items():
        sensor = sensors[name]
        poses[name] = T_parent_body(mount.pose)
        if isinstance(sensor, LidarSensor):
            lidars[name] = sensor
        elif isinstance(sensor, CameraSensor):
            poses[name] = T_parent_optical(mount.pose)
            cameras[name] = sensor
            if sensor.trigger == "lidar_angle":
                trigger_deg[name] = _trigger_deg(rig, name)
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
        trigger_deg=trigger_deg,
        gnss_name=next(iter(gnss), None),
        gnss=next(iter(gnss.values()), None),
        imu_name=next(iter(imus), None),
        imu=next(iter(imus.values()), None),
        T_ego_sensor=poses,
        T_ego_root=root_ego.inverse(),
    )


def _trigger_deg(rig: Rig, camera: str) -> float:
    own_deg = rig.sensors[camera].trigger_deg
    angle_deg = rig.pulse_deg if own_deg is None else own_deg
    if angle_deg is None:
        raise ValueError(f"camera {camera} of rig {rig.name} waits for a pulse that the rig never sends")
    return angle_deg


def resized(rig: SensorRig, width_px: int, height_px: int) -> SensorRig:
    """The same rig with another image size (same horizontal field of view)."""
    cameras = {
        name: camera.model_copy(update={"width_px": width_px, "height_px": height_px})
        for name, camera in rig.cameras.items()
    }
    return replace(rig, cameras=cameras, pinholes={name: pinhole(c) for name, c in cameras.items()})
