"""A spinning LiDAR whose every column fires at its own time, with complete truth per point.

Order of effects on a return: range law (a target of reflectivity rho is seen to R(rho)), range noise by
return strength, quantisation, minimum range (own-body returns happen and are dropped here, as the sensor
does), false positives on rays without a return.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64, Int64

from fusion.geometry import readonly
from fusion.messages import LidarScan
from scenarios.scenario import LidarSensor
from simbench.motion import Motion
from simbench.sensors import rays
from simbench.truth import ScanTruth
from simbench.world import GROUND

SOFT_EDGE = 0.04  # relative width of the logistic fall of detection probability at R(rho) [judgement]
MAX_FALSE_RANGE_M = 100.0


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamTable:
    """Directions of one sweep in the LiDAR frame, and when each column fires, in nanoseconds from the first.

    along_azimuth, along_elevation: the change of `direction` per radian of either angle.
    """

    direction: Float64[np.ndarray, "c b 3"]
    along_azimuth: Float64[np.ndarray, "c b 3"]
    along_elevation: Float64[np.ndarray, "c b 3"]
    fire_offset_ns: Int64[np.ndarray, " c"]

    def disturbed(self, angle_rad: Float64[np.ndarray, "2 c b"]) -> Float64[np.ndarray, "c b 3"]:
        """Directions [c b 3] off by small azimuth and elevation errors, to first order, of unit length."""
        moved = (
            self.direction
            + angle_rad[0][..., None] * self.along_azimuth
            + angle_rad[1][..., None] * self.along_elevation
        )
        return moved / np.sqrt(np.einsum("cbi,cbi->cb", moved, moved))[..., None]


def period_ns(sensor: LidarSensor) -> int:
    """Duration of one turn."""
    return round(1e9 / sensor.rate_hz)


@lru_cache(maxsize=8)
def beam_table(sensor: LidarSensor) -> BeamTable:
    """All nominal directions: column c looks at start -+ 360 c / columns degrees, each beam at its own
    offset."""
    turn = -1.0 if sensor.clockwise else 1.0
    column = np.arange(sensor.columns)
    encoder = np.deg2rad(sensor.start_azimuth_deg) + turn * 2.0 * np.pi * column / sensor.columns
    azimuth = encoder[:, None] + np.deg2rad(np.asarray(sensor.azimuth_offset_deg))[None, :]
    elevation = np.broadcast_to(np.deg2rad(np.asarray(sensor.elevation_deg))[None, :], azimuth.shape)
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    return BeamTable(
        direction=readonly(np.stack([ce * ca, ce * sa, se], axis=-1)),
        along_azimuth=readonly(np.stack([-ce * sa, ce * ca, np.zeros_like(ca)], axis=-1)),
        along_elevation=readonly(np.stack([-se * ca, -se * sa, ce], axis=-1)),
        fire_offset_ns=readonly((column * period_ns(sensor)) // sensor.columns),
    )


def passing_offset_ns(sensor: LidarSensor, azimuth_deg: float) -> int:
    """When, after the start of a sweep, the encoder passes an azimuth of the LiDAR frame."""
    turn = -1.0 if sensor.clockwise else 1.0
    share = (turn * (azimuth_deg - sensor.start_azimuth_deg) / 360.0) % 1.0
    return round(share * period_ns(sensor))


def max_range_m(sensor: LidarSensor, reflectivity: np.ndarray) -> np.ndarray:
    """R(rho): the power law through the data sheet's ranges at 10 % and 80 % reflectivity."""
    exponent = np.log(sensor.range_at_80_percent_m / sensor.range_at_10_percent_m) / np.log(8.0)
    reach_m: np.ndarray = sensor.range_at_10_percent_m * (np.maximum(reflectivity, 1e-6) / 0.1) ** exponent
    return reach_m


