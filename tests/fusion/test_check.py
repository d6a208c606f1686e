"""The conformance kit passes our pipelines and catches every breach that it names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from fusion.check import check_pipeline, digest, synthetic_run
from fusion.messages import (
    Calibration,
    CategorySize,
    FusionOutput,
    LidarScan,
    Measurement,
    Trajectory,
)
from fusion.pipeline import Pipeline
from fusion.pipelines.static_projection import StaticProjection
from tests.fusion.ours import OURS


@pytest.mark.parametrize("name", OURS)
def test_our_pipelines_keep_the_contract(name: str) -> None:
    assert check_pipeline(OURS[name]) == ()


class Wrapped:
    """A pipeline that keeps the contract; each subclass breaks it in one way."""

    def __init__(self) -> None:
        self.inner = StaticProjection()
        self.scans = 0

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        self.scans = 0
        self.inner.reset(calibration, categories)

    def update(self, measurement: Measurement) -> FusionOutput | None:
        output = self.inner.update(measurement)
        self.scans += output is not None
        return output if output is None else self.change(output, measurement)

    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        return output

    def trajectories(self) -> tuple[Trajectory, ...]:
        return self.inner.trajectories()


def edited(output: FusionOutput, **changes: object) -> FusionOutput:
    return replace(output, objects=tuple(replace(o, **changes) for o in output.objects))


class Raises(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        assert isinstance(measurement, LidarScan)
        measurement.xyz_m.max()  # an empty scan has no maximum
        return output


class Mutates(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        assert isinstance(measurement, LidarScan)
        measurement.xyz_m.setflags(write=True)
        measurement.xyz_m[:1] += 1.0
        return output


class Remembers(Wrapped):
    def __init__(self) -> None:
        super().__init__()
        self.ever = 0

    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        self.ever += 1
        return edited(output, confidence=1.0 / (1 + self.ever))


_CALLS = iter(range(1_000_000))


class Varies(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        return edited(output, confidence=1.0 / (1 + next(_CALLS)))


class NotFinite(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        return edited(output, position_ego_m=np.full(3, np.nan))


class OutOfSweep(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        return edited(output, stamp_ns=measurement.stamp_ns + 200_000_000)


class BadIndex(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        return edited(output, points=np.array([10**6]))


class Repeats(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        return replace(output, scan_seq=0)


class Foresees(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        return replace(output, scan_seq=output.scan_seq + 1)


class Invents(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        return edited(output, track_id=4711)


class NoObject(Wrapped):
    def change(self, output: FusionOutput, measurement: Measurement) -> FusionOutput:
        object.__setattr__(output, "objects", ({"track_id": 1},))
        return output


class NoTrajectory(Wrapped):
    def trajectories(self) -> tuple[Trajectory, ...]:
        return ("left", "right")  # type: ignore[return-value]


class HasNoReset:
    update = trajectories = staticmethod(lambda *_: None)


class GoesBack(Wrapped):
    def trajectories(self) -> tuple[Trajectory, ...]:
        return tuple(replace(t, stamp_ns=t.stamp_ns[::-1].copy()) for t in super().trajectories())


@pytest.mark.parametrize(
    ("factory", "message"),
    [
        (Raises, "raised ValueError"),
        (Mutates, "a message was changed"),
        (Remembers, "reset does not reset"),
        (Varies, "gave another output"),
        (NotFinite, "not finite"),
        (OutOfSweep, "outside the sweep"),
        (BadIndex, "indices"),
        (Repeats, "a second output"),
        (Foresees, "not delivered yet"),
        (Invents, "never detected"),
        (NoObject, "an object is a dict, not a LocalizedObject"),
        (NoTrajectory, "trajectories returned a str, not a Trajectory"),
        (HasNoReset, "reset raised AttributeError: 'HasNoReset' object has no attribute 'reset'"),
        (GoesBack, "ascend"),
    ],
)
def test_a_breach_of_the_contract_is_named(factory: Callable[[], Pipeline], message: str) -> None:
    assert any(message in failure for failure in check_pipeline(factory)), check_pipeline(factory)


def test_the_synthetic_run_comes_in_order_of_arrival_and_its_detections_are_paired_in_time() -> None:
    _, _, messages = synthetic_run()
    arrivals = [m.arrival_ns for m in messages]
    assert arrivals == sorted(arrivals)
    assert sum(isinstance(m, LidarScan) for m in messages) == 8


def test_the_digest_sees_one_changed_bit() -> None:
    _, _, messages = synthetic_run()
    scan = next(m for m in messages if isinstance(m, LidarScan))
    xyz = scan.xyz_m.copy()
    xyz[0, 0] = np.nextafter(xyz[0, 0], np.float32(100.0))
    assert digest(scan) == digest(replace(scan)) != digest(replace(scan, xyz_m=xyz))
