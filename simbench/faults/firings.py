"""What the injectors of LiDAR faults share: which firing made a point, draws per firing, and false points.

A draw is one number per firing of the sweep, returned or not, so that no draw depends on the scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from scenarios.scenario import LidarSensor
from scenarios.seeding import stream
from simbench.faults.delivery import Delivery, Sweep
from simbench.faults.fault import Site
from simbench.sensors.beams import beam_table
from simbench.sensors.returns import SOFT_EDGE, max_range_m


def firings(sensor: LidarSensor) -> int:
    """How many firings a sweep has."""
    return sensor.columns * len(sensor.elevation_deg)


def firing_of(sweep: Sweep, sensor: LidarSensor) -> Int64[np.ndarray, " n"]:
    """Which firing made each point: its column times the beams of a column, plus its beam."""
    table = beam_table(sensor)
    ring = sweep.scan.ring.astype(np.int64)
    delay_ns = table.fire_offset_ns[0, ring] - table.column_offset_ns[0]
    column = np.searchsorted(table.column_offset_ns, sweep.scan.offset_ns - delay_ns)
    return np.asarray(column * len(table.order) + ring)


def uniform(site: Site, fault: str, seq: int, what: str = "") -> Float64[np.ndarray, " f"]:
    """One number in 0..1 per firing of sweep `seq`."""
    rng = stream(site.seed, "fault", fault, site.rig.lidar_name, str(seq), *([what] if what else []))
    return np.asarray(rng.random(firings(site.rig.lidar)))


def normal(site: Site, fault: str, seq: int) -> Float64[np.ndarray, " f"]:
    """One standard normal number per firing of sweep `seq`."""
    rng = stream(site.seed, "fault", fault, site.rig.lidar_name, str(seq))
    return np.asarray(rng.standard_normal(firings(site.rig.lidar)))


def each(delivery: Delivery, change: Callable[[Sweep], Sweep]) -> Delivery:
    """Every sweep that has points changed."""
    return delivery.with_sweeps(lambda sweep: change(sweep) if len(sweep.scan.ring) else sweep)


def moved(sweep: Sweep, xyz_m: Float[np.ndarray, "n 3"]) -> Sweep:
    """The same points elsewhere; their truth stays."""
    return replace(sweep, scan=replace(sweep.scan, xyz_m=xyz_m.astype(np.float32)))


def detection_ratio(
    sensor: LidarSensor,
    range_m: Float64[np.ndarray, " n"],
    intensity: Float[np.ndarray, " n"],
    passing: Float64[np.ndarray, " n"],
) -> Float64[np.ndarray, " n"]:
    """Chance that a point that was seen is still seen when only `passing` of its power comes back: by the
    sensor's own range law, with the edge as soft as the sensor has it.
    """

    def log_chance(reflectivity: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        excess = (range_m / max_range_m(sensor, reflectivity) - 1.0) / SOFT_EDGE
        return np.asarray(-np.logaddexp(0.0, excess))

    was = intensity.astype(np.float64)
    return np.asarray(np.exp(np.minimum(log_chance(was * passing) - log_chance(was), 0.0)))


def dimmed(
    sweep: Sweep, sensor: LidarSensor, passing: Float64[np.ndarray, " n"], draw: Float64[np.ndarray, " f"]
) -> Sweep:
    """What is left of a sweep when only `passing` of each point's power comes back. What comes from no target
    at all (the receiver's own false points) stays.
    """
    scan, truth = sweep.scan, sweep.truth
    real = truth.part_id >= 0
    chance = detection_ratio(sensor, truth.true_range_m, scan.intensity, passing)
    seen = ~real | (draw[firing_of(sweep, sensor)] < chance)
    weaker = np.where(real, scan.intensity * passing, scan.intensity).astype(np.float32)
    return replace(sweep, scan=replace(scan, intensity=weaker)).keep(seen)


def with_false_points(
    sweep: Sweep,
    sensor: LidarSensor,
    at: Int64[np.ndarray, " k"],
    range_m: Float64[np.ndarray, " k"],
    intensity: Float32[np.ndarray, " k"],
) -> Sweep:
    """Points that nobody is at, by these firings (ascending), each in place of what the firing had returned.

    Their truth is that of the sensor's own false points: no object, no part, and their own range as the true
    one. So they count as nobody's in every score, and no range error is read from them.
    """
    table = beam_table(sensor)
    kept = sweep.keep(~np.isin(firing_of(sweep, sensor), at))
    column, beam = np.divmod(at, len(table.order))
    offset_ns = table.fire_offset_ns[column, beam]
    start_ns = sweep.scan.stamp_ns
    if len(sweep.truth.fire_ns):
        start_ns = int(sweep.truth.fire_ns[0] - sweep.scan.offset_ns[0])
    rank = np.empty(len(table.order), dtype=np.int64)
    rank[table.order] = np.arange(len(table.order))
    firing = np.concatenate([firing_of(kept, sensor), at])
    turn = np.argsort(firing // len(rank) * len(rank) + rank[firing % len(rank)], kind="stable")
    scan, truth, k = kept.scan, kept.truth, len(at)

    def joined(old: np.ndarray, new: np.ndarray) -> np.ndarray:
        return np.concatenate([old, new.astype(old.dtype)])[turn]

    return Sweep(
        scan=replace(
            scan,
            xyz_m=joined(scan.xyz_m, range_m[:, None] * table.direction[column, beam]),
            intensity=joined(scan.intensity, intensity),
            offset_ns=joined(scan.offset_ns, offset_ns),
            ring=joined(scan.ring, beam),
        ),
        truth=replace(
            truth,
            object_id=joined(truth.object_id, np.full(k, -1)),
            part_id=joined(truth.part_id, np.full(k, -1)),
            true_range_m=joined(truth.true_range_m, range_m),
            fire_ns=joined(truth.fire_ns, start_ns + offset_ns),
            incidence_rad=joined(truth.incidence_rad, np.full(k, np.pi / 2.0)),
        ),
    )
