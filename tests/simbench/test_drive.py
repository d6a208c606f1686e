"""Driving a pipeline: one message at a time, its own data, and whatever it does is its own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from fusion.messages import (
    Calibration,
    CategorySize,
    Detections,
    FusionOutput,
    LidarScan,
    Measurement,
    Trajectory,
)
from simbench.drive import Driven, drive
from simbench.stage import CATEGORIES
from tests.simbench.cheats import ReturnsText, Silent
from tests.simbench.support import recorded, staged


class Notebook(Silent):
    """Writes down all that it gets."""

    def __init__(self) -> None:
        self.heard: list[Measurement] = []
        self.sizes: Mapping[str, CategorySize] = {}

    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None:
        self.heard.clear()
        self.sizes = categories

    def update(self, measurement: Measurement) -> FusionOutput | None:
        self.heard.append(measurement)
        if isinstance(measurement, LidarScan):
            return FusionOutput(scan_sensor=measurement.sensor, scan_seq=measurement.seq, objects=())
        return None

    def trajectories(self) -> tuple[Trajectory, ...]:
        return (
            Trajectory(
                track_id=3,
                stamp_ns=np.array([1], dtype=np.int64),
                position_ego_m=np.zeros((1, 3)),
                inlier=np.array([True]),
            ),
        )

    def timings_ns(self) -> dict[str, list[int]]:
        return {"listen": [1, 2, 3]}


@pytest.fixture(scope="module")
def recording():  # type: ignore[no-untyped-def]
    return recorded(staged(duration_s=0.5)).recording


def driven(pipeline: object, recording) -> Driven:  # type: ignore[no-untyped-def]
    return drive(pipeline, recording.calibration, recording.categories, recording.messages)  # type: ignore[arg-type]


def test_messages_come_one_at_a_time_in_order_of_arrival(recording) -> None:  # type: ignore[no-untyped-def]
    pipeline = Notebook()
    found = driven(pipeline, recording)
    assert tuple(pipeline.heard) == recording.messages
    assert [m.arrival_ns for m in pipeline.heard] == sorted(m.arrival_ns for m in recording.messages)
    assert [o.scan_seq for o in found.outputs] == [0, 1, 2, 3, 4]
    assert [t.track_id for t in found.trajectories] == [3]


def test_time_is_counted_per_delivered_scan_and_step(recording) -> None:  # type: ignore[no-untyped-def]
    found = driven(Notebook(), recording)
    assert len(found.scan_ms) == 5 and min(found.scan_ms) > 0.0
    assert found.step_ns == {"listen": (1, 2, 3)}
    assert driven(Silent(), recording).step_ns == {}


def test_a_pipeline_has_categories_of_its_own(recording) -> None:  # type: ignore[no-untyped-def]
    pipeline = Notebook()
    driven(pipeline, recording)
    assert dict(pipeline.sizes) == dict(CATEGORIES) and pipeline.sizes is not CATEGORIES
    with pytest.raises(TypeError):
        pipeline.sizes["rider"] = CATEGORIES["car"]  # type: ignore[index]


def test_an_answer_that_is_none_is_refused(recording) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(TypeError, match="must return a FusionOutput or None, not str"):
        driven(ReturnsText(), recording)


def test_what_a_pipeline_raises_passes_through(recording) -> None:  # type: ignore[no-untyped-def]
    class Deaf(Silent):
        def update(self, measurement: Measurement) -> FusionOutput | None:
            if isinstance(measurement, Detections):
                raise LookupError("no such camera")
            return None

    with pytest.raises(LookupError, match="no such camera"):
        driven(Deaf(), recording)
