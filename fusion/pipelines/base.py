"""What every pipeline that answers scan by scan shares: pairing, timing, tracks. `map_scan` is the method."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

from fusion.aoi import AoiConfig, clip, enlarge
from fusion.camera import PinholeCamera
from fusion.messages import (
    BoxPx,
    Calibration,
    CategorySize,
    Detection,
    Detections,
    FusionOutput,
    LidarScan,
    LocalizedObject,
    Measurement,
    Trajectory,
)
from fusion.pairing import Pairing
from fusion.smooth import SmootherConfig
from fusion.timing import StepClock
from fusion.tracks import Tracks


class ScanPipeline(ABC):
    """Answers every scan, once its detections have come, with what `map_scan` finds (`fusion/pairing.py`).

    Images and ego motion are ignored: the paper's method uses detections only and does not deskew.
    """

    reads_images: ClassVar[bool] = False
    steps: ClassVar[tuple[str, ...]]  # names for `timings_ns`; "smooth" is added

    def __init__(self, smoother: SmootherConfig) -> None:
        self._smoother = smoother
        self._calibration: Calibration | None = None

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        """Start a run: forget everything but the configuration."""
        self._calibration = calibration
        self._categories = dict(categories)
        self._pairing = Pairing(cameras=calibration.cameras)
        self._tracks = Tracks()
        self._clock = StepClock(self.steps)
        self._smooth_clock = StepClock(("smooth",))

    def update(self, measurement: Measurement) -> FusionOutput | None:
        """One message; the output of the scan that it settles. ValueError: a sensor without calibration."""
        if self._calibration is None:
            raise RuntimeError("update before reset: the pipeline has no calibration")
        if isinstance(measurement, Detections):
            if measurement.sensor not in self._calibration.cameras:
                raise ValueError(_unknown("camera", measurement.sensor, self._calibration.cameras))
            self._pairing.add(measurement)
        elif isinstance(measurement, LidarScan):
            if measurement.sensor not in self._calibration.T_ego_sensor:
                raise ValueError(_unknown("LiDAR", measurement.sensor, self._calibration.T_ego_sensor))
            self._pairing.hold(measurement)
        settled = self._pairing.settle(measurement.arrival_ns)
        return None if settled is None else self._answer(*settled, self._calibration)

    def trajectories(self) -> tuple[Trajectory, ...]:
        """Step 6: one smoothed trajectory per track id, from the samples of all cameras."""
        with self._smooth_clock("smooth"):
            smoothed = self._tracks.trajectories(self._smoother)
        self._smooth_clock.close_scan()
        return smoothed

    def timings_ns(self) -> Mapping[str, Sequence[int]]:
        """Step name to nanoseconds: one number per scan, for "smooth" one per call of `trajectories`."""
        return {**self._clock.timings_ns(), **self._smooth_clock.timings_ns()}

    @abstractmethod
    def map_scan(
        self, scan: LidarScan, paired: tuple[Detections, ...], calibration: Calibration, clock: StepClock
    ) -> tuple[LocalizedObject, ...]:
        """The objects of a scan, given the detections of each camera that are paired with it."""

    def _answer(
        self, scan: LidarScan, paired: tuple[Detections, ...], calibration: Calibration
    ) -> FusionOutput:
        objects = self.map_scan(scan, paired, calibration, self._clock)
        self._clock.close_scan()
        self._tracks.add(scan, objects)
        return FusionOutput(scan_sensor=scan.sensor, scan_seq=scan.seq, objects=objects)


def areas(
    detections: Detections, camera: PinholeCamera, config: AoiConfig
) -> tuple[tuple[Detection, BoxPx], ...]:
    """Every detection with its AOI: enlarged, then cut at the image's border.

    Left out: what is no box (numbers that are not finite, no area) and what lies outside the image.
    """
    return tuple(
        (detection, aoi_px)
        for detection in detections.boxes
        if _is_box(detection) and (aoi_px := clip(enlarge(detection.box_px, config), camera)) is not None
    )


def _is_box(detection: Detection) -> bool:
    x0, y0, x1, y1 = detection.box_px
    return all(map(math.isfinite, (x0, y0, x1, y1, detection.confidence))) and x0 < x1 and y0 < y1


def _unknown(kind: str, name: str, known: Mapping[str, object]) -> str:
    return f"{kind} {name!r} has no calibration; known: {', '.join(sorted(known)) or 'none'}"
