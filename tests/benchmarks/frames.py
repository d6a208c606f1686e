"""One tenth of a second of the full rig: a rolling sweep and six pictures with ids and depth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from fusion.camera import PinholeCamera
from fusion.messages import LidarScan
from scenarios.load import load_scenario
from scenarios.scenario import CameraSensor, ImageNoise
from scenarios.seeding import stream
from simbench.axes import pinhole
from simbench.motion import Motion
from simbench.sensors import camera, lidar
from simbench.sensors.camera import Frame
from simbench.sensors.clock import CameraTiming
from simbench.sensors.rig import SensorRig
from simbench.stage import Stage, set_stage
from simbench.truth import ScanTruth
from tests.benchmarks.scene import SCENARIO, SEED, SYSTEM, still_motion

PLAIN: dict[str, object] = {
    "monochrome": False,
    "noise": None,
    "jpeg_quality": None,
    "motion_blur_samples": 1,
    "distortion": (0.0,) * 5,
}
EFFECTS: dict[str, object] = {
    "noise": ImageNoise(full_well_e=10_000.0, read_noise_e=8.0, gain=1.0),
    "jpeg_quality": 90,
    "motion_blur_samples": 3,
    "distortion": (-0.12, 0.03, 0.0005, -0.0005, 0.0),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Session:
    """A drive whose frames can be taken in any order."""

    rig: SensorRig
    motion: Motion
    cameras: Mapping[str, CameraSensor]
    pinholes: Mapping[str, PinholeCamera]
    timing: Mapping[str, CameraTiming]
    noisy: bool


def set_up(
    effects: bool, image_px: tuple[int, int] | None = None, duration_s: float | None = None
) -> Session:
    """The catalogue's drive, or one of another duration; all sensors with all effects or none, cameras in
    colour."""
    stage = drive_stage(duration_s, image_px)
    cameras = {
        name: sensor.model_copy(update={**PLAIN, **(EFFECTS if effects else {})})
        for name, sensor in stage.rig.cameras.items()
    }
    return Session(
        rig=stage.rig if effects else plain_lidar(stage.rig),
        motion=still_motion(stage),
        cameras=cameras,
        pinholes={name: pinhole(sensor) for name, sensor in cameras.items()},
        timing={name: stage.rig.timing(name, stage.system.duration_s, SEED) for name in cameras},
        noisy=effects,
    )


def plain_lidar(rig: SensorRig) -> SensorRig:
    """The rig with a LiDAR of thin, exact beams: of its effects only how far it sees is left."""
    return replace(rig, lidar=lidar.without(rig.lidar, *(e for e in lidar.EFFECTS if e not in lidar.LIMITS)))


def drive_stage(duration_s: float | None = None, image_px: tuple[int, int] | None = None) -> Stage:
    """The catalogue's stage, on wish for another duration."""
    family = load_scenario(SCENARIO)
    scenario = family.resolve(SEED)
    if duration_s is not None:
        longer = scenario.system(SYSTEM).model_copy(update={"duration_s": duration_s})
        scenario = scenario.model_copy(update={"systems": {**scenario.systems, SYSTEM: longer}})
    return set_stage(family, scenario, SYSTEM, family.fault_set(scenario), SEED, image_px)


def frames_of(session: Session) -> int:
    """How many whole frames the drive has."""
    return min(len(timing.mid_ns) for timing in session.timing.values()) - 1


def take(session: Session, number: int) -> tuple[LidarScan, ScanTruth, dict[str, Frame]]:
    """Sweep and pictures of one frame."""
    rig = session.rig
    rng = stream(SEED, "lidar", rig.lidar_name, str(number))
    start_ns = number * lidar.period_ns(rig.lidar)
    scan, truth = lidar.sweep(rig.lidar_name, rig.lidar, session.motion, start_ns, number, rng)
    return scan, truth, {name: picture(session, name, number) for name in session.cameras}


def picture(session: Session, name: str, number: int) -> Frame:
    """One camera's picture, ids and depth."""
    timing = session.timing[name]
    rng = stream(SEED, "image", name, str(number)) if session.noisy else None
    return camera.take(
        session.motion,
        name,
        session.cameras[name],
        session.pinholes[name],
        int(timing.mid_ns[number]),
        timing.line_delay_ns,
        rng,
    )
