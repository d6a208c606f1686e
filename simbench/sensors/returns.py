"""From what a beam met to what the sensor reports: detection, range noise, steps, losses, false returns.

Order of effects on a return: dropout, range law (a target of reflectivity rho is seen to R(rho)), range noise
by strength, resolution, minimum range (returns from the sensor's own carrier happen and are dropped here, as
the sensor does). A beam without a return may have a false one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float32, Float64, Int16, Int32, Int64

from fusion.geometry import readonly
from scenarios.scenario import LidarSensor
from simbench.sensors import rays
from simbench.sensors.beams import BeamTable
from simbench.sensors.compiled import jit
from simbench.sensors.noise import standard_normal, standard_uniform

SOFT_EDGE = 0.04  # relative width of the logistic fall of detection probability at R(rho) [judgement]
MAX_FALSE_RANGE_M = 100.0
LOG_SURE = np.log(1.0 - 17.0 * SOFT_EDGE)  # nearer, the chance of a miss is under that of the smallest draw
BACK_STEPS = 256  # of reflectivity, in the table of ranges of sure returns
FALSE_INTENSITY = 0.02  # a false return is as weak as what the sensor just detects [judgement]


@dataclass(frozen=True, kw_only=True, eq=False)
class Echoes:
    """What comes back along each beam before the sensor's electronics, by group and place (`BeamTable`).

    range_m: where the return stands. geom (-1: nothing returns), true_range_m and cosine of incidence: of the
    surface that contributes most to it; its range is the return's unless surfaces mix. reflectivity: of the
    upright matt surface that would send back as much.
    """

    range_m: Float64[np.ndarray, "g k"]
    true_range_m: Float64[np.ndarray, "g k"]
    geom: Int32[np.ndarray, "g k"]
    cosine: Float32[np.ndarray, "g k"]
    reflectivity: Float64[np.ndarray, "g k"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Draws:
    """The random numbers of one sweep, as many whatever the scene: standard normal, and uniform in 0..1."""

    range_noise: Float32[np.ndarray, "c b"]
    azimuth_noise: Float32[np.ndarray, "c b"]
    elevation_noise: Float32[np.ndarray, "c b"]
    detection: Float32[np.ndarray, "c b"]
    false_return: Float32[np.ndarray, "c b"]
    false_range: Float32[np.ndarray, "c b"]
    dropout: Float32[np.ndarray, "c b"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """The points of one sweep in firing order. offset_ns: when each one's beam fired, from the sweep's start;
    beam: which of its column that was; part -1: a false return."""

    offset_ns: Int64[np.ndarray, " n"]
    beam: Int16[np.ndarray, " n"]
    xyz_m: Float32[np.ndarray, "n 3"]
    intensity: Float32[np.ndarray, " n"]
    part: Int32[np.ndarray, " n"]
    true_range_m: Float64[np.ndarray, " n"]
    incidence_rad: Float32[np.ndarray, " n"]


def draw(sensor: LidarSensor, rng: np.random.Generator) -> Draws:
    """Draw everything. Dropout has a stream of its own, so that it moves no other number."""
    shape = (sensor.columns, len(sensor.elevation_deg))
    normal = standard_normal(rng, (3, *shape))
    uniform = standard_uniform(rng, (3, *shape))
    dropout = uniform[0]  # looked at only where the rate is above 0
    if sensor.dropout_rate > 0.0:
        dropout = rng.spawn(1)[0].random(shape, dtype=np.float32)
    return Draws(
        range_noise=normal[0],
        azimuth_noise=normal[1],
        elevation_noise=normal[2],
        detection=uniform[0],
        false_return=uniform[1],
        false_range=uniform[2],
        dropout=dropout,
    )


def middle(sensor: LidarSensor) -> Draws:
    """No noise, and the middle of every chance: what is detected more often than not is detected."""
    shape = (sensor.columns, len(sensor.elevation_deg))
    zero, half = np.zeros(shape, dtype=np.float32), np.full(shape, 0.5, dtype=np.float32)
    return Draws(
        range_noise=zero,
        azimuth_noise=zero,
        elevation_noise=zero,
        detection=half,
        false_return=half,
        false_range=half,
        dropout=half,
    )


def max_range_m(sensor: LidarSensor, reflectivity: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """R(rho): the power law through the data sheet's ranges at 10 % and 80 % reflectivity."""
    reach_m: np.ndarray = sensor.range_at_10_percent_m * (np.maximum(reflectivity, 1e-6) / 0.1) ** _exponent(
        sensor
    )
    return reach_m


