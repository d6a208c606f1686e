"""Pipelines that each break one relation, and a few that say nothing or fall over."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fusion.messages import (
    Calibration,
    CategorySize,
    Detections,
    FusionOutput,
    LidarScan,
    LocalizedObject,
    Measurement,
    Trajectory,
)
from fusion.pipelines.static_projection import StaticProjection, StaticProjectionGround


class Wrapped:
    """The paper's baseline, which holds in everything; each subclass changes its objects in one way."""

    def __init__(self) -> None:
        self.inner = StaticProjection()

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        self.told = calibration
        self.scans: dict[int, LidarScan] = {}
        self.cameras_heard: list[str] = []
        self.early_ms = 0.0
        self.inner.reset(calibration, categories)

    def update(self, measurement: Measurement) -> FusionOutput | None:
        if isinstance(measurement, LidarScan):
            self.scans[measurement.seq] = measurement
        if isinstance(measurement, Detections):
            if measurement.sensor not in self.cameras_heard:
                self.cameras_heard.append(measurement.sensor)
            self.early_ms = 1e-6 * (measurement.arrival_ns - measurement.stamp_ns) - 32.05
        output = self.inner.update(measurement)
        if output is None:
            return None
        scan = self.scans[output.scan_seq]
        return replace(output, objects=tuple(self.change(thing, scan) for thing in output.objects))

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        return thing

    def trajectories(self) -> tuple[Trajectory, ...]:
        return self.inner.trajectories()


def moved(thing: LocalizedObject, x_m: float) -> LocalizedObject:
    return replace(thing, position_ego_m=thing.position_ego_m + np.array([x_m, 0.0, 0.0]))


def chosen(thing: LocalizedObject, scan: LidarScan, index: int) -> LocalizedObject:
    """The object as that one of its points."""
    points = thing.points[[index]]
    return replace(thing, points=points, stamp_ns=scan.stamp_ns + int(scan.offset_ns[points[0]]))


class PrefersLeft(Wrapped):
    """Takes the leftmost point of an object."""

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        return chosen(thing, scan, int(np.argmax(scan.xyz_m[thing.points, 1])))


class TrustsOrder(Wrapped):
    """Takes the point of an object that is listed first."""

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        return chosen(thing, scan, 0)


class TrustsAxes(Wrapped):
    """Takes the LiDAR's x axis for the ego's."""

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        return moved(thing, 0.01 * float(np.mean(scan.xyz_m[thing.points, 0])))


class CountsCameras(Wrapped):
    """Drifts with the number of cameras."""

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        return moved(thing, 0.01 * len(self.cameras_heard))


class KnowsTheHour(Wrapped):
    """Drifts with the time since the clocks' beginning."""

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        return moved(thing, 1e-12 * scan.stamp_ns)


class ReadsTheClock(Wrapped):
    """Drifts with the time on the wall."""

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        return moved(thing, 1e-9 * (time.perf_counter_ns() % 1_000_000))


class Shares(Wrapped):
    """Keeps what it saw in the class, where every instance finds it; only a reset clears that."""

    seen = 0

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        type(self).seen = 0
        super().reset(calibration, categories)

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        type(self).seen += 1
        return moved(thing, 0.01 * self.seen)


class LostInDetail(Wrapped):
    """Knows ground from the rest, but gives up on that where points are many."""

    def __init__(self) -> None:
        super().__init__()
        self.careful, self.careless = StaticProjectionGround(), StaticProjection()

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        super().reset(calibration, categories)
        self.many = False
        self.careful.reset(calibration, categories)
        self.careless.reset(calibration, categories)

    def update(self, measurement: Measurement) -> FusionOutput | None:
        if isinstance(measurement, LidarScan):
            self.many = len(measurement.xyz_m) > 20_000
        careful, careless = self.careful.update(measurement), self.careless.update(measurement)
        return careless if self.many else careful


class Compensates(Wrapped):
    """Moves objects by the time that a camera is off, whatever its sign."""

    def change(self, thing: LocalizedObject, scan: LidarScan) -> LocalizedObject:
        return moved(thing, 0.005 * abs(self.early_ms))


class Silent(Wrapped):
    """Finds nothing."""

    def update(self, measurement: Measurement) -> FusionOutput | None:
        output = super().update(measurement)
        return None if output is None else replace(output, objects=())

    def trajectories(self) -> tuple[Trajectory, ...]:
        return ()


class FallsOver(Wrapped):
    """Divides by zero at the third scan."""

    def update(self, measurement: Measurement) -> FusionOutput | None:
        if len(self.scans) == 3:
            return 1 // 0  # type: ignore[return-value]
        return super().update(measurement)
