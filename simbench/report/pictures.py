"""Instants of a job again: the same world, motion and scans, since all of it follows from the job."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8

from fusion.aoi import AoiConfig, clip, enlarge, map_into_boxes
from fusion.camera import PinholeCamera
from fusion.clustering import ClusteringConfig
from fusion.explain import AoiExplanation, explain_aoi
from fusion.ground import GroundConfig, remove_ground
from fusion.localize import planar_distance_m
from fusion.messages import Calibration, CategorySize, Detection, LidarScan
from fusion.shape import BenchmarkShapes, ShapeConfig
from fusion.timing import StepClock
from scenarios.seeding import stream
from simbench.capture import set_in_motion
from simbench.case import Images, Job
from simbench.exhibit import PairView
from simbench.faults.draw import Drawn, draw
from simbench.formats.targets import is_recorded, is_stored
from simbench.isolate.reference import is_ours
from simbench.motion import Motion, at
from simbench.plugins import load_pipeline
from simbench.report.recorded import RecordedReplay
from simbench.report.stored import StoredReplay
from simbench.report.words import stamp_words
from simbench.sensors import lidar
from simbench.sensors.camera import take
from simbench.sensors.render import Renderer
from simbench.sensors.rows import line_delay_ns
from simbench.stage import CATEGORIES, Stage, stage

LARGEST_PX = 2048  # along a picture's longer side: OpenGL's buffer
FOR_THE_READER = {"monochrome": False, "motion_blur_samples": 1, "noise": None, "jpeg_quality": None}


@runtime_checkable
class Takes(Protocol):
    """Gives the picture that a camera took at a true time."""

    def take(self, camera: str, capture_ns: int) -> UInt8[np.ndarray, "h w 3"]: ...


@runtime_checkable
class Replayed(Protocol):
    """A job made again, simulated or recorded: what pictures and figures need of it.

    told, categories: what the fusion was told. stamps: what a reader must know of late stamps.
    """

    @property
    def pinholes(self) -> Mapping[str, PinholeCamera]: ...

    @property
    def told(self) -> Calibration: ...

    @property
    def categories(self) -> Mapping[str, CategorySize]: ...

    @property
    def rate_hz(self) -> float: ...

    @property
    def stamps(self) -> str: ...

    def category_of(self, view: PairView) -> str: ...

    def scan(self, seq: int) -> LidarScan: ...

    def camera(self, images: Images, sharper: int = 1) -> AbstractContextManager[Takes]: ...


def replay_of(job: Job) -> Replayed:
    """The job again. Raises BadInput where its scenario or its files are not there any more."""
    if is_stored(job.scenario):
        return StoredReplay(job)
    return RecordedReplay(job) if is_recorded(job.scenario) else Replay(job)


class Replay:
    """A job's world in the job's motion. Raises BadInput where the job's scenario is not there any more."""

    def __init__(self, job: Job) -> None:
        self.staged: Stage = stage(job)
        rig, system = self.staged.rig, self.staged.system
        timing = {name: rig.timing(name, system.duration_s, job.seed) for name in rig.cameras}
        self.seed = job.seed
        self.drawn: Drawn = draw(rig, self.staged.world, self.staged.faults, timing, system, job.seed)
        self.motion: Motion = set_in_motion(self.staged.world, rig, system.ego, self.drawn)

    @property
    def pinholes(self) -> Mapping[str, PinholeCamera]:
        """The cameras as they are."""
        return self.staged.rig.pinholes

    @property
    def told(self) -> Calibration:
        """What the fusion was told."""
        return self.drawn.told

    @property
    def categories(self) -> Mapping[str, CategorySize]:
        """Mean sizes that the fusion was told."""
        return CATEGORIES

    @property
    def rate_hz(self) -> float:
        """Of the LiDAR."""
        return self.staged.rig.lidar.rate_hz

    @property
    def stamps(self) -> str:
        """What a reader must know of late stamps."""
        return stamp_words(tuple(self.staged.rig.cameras.values()))

    def category_of(self, view: PairView) -> str:
        """Of the target. KeyError: the scenario has none."""
        system = self.staged.system
        return system.actors[system.target or ""].category

    def scan(self, seq: int) -> LidarScan:
        """Scan `seq` exactly as it was delivered."""
        rig = self.staged.rig
        rng = stream(self.seed, "lidar", rig.lidar_name, str(seq))
        start_ns = seq * lidar.period_ns(rig.lidar)
        return lidar.sweep(rig.lidar_name, rig.lidar, self.motion, start_ns, seq, rng)[0]

    @contextmanager
    def camera(self, images: Images, sharper: int = 1) -> Iterator[Taker]:
        """Takes pictures while open, by rays or OpenGL. `sharper`: how many pixels of the picture lie along
        one of the camera's, less where it would be larger than LARGEST_PX. Raises gl.RenderingUnavailable."""
        if images != "gl":
            yield Taker(self, None, sharper)
            return
        with Renderer(self.staged.world) as renderer:
            yield Taker(self, renderer, sharper)