def range_noise_m(sensor: LidarSensor, strength: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """1 SD by return strength (R(rho)/r)^2: the sensor's three levels, interpolated over log strength."""
    level = np.log(np.maximum(strength, 1e-6))
    strengths, sd = _noise_levels(sensor)
    sd_m: np.ndarray = np.interp(level, strengths, sd)
    return sd_m


def pure(hits: rays.Hits, reflectivity: Float64[np.ndarray, " g"], gain: Float64[np.ndarray, " g"]) -> Echoes:
    """The echoes of beams without width; reflectivity and gain by geom (`reflectance.sent_back`)."""
    back = np.empty(hits.range_m.shape)
    _send_back(hits.geom, hits.cosine, reflectivity, gain, back)
    return Echoes(
        range_m=hits.range_m,
        true_range_m=hits.range_m,
        geom=hits.geom,
        cosine=hits.cosine,
        reflectivity=back,
    )


def deliver(
    sensor: LidarSensor,
    table: BeamTable,
    echoes: Echoes,
    draws: Draws,
) -> Points:
    """The points that the sensor reports along its nominal directions (LiDAR frame)."""
    n = table.fire_offset_ns.size
    offset, beam, part = np.empty(n, np.int64), np.empty(n, np.int16), np.empty(n, np.int32)
    xyz, intensity = np.empty((n, 3), np.float32), np.empty(n, np.float32)
    true_range, upright = np.empty(n), np.empty(n, np.float32)
    strengths, sd = _noise_levels(sensor)
    off = sensor.off
    count = _deliver(
        echoes.range_m, echoes.true_range_m, echoes.geom, echoes.cosine, echoes.reflectivity,
        table.direction, table.fire_offset_ns, table.order, table.instant, table.place, len(table.slots),
        draws.range_noise, draws.detection, draws.false_return, draws.false_range, draws.dropout,
        "range_law" not in off, np.log(sensor.range_at_10_percent_m), _exponent(sensor),
        strengths, _surely_strong_m(sensor), np.zeros(3) if "range_noise" in off else sd,
        0.0 if "resolution" in off else sensor.resolution_m, sensor.min_range_m,
        0.0 if "dropout" in off else sensor.dropout_rate,
        0.0 if "false_positives" in off else sensor.false_positive_rate,
        offset, beam, part, xyz, intensity, true_range, upright,
    )  # fmt: skip
    return Points(
        offset_ns=offset[:count],
        beam=beam[:count],
        xyz_m=xyz[:count],
        intensity=intensity[:count],
        part=part[:count],
        true_range_m=true_range[:count],
        incidence_rad=np.arccos(np.clip(upright[:count], 0.0, 1.0)),
    )


def _exponent(sensor: LidarSensor) -> float:
    return float(np.log(sensor.range_at_80_percent_m / sensor.range_at_10_percent_m) / np.log(8.0))


def _noise_levels(sensor: LidarSensor) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Log strengths (ascending) and 1 SD in metres at each."""
    noise = sensor.noise
    strengths = np.log([1.0, noise.medium_strength, noise.high_strength])
    return strengths, np.array([noise.low_m, noise.medium_m, noise.high_m])


@lru_cache(maxsize=8)
def _surely_strong_m(sensor: LidarSensor) -> Float64[np.ndarray, " n"]:
    """To what range a return of reflectivity i / BACK_STEPS or more is surely detected and of high strength:
    what does not lie near a limit needs no logarithm."""
    back = np.arange(2 * BACK_STEPS) / BACK_STEPS
    share = min(np.exp(LOG_SURE), 1.0 / np.sqrt(sensor.noise.high_strength))
    return readonly(share * (1.0 - 1e-5) * max_range_m(sensor, back))


@jit
def _send_back(geom, cosine, reflectivity, gain, out):  # type: ignore[no-untyped-def]
    for c in range(geom.shape[0]):
        for b in range(geom.shape[1]):
            g = geom[c, b]
            x = float(cosine[c, b])
            out[c, b] = reflectivity[g] * (x + gain[g] * (1.0 - x * x)) if g >= 0 else 0.0


@jit
def _deliver(  # type: ignore[no-untyped-def]
    range_m, true_m, geom, cosine, reflectivity, direction, fire_offset, order, instant, place, instants,
    range_noise, detection, false_return, false_range, dropout,
    law, log_reach_at_10, exponent, strengths, sure, sd, resolution, min_range, dropout_rate, false_rate,
    out_offset, out_beam, out_part, out_xyz, out_intensity, out_true, out_cosine,
):  # fmt: skip
    """One pass over the beams in firing order; the number of points."""
    n = 0
    for c in range(direction.shape[0]):
        for j in range(order.shape[0]):
            b = order[j]
            g, k = c * instants + instant[b], place[b]
            part, measured, bright, true = -1, 0.0, FALSE_INTENSITY, 0.0
            upright = np.float32(0.0)
            if geom[g, k] >= 0 and not dropout[c, b] < dropout_rate:
                distance, back = range_m[g, k], reflectivity[g, k]
                seen, spread = True, sd[2]
                if not max(distance, 0.1) < sure[min(int(back * BACK_STEPS), sure.shape[0] - 1)]:
                    log_distance = float(np.log(np.float32(max(distance, 0.1))))
                    log_reach = log_reach_at_10 + exponent * float(np.log(np.float32(max(back, 1e-6) * 10.0)))
                    if law:
                        log_share = log_distance - log_reach
                        if log_share > LOG_SURE:
                            excess = (np.exp(log_share) - 1.0) / SOFT_EDGE
                            seen = detection[c, b] < 1.0 / (1.0 + np.exp(min(excess, 60.0)))
                    if seen:
                        level = 2.0 * (log_reach - log_distance)
                        if level <= strengths[0]:
                            spread = sd[0]
                        elif level < strengths[1]:
                            share = (level - strengths[0]) / (strengths[1] - strengths[0])
                            spread = sd[0] + share * (sd[1] - sd[0])
                        elif level < strengths[2]:
                            share = (level - strengths[1]) / (strengths[2] - strengths[1])
                            spread = sd[1] + share * (sd[2] - sd[1])
                if seen:
                    measured = distance + range_noise[c, b] * spread
                    if resolution > 0.0:
                        measured = np.rint(measured / resolution) * resolution
                    part, true = geom[g, k], true_m[g, k]
                    bright = min(max(back, 0.0), 1.0)
                    upright = cosine[g, k]
            if part < 0:
                if not false_return[c, b] < false_rate:
                    continue
                measured = float(false_range[c, b]) * MAX_FALSE_RANGE_M
                true = measured
            if measured < min_range:
                continue
            out_offset[n], out_beam[n], out_part[n] = fire_offset[c, b], b, part
            for i in range(3):
                out_xyz[n, i] = measured * direction[c, b, i]
            out_intensity[n], out_true[n], out_cosine[n] = bright, true, upright
            n += 1
    return n
