"""A spinning LiDAR whose every firing has its own time, with complete truth per point.

`beams.py`: where each beam looks and when it fires. `shot.py`: what it meets, with everything at its place
of that instant. `reflectance.py`: how much of the light a surface sends back. `footprint.py`: what a beam
with width returns at edges. `returns.py`: what the receiver makes of it. Each effect is a number of the
sensor file and can be switched off by name (`LidarSensor.off`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import get_args

import numpy as np

from fusion.messages import LidarScan
from scenarios.scenario import LidarEffect, LidarSensor
from simbench.motion import Motion
from simbench.sensors import footprint, returns
from simbench.sensors.beams import BeamTable, beam_table, passing_offset_ns, period_ns
from simbench.sensors.returns import Echoes
from simbench.sensors.shot import Course, Shot, aim, courses
from simbench.truth import ScanTruth
from simbench.world import GROUND

__all__ = [
    "EFFECTS",
    "BeamTable",
    "beam_table",
    "passing_offset_ns",
    "period_ns",
    "sweep",
    "sweeps",
    "without",
]

EFFECTS: tuple[LidarEffect, ...] = get_args(LidarEffect)
AT_ONCE = 16  # sweeps whose poses are found together
LIMITS: tuple[LidarEffect, ...] = ("range_law",)  # what an ideal sensor keeps beside its minimum range


def without(sensor: LidarSensor, *effects: LidarEffect) -> LidarSensor:
    """The same sensor with these effects off too."""
    return sensor.model_copy(update={"off": tuple(e for e in EFFECTS if e in (*sensor.off, *effects))})


def sweep(
    name: str,
    sensor: LidarSensor,
    motion: Motion,
    start_ns: int,
    seq: int,
    rng: np.random.Generator | None,
    course: Course | None = None,
) -> tuple[LidarScan, ScanTruth]:
    """One sweep that starts at true time `start_ns`. course: see `aim`.

    Without `rng` the sensor is ideal: exact ranges along exact beams without width, nothing lost and nothing
    false; how far it sees is no error but a limit, so it keeps that (sharp at R(rho)) and its minimum range.

    A point's truth is that of the surface that contributes most to it: where surfaces mix in a footprint,
    `true_range_m` is the distance of that surface and differs from the measured range also without noise.

    The number of draws does not depend on the scene, so one change never moves another's noise.
    """
    if rng is None:
        sensor = without(sensor, *(effect for effect in EFFECTS if effect not in LIMITS))
    draws = returns.middle(sensor) if rng is None else returns.draw(sensor, rng)
    table = beam_table(sensor)
    angle_noise_deg = 0.0 if "angle_noise" in sensor.off else sensor.angle_noise_deg
    sd_rad = float(np.deg2rad(angle_noise_deg))
    shot = aim(name, motion, table, start_ns, draws.azimuth_noise, draws.elevation_noise, sd_rad, course)
    points = returns.deliver(sensor, table, _echoes(sensor, shot), draws)

    scan = LidarScan(
        sensor=name,
        seq=seq,
        stamp_ns=start_ns,
        arrival_ns=start_ns + table.last_offset_ns + round(sensor.latency_ms * 1e6),
        xyz_m=points.xyz_m,
        intensity=points.intensity,
        offset_ns=points.offset_ns.astype(np.int32),
        ring=points.beam,
    )
    truth = ScanTruth(
        sensor=name,
        seq=seq,
        object_id=np.where(points.part >= 0, motion.world.geom_object[points.part], GROUND).astype(np.int32),
        part_id=points.part,
        true_range_m=points.true_range_m,
        fire_ns=start_ns + points.offset_ns,
        incidence_rad=points.incidence_rad,
    )
    return scan, truth


def sweeps(
    name: str,
    sensor: LidarSensor,
    motion: Motion,
    count: int,
    rng: Callable[[int], np.random.Generator | None],
) -> Iterator[tuple[LidarScan, ScanTruth]]:
    """The first `count` sweeps since true time 0, sweep i with rng(i)."""
    table, step_ns = beam_table(sensor), period_ns(sensor)
    for first in range(0, count, AT_ONCE):
        seqs = np.arange(first, min(first + AT_ONCE, count))
        ahead = courses(name, motion, table, seqs * step_ns)
        for seq, course in zip(seqs.tolist(), ahead, strict=True):
            yield sweep(name, sensor, motion, seq * step_ns, seq, rng(seq), course)


def _echoes(sensor: LidarSensor, shot: Shot) -> Echoes:
    """What comes back along each beam."""
    hits = shot.cast()
    echoes = returns.pure(hits, shot.world.reflectivity, shot.world.roughness_gain)
    if "divergence" in sensor.off or max(sensor.divergence_deg) == 0.0:
        return echoes
    sd_rad = footprint.beam_sd_rad(sensor)
    edges = footprint.edge_beams(shot, hits, sd_rad)
    beside = shot.cast_beside(edges, footprint.SAMPLES * sd_rad)
    return footprint.mixed(sensor, shot.world, edges, beside, echoes)
