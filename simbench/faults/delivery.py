"""What the sensors deliver in a run, sensor by sensor, before it is put in order of arrival.

Faults that act on what was measured (`deliver.py`) take a delivery and give another one. Message and truth
stay side by side, so that what drops a message or a point drops its truth with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Int64

from fusion.messages import CameraImage, Detections, EgoMotion, LidarScan, Measurement
from simbench.truth import GnssReference, ImageTruth, ScanTruth

Item = TypeVar("Item", "Sweep", "Shot")
KINDS = ("EgoMotion", "CameraImage", "Detections", "LidarScan")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """One delivered sweep and the truth of its points, in the same order."""

    scan: LidarScan
    truth: ScanTruth

    @property
    def stamp_ns(self) -> int:
        return self.scan.stamp_ns

    @property
    def arrival_ns(self) -> int:
        return self.scan.arrival_ns

    def counted(self, seq: int) -> Sweep:
        """The same sweep as number `seq`."""
        return Sweep(scan=replace(self.scan, seq=seq), truth=replace(self.truth, seq=seq))

    def timed(self, stamp_ns: int, arrival_ns: int) -> Sweep:
        """The same sweep with another stamp and arrival."""
        return replace(self, scan=replace(self.scan, stamp_ns=stamp_ns, arrival_ns=arrival_ns))

    def keep(self, kept: Bool[np.ndarray, " n"] | Int64[np.ndarray, " k"]) -> Sweep:
        """Only some of the points (a mask, or rows in firing order)."""
        scan, truth = self.scan, self.truth
        return Sweep(
            scan=replace(
                scan, xyz_m=scan.xyz_m[kept], intensity=scan.intensity[kept], offset_ns=scan.offset_ns[kept],
                ring=scan.ring[kept],
            ),
            truth=replace(
                truth, object_id=truth.object_id[kept], part_id=truth.part_id[kept],
                true_range_m=truth.true_range_m[kept], fire_ns=truth.fire_ns[kept],
                incidence_rad=truth.incidence_rad[kept],
            ),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """What a camera delivers of one exposure: boxes, the image where pictures are taken, and their truth."""

    detections: Detections
    image: CameraImage | None
    truth: ImageTruth

    @property
    def stamp_ns(self) -> int:
        return self.detections.stamp_ns

    @property
    def arrival_ns(self) -> int:
        return self.detections.arrival_ns

    def counted(self, seq: int) -> Shot:
        """The same exposure as number `seq`."""
        return Shot(
            detections=replace(self.detections, seq=seq),
            image=None if self.image is None else replace(self.image, seq=seq),
            truth=replace(self.truth, seq=seq),
        )

    def timed(self, stamp_ns: int, arrival_ns: int) -> Shot:
        """The same exposure with another stamp and arrival."""
        return replace(
            self,
            detections=replace(self.detections, stamp_ns=stamp_ns, arrival_ns=arrival_ns),
            image=None
            if self.image is None
            else replace(self.image, stamp_ns=stamp_ns, arrival_ns=arrival_ns),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Delivery:
    """All sweeps, all shots by camera, all ego motions and the reference of a run."""

    sweeps: tuple[Sweep, ...]
    shots: Mapping[str, tuple[Shot, ...]]
    motions: tuple[EgoMotion, ...]
    reference: GnssReference | None

    def with_shots(self, cameras: Iterable[str], change: Callable[[Shot], Shot]) -> Delivery:
        """Every shot of some cameras changed."""
        changed = {name: tuple(change(shot) for shot in self.shots[name]) for name in cameras}
        return replace(self, shots={**self.shots, **changed})

    def with_sweeps(self, change: Callable[[Sweep], Sweep]) -> Delivery:
        """Every sweep changed."""
        return replace(self, sweeps=tuple(change(sweep) for sweep in self.sweeps))

    @property
    def messages(self) -> tuple[Measurement, ...]:
        """All messages in order of arrival."""
        shots = [shot for taken in self.shots.values() for shot in taken]
        return in_order_of_arrival(
            [
                *(sweep.scan for sweep in self.sweeps),
                *(shot.detections for shot in shots),
                *(shot.image for shot in shots if shot.image is not None),
                *self.motions,
            ]
        )


def counted(delivery: Delivery) -> Delivery:
    """The same delivery with every sensor's deliveries counted from 0 as they arrive."""
    motions = sorted(delivery.motions, key=lambda m: m.arrival_ns)
    return replace(
        delivery,
        sweeps=_counted(delivery.sweeps),
        shots={name: _counted(shots) for name, shots in delivery.shots.items()},
        motions=tuple(m if m.seq == i else replace(m, seq=i) for i, m in enumerate(motions)),
    )


def _counted(items: Sequence[Item]) -> tuple[Item, ...]:
    ordered = sorted(items, key=lambda item: item.arrival_ns)
    return tuple(item.counted(i) for i, item in enumerate(ordered))


def in_order_of_arrival(messages: Iterable[Measurement]) -> tuple[Measurement, ...]:
    """Sorted by arrival; ties by kind, sensor and count, so that the order never depends on how it was
    made.
    """
    return tuple(
        sorted(messages, key=lambda m: (m.arrival_ns, KINDS.index(type(m).__name__), m.sensor, m.seq))
    )