def range_noise_m(sensor: LidarSensor, strength: np.ndarray) -> np.ndarray:
    """1 SD by return strength (R(rho)/r)^2: high above 16, medium at 4, low at 1, log-interpolated
    [judgement]."""
    level = np.log(np.maximum(strength, 1e-6))
    noise = sensor.noise
    sd_m: np.ndarray = np.interp(level, np.log([1.0, 4.0, 16.0]), [noise.low_m, noise.medium_m, noise.high_m])
    return sd_m


def sweep(
    name: str,
    sensor: LidarSensor,
    motion: Motion,
    start_ns: int,
    seq: int,
    rng: np.random.Generator | None,
) -> tuple[LidarScan, ScanTruth]:
    """One sweep that starts at true time `start_ns`. Without `rng` the sensor is ideal: every hit returns,
    exactly.

    The number of draws does not depend on the scene, so one change never moves another's noise.
    """
    shape = (sensor.columns, len(sensor.elevation_deg))
    noise = rng.standard_normal((3, *shape), dtype=np.float32) if rng is not None else None
    chance = rng.random((3, *shape), dtype=np.float32) if rng is not None else None
    table = beam_table(sensor)
    direction = table.direction
    if noise is not None and sensor.angle_noise_deg > 0.0:
        direction = table.disturbed(np.deg2rad(sensor.angle_noise_deg) * noise[1:])
    fire_ns = start_ns + table.fire_offset_ns
    rotation, origin = motion.sensor(name, fire_ns)
    body_rotation, body_position = motion.poses(fire_ns)
    hits = rays.cast(
        motion.world.geoms,
        body_rotation,
        body_position,
        np.arange(sensor.columns),
        origin,
        direction @ rotation.transpose(0, 2, 1),
    )

    world = motion.world
    hit = hits.geom >= 0
    range_m = hits.range_m
    geom = np.where(hit, hits.geom, 0)
    returned = np.where(hit, world.reflectivity[geom] * hits.cosine, 0.0)
    reach_m = max_range_m(sensor, returned)
    measured_m = np.where(hit, range_m, 0.0)
    false_return = np.zeros(shape, dtype=bool)
    if noise is not None and chance is not None:
        strength = (reach_m / np.maximum(measured_m, 0.1)) ** 2
        excess = np.clip((measured_m / reach_m - 1.0) / SOFT_EDGE, -60.0, 60.0)
        hit &= chance[0] < 1.0 / (1.0 + np.exp(excess))
        measured_m = measured_m + noise[0] * range_noise_m(sensor, strength)
        if sensor.resolution_m > 0.0:
            measured_m = np.round(measured_m / sensor.resolution_m) * sensor.resolution_m
        false_return = ~hit & (chance[1] < sensor.false_positive_rate)
        measured_m = np.where(false_return, chance[2] * MAX_FALSE_RANGE_M, measured_m)
    keep = (hit | false_return) & (measured_m >= sensor.min_range_m)

    column, beam = np.nonzero(keep)
    false_kept = false_return[keep]
    xyz = (measured_m[keep][:, None] * table.direction[keep]).astype(np.float32)
    brightness = np.clip(returned[keep], 0.0, 1.0)
    last_ns = int(fire_ns[-1])
    scan = LidarScan(
        sensor=name,
        seq=seq,
        stamp_ns=start_ns,
        arrival_ns=last_ns + round(sensor.latency_ms * 1e6),
        xyz_m=xyz,
        intensity=np.where(false_kept, 0.02, brightness).astype(np.float32),
        offset_ns=table.fire_offset_ns[column].astype(np.int32),
        ring=beam.astype(np.int16),
    )
    truth = ScanTruth(
        sensor=name,
        seq=seq,
        object_id=np.where(false_kept, GROUND, world.geom_object[geom[keep]]).astype(np.int32),
        part_id=np.where(false_kept, -1, hits.geom[keep]).astype(np.int32),
        true_range_m=np.where(false_kept, measured_m[keep], range_m[keep]),
        fire_ns=fire_ns[column],
        incidence_rad=np.arccos(np.clip(hits.cosine[keep], 0.0, 1.0)).astype(np.float32),
    )
    return scan, truth
