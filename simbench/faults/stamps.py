"""What stamps claim: a clock that is off, drifts, jumps; a stamp of another instant.

Every fault of this room moves the stamps of some sensors and nothing else. Receipts: the stamps before and
after of the same exposures and sweeps, found again by their true times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int64

from scenarios.faults import (
    ClockDrift,
    ClockOffset,
    FaultSpec,
    StampJitter,
    StampMeaning,
    StampOnSave,
    StampQuantum,
    StampStep,
)
from scenarios.seeding import stream
from simbench.faults import stamp_receipts
from simbench.faults.chances import late_ns, scattered, spread_by_median
from simbench.faults.delivery import Delivery, Shot, Sweep
from simbench.faults.fault import Acted, DeliveryFault, Site
from simbench.faults.flow import items, true_ns, with_items
from simbench.faults.receipt import Receipt
from simbench.faults.struck import struck
from simbench.sensors.clock import queued_ns

MS = 1e-6  # in a nanosecond


@dataclass(frozen=True, kw_only=True, eq=False)
class Clock:
    """One struck sensor in a run: true instants and stamps of its messages, and numbers of its own."""

    sensor: str
    true_ns: Int64[np.ndarray, " n"]
    stamp_ns: Int64[np.ndarray, " n"]
    site: Site
    rng: np.random.Generator


Claimed = tuple[Int64[np.ndarray, " n"], dict[str, float]]
"""The new stamps, and what was drawn for them by quantity."""


def _offset(spec: ClockOffset, clock: Clock) -> Claimed:
    return clock.stamp_ns + round(spec.offset_ms / MS), {"offset": spec.offset_ms}


def _drift(spec: ClockDrift, clock: Clock) -> Claimed:
    error_ns = spec.rate_ppm * 1e-6 * (clock.stamp_ns + spec.since_s * 1e9)
    drawn = {"rate": spec.rate_ppm, "error at time 0": spec.rate_ppm * 1e-3 * spec.since_s}
    return clock.stamp_ns + np.round(error_ns).astype(np.int64), drawn


def _jitter(spec: StampJitter, clock: Clock) -> Claimed:
    error_ms = spec.sd_ms * scattered(spec.distribution, len(clock.stamp_ns), clock.rng)
    drawn = {
        "mean": float(np.mean(error_ms)),
        "spread": spread_by_median(error_ms, spec.distribution),
    }
    return clock.stamp_ns + np.round(error_ms / MS).astype(np.int64), drawn


def _on_save(spec: StampOnSave, clock: Clock) -> Claimed:
    late = late_ns(spec.delay_ms, spec.jitter_ms, len(clock.true_ns), clock.rng)
    saved = queued_ns(clock.true_ns + late)
    lag_ms = (saved - clock.true_ns) * MS
    return saved, {"mean lag": float(lag_ms.mean()), "least lag": float(lag_ms.min())}


def _meaning(spec: StampMeaning, clock: Clock) -> Claimed:
    camera = clock.site.rig.cameras.get(clock.sensor)
    if camera is None:
        lasts_ms = 1e3 / clock.site.rig.lidar.rate_hz
    else:
        lasts_ms = camera.exposure_ms + camera.readout_ms
    shift_ms = spec.share * lasts_ms
    return clock.stamp_ns + round(shift_ms / MS), {"shift": shift_ms}


def _step(spec: StampStep, clock: Clock) -> Claimed:
    after = clock.stamp_ns >= spec.at_s * 1e9
    stepped = np.where(after, clock.stamp_ns + round(spec.step_ms / MS), clock.stamp_ns)
    return stepped.astype(np.int64), {"step": spec.step_ms, "at": spec.at_s}


def _quantum(spec: StampQuantum, clock: Clock) -> Claimed:
    grid_ns = max(round(spec.quantum_ms / MS), 1)
    lost_ns = clock.stamp_ns % grid_ns
    return clock.stamp_ns - lost_ns, {"rounded off": float(np.mean(lost_ns)) * MS}


def _entry(
    kind: type[FaultSpec],
    claim: Callable[[Any, Clock], Claimed],
    of_one: Callable[..., tuple[Receipt, ...]],
) -> DeliveryFault:
    """A fault that gives struck sensors the stamps that `claim` says."""

    def act(spec: FaultSpec, delivery: Delivery, site: Site) -> Acted:
        if spec.is_off:
            return Acted(delivery=delivery, realised={})
        changed: dict[str, list[Sweep | Shot]] = {}
        realised: dict[str, float] = {}
        for sensor in struck(spec, site.rig):
            now = items(delivery, site.rig, sensor)
            if not now:
                continue
            clock = Clock(
                sensor=sensor,
                true_ns=np.array([true_ns(item) for item in now], dtype=np.int64),
                stamp_ns=np.array([item.stamp_ns for item in now], dtype=np.int64),
                site=site,
                rng=stream(site.seed, "fault", spec.name, sensor),
            )
            stamps, drawn = claim(spec, clock)
            changed[sensor] = [
                item.timed(int(stamp), item.arrival_ns) for item, stamp in zip(now, stamps, strict=True)
            ]
            realised |= {f"{sensor} {quantity}": value for quantity, value in drawn.items()}
        return Acted(delivery=with_items(delivery, site.rig, changed), realised=realised)

    return DeliveryFault(spec=kind, act=act, receipts=stamp_receipts.of_every(of_one))


DELIVERED: tuple[DeliveryFault, ...] = (
    _entry(StampOnSave, _on_save, stamp_receipts.saved),
    _entry(StampMeaning, _meaning, stamp_receipts.another_instant),
    _entry(ClockOffset, _offset, stamp_receipts.offset),
    _entry(ClockDrift, _drift, stamp_receipts.drift),
    _entry(StampStep, _step, stamp_receipts.step),
    _entry(StampJitter, _jitter, stamp_receipts.jitter),
    _entry(StampQuantum, _quantum, stamp_receipts.quantum),
)
"""What is stamped first, then what the clock shows, then how it is written down."""
