"""Feed a recording's messages to a pipeline, one at a time, and keep what it says. Sees no truth."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from fusion.messages import (
    Calibration,
    CategorySize,
    FusionOutput,
    LidarScan,
    Measurement,
    Trajectory,
)
from fusion.pipeline import Pipeline


@dataclass(frozen=True, kw_only=True, eq=False)
class Driven:
    """Outputs in the order given; `scan_ms`: time spent per delivered scan (all its updates);
    `step_ns`: the pipeline's own clock by step, empty when it has none."""

    outputs: tuple[FusionOutput, ...]
    trajectories: tuple[Trajectory, ...]
    scan_ms: tuple[float, ...]
    step_ns: Mapping[str, tuple[int, ...]]


def drive(
    pipeline: Pipeline,
    calibration: Calibration,
    categories: Mapping[str, CategorySize],
    messages: Sequence[Measurement],
) -> Driven:
    """Run a pipeline over messages in order of arrival. Whatever it raises passes through; TypeError where
    it returns what is no answer. Its `categories` are its own, so that it cannot change another pipeline's.
    """
    outputs: list[FusionOutput] = []
    spent: list[float] = []
    pipeline.reset(calibration, MappingProxyType(dict(categories)))
    for message in messages:
        begun = time.perf_counter_ns()
        output = pipeline.update(message)
        took_ms = (time.perf_counter_ns() - begun) * 1e-6
        if isinstance(message, LidarScan):
            spent.append(took_ms)
        elif spent:
            spent[-1] += took_ms  # the work that a scan causes may come with a later message
        if isinstance(output, FusionOutput):
            outputs.append(output)
        elif output is not None:
            raise TypeError(f"update must return a FusionOutput or None, not {type(output).__name__}")
    trajectories = tuple(pipeline.trajectories())
    clock = getattr(pipeline, "timings_ns", None)
    return Driven(
        outputs=tuple(outputs),
        trajectories=trajectories,
        scan_ms=tuple(spent),
        step_ns={step: tuple(values) for step, values in clock().items()} if clock else {},
    )
