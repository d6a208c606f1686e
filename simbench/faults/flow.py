"""The messages of one sensor as they flow: which ones a fault strikes, and what they say of time.

Injectors take `items` and give `with_items`. Receipts look at `Times`: for every message the true instant of
what it holds, its stamp and its arrival.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int64

from scenarios.faults import FaultSpec
from simbench.faults.delivery import Delivery, Shot, Sweep
from simbench.faults.fault import Step
from simbench.faults.receipt import Receipt, untouched
from simbench.faults.struck import struck
from simbench.sensors.rig import SensorRig

COUNT_SD = 1e-6  # of what is counted or read off in whole nanoseconds


def items(delivery: Delivery, rig: SensorRig, sensor: str) -> tuple[Sweep | Shot, ...]:
    """What one sensor delivers, in order of arrival."""
    found = delivery.sweeps if sensor == rig.lidar_name else delivery.shots[sensor]
    return tuple(sorted(found, key=lambda item: item.arrival_ns))


def with_items(delivery: Delivery, rig: SensorRig, changed: Mapping[str, Sequence[Sweep | Shot]]) -> Delivery:
    """The delivery with other messages of some sensors."""
    sweeps = delivery.sweeps
    if rig.lidar_name in changed:
        sweeps = tuple(item for item in changed[rig.lidar_name] if isinstance(item, Sweep))
    shots = {
        name: tuple(item for item in changed[name] if isinstance(item, Shot))
        for name in delivery.shots
        if name in changed
    }
    return replace(delivery, sweeps=sweeps, shots={**delivery.shots, **shots})


def true_ns(item: Sweep | Shot) -> int:
    """The middle of the exposure, or the first firing; of a sweep without returns, what its stamp says."""
    if isinstance(item, Shot):
        return item.truth.capture_ns
    if len(item.truth.fire_ns) == 0:
        return item.stamp_ns
    return int(item.truth.fire_ns[0]) - int(item.scan.offset_ns[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Times:
    """One row per message of a sensor in the order of what it shows, then of stamp and arrival."""

    true_ns: Int64[np.ndarray, " n"]
    stamp_ns: Int64[np.ndarray, " n"]
    arrival_ns: Int64[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.true_ns)

    def rows(self, *columns: str) -> list[tuple[int, ...]]:
        """Some columns, row by row."""
        return list(zip(*(getattr(self, column).tolist() for column in columns), strict=True))


def times(delivery: Delivery, rig: SensorRig, sensor: str) -> Times:
    """Of all messages of a sensor but sweeps without a return, which show no instant."""
    seen = [
        (true_ns(item), item.stamp_ns, item.arrival_ns)
        for item in items(delivery, rig, sensor)
        if isinstance(item, Shot) or len(item.truth.fire_ns) > 0
    ]
    table = np.array(sorted(seen), dtype=np.int64).reshape(-1, 3)
    return Times(true_ns=table[:, 0], stamp_ns=table[:, 1], arrival_ns=table[:, 2])


def elsewhere(spec: FaultSpec, step: Step, rig: SensorRig, keeps: tuple[str, ...]) -> tuple[Receipt, ...]:
    """How many messages changed that should not have: of struck sensors those that are new in the columns
    that the fault keeps, of all others those that differ in anything.
    """
    changed = 0
    named = struck(spec, rig)
    for sensor in (rig.lidar_name, *rig.cameras):
        before, after = times(step.before, rig, sensor), times(step.after, rig, sensor)
        if sensor in named:
            known = set(before.rows(*keeps))
            changed += sum(row not in known for row in after.rows(*keeps))
        else:
            every = ("true_ns", "stamp_ns", "arrival_ns")
            one, two = Counter(before.rows(*every)), Counter(after.rows(*every))
            changed += (one - two).total() + (two - one).total()
    return untouched(
        fault=spec.name,
        quantity="messages changed beside",
        unit="1",
        found=[(float(changed), 0.1)],
        note="true times, stamps and arrivals of all sensors, counted",
    )