class Taker:
    """Pictures of a replay for the reader: from where and when the camera took them, but in colour, without
    noise, blur or JPEG. `renderer`: OpenGL's; None: by rays."""

    def __init__(self, replay: Replay, renderer: Renderer | None, sharper: int) -> None:
        self._replay, self._renderer, self._sharper = replay, renderer, sharper

    def take(self, camera: str, capture_ns: int) -> UInt8[np.ndarray, "h w 3"]:
        """What the camera sees at a true time."""
        replay = self._replay
        sensor, pinhole = replay.staged.rig.cameras[camera], replay.staged.rig.pinholes[camera]
        large = magnified(pinhole, self._sharper)
        if self._renderer is None:
            delay_ns = line_delay_ns(sensor) * pinhole.height_px / large.height_px
            plain = sensor.model_copy(update=FOR_THE_READER)
            return take(replay.motion, camera, plain, large, capture_ns, delay_ns, None).rgb
        pose = at(replay.motion.sensor(camera, np.array([capture_ns], dtype=np.int64)))
        return self._renderer.rgb(replay.motion, capture_ns, pose, large)


def magnified(camera: PinholeCamera, sharper: int) -> PinholeCamera:
    """The same view with more pixels, as far as the buffer goes."""
    factor = max(1, min(sharper, LARGEST_PX // max(camera.width_px, camera.height_px)))
    return replace(
        camera,
        fx_px=camera.fx_px * factor,
        fy_px=camera.fy_px * factor,
        cx_px=camera.cx_px * factor,
        cy_px=camera.cy_px * factor,
        width_px=camera.width_px * factor,
        height_px=camera.height_px * factor,
    )


def take_pictures(
    replay: Replayed, wanted: Sequence[tuple[str, int]], images: Images, sharper: int = 1
) -> dict[tuple[str, int], UInt8[np.ndarray, "h w 3"]]:
    """Pictures for a list of (camera, capture_ns)."""
    with replay.camera(images, sharper) as taker:
        return {key: taker.take(*key) for key in dict.fromkeys(wanted)}


# -- steps 1 to 4 of one instant ------------------------------------------------------------------------


@runtime_checkable
class _CategoryConfig(Protocol):
    @property
    def granularity_m(self) -> float: ...

    @property
    def min_points(self) -> int: ...


@runtime_checkable
class _Config(Protocol):
    ground: GroundConfig
    aoi: AoiConfig
    clustering: ClusteringConfig
    shape: ShapeConfig

    def of(self, category: str, sizes: dict[str, CategorySize]) -> _CategoryConfig: ...


@runtime_checkable
class SixSteps(Protocol):
    """A pipeline that tells its hyper-parameters and shapes, so that its steps can be shown."""

    config: _Config
    shapes: BenchmarkShapes


def explain_view(replay: Replayed, view: PairView, pipeline: str) -> AoiExplanation | None:
    """Steps 1 to 4 on the target's delivered box. None without a box, or where the pipeline has not the six
    steps, or is a user's: no code of theirs is loaded here."""
    if not is_ours(pipeline):
        return None
    steps = load_pipeline(pipeline)()
    if not isinstance(steps, SixSteps) or view.box_px is None:
        return None
    config, told, category = steps.config, replay.told, replay.category_of(view)
    camera = told.cameras[view.camera]
    aoi_px = clip(enlarge(view.box_px, config.aoi), camera)
    if aoi_px is None:
        return None
    scan = replay.scan(view.scan_seq)
    kept = np.flatnonzero(remove_ground(scan.xyz_m, told.T_ego_sensor[scan.sensor], config.ground).keep)
    T_camera_lidar = told.T_camera_lidar(view.camera, scan.sensor)
    (inside,) = map_into_boxes(np.ascontiguousarray(scan.xyz_m[kept].T), T_camera_lidar, camera, [aoi_px])
    points = kept[inside.points]
    entry = config.of(category, dict(replay.categories))
    return explain_aoi(
        camera=view.camera,
        detection=Detection(track_id=0, category=category, box_px=view.box_px, confidence=1.0),
        aoi_px=aoi_px,
        points=points,
        uv_px=inside.uv_px,
        distance_m=planar_distance_m(scan.xyz_m[points]),
        granularity_m=entry.granularity_m,
        min_points=entry.min_points,
        benchmark=steps.shapes.of(category),
        clustering=config.clustering,
        shape=config.shape,
        clock=StepClock(("clustering", "shape")),
    )
