"""The contract of a fusion pipeline, in words and as a type.

A pipeline is any object with three methods. The bench makes it by calling its factory without arguments.

* `reset(calibration, categories)` starts a run. `categories` maps a category to its mean size and spread:
  never the size of the object that is simulated.
* `update(measurement)` takes one message at a time, in order of arrival, and may return one `FusionOutput`
  for a scan that was delivered so far: at most one per scan, a second one is a contract error. An object's
  `stamp_ns` lies within its sweep, its `points` index that scan, and all numbers are finite.
* `trajectories()` is called once at the end; smoothing may look back over the whole run.

A pipeline sees no truth and no simulator time. It may return the time of its steps by a method
`timings_ns() -> Mapping[str, Sequence[int]]` (step name -> nanoseconds, one number per scan since `reset`),
which the bench reports when it is there. A class attribute `reads_images = False` says that it ignores
`CameraImage` messages: they are then not rendered, unless another pipeline of the run reads them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from fusion.messages import Calibration, CategorySize, FusionOutput, Measurement, Trajectory


@runtime_checkable
class Pipeline(Protocol):
    def reset(self, calibration: Calibration, categories: Mapping[str, CategorySize]) -> None: ...

    def update(self, measurement: Measurement) -> FusionOutput | None: ...

    def trajectories(self) -> tuple[Trajectory, ...]: ...
