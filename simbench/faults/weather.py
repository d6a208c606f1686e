"""lidar.fog_mor_m, lidar.rain_mmph: what hangs in the air weakens every echo and sends some of its own back.

Extinction alpha: fog ln(20) / MOR (WMO: 5 % of the light is left); rain 1.076 R^0.67 dB/km (ITU-R P.1814).
Power falls by exp(-2 alpha r); a point is lost with the chance that the sensor's own range law gives. A
firing meets the air itself with probability 1 - exp(-backscatter alpha 10 m), at depth -3 m ln(u) beyond the
minimum range, and
returns that if it is nearer than what it hit. Simplified: see the specs. Receipts: extinction by how
intensities fall with range; losses and new false points counted, against what is expected of these points.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float64

from scenarios.faults.lidar import Fog, Rain
from simbench.faults.compared import Compared, Points, compared, loss, mean_limit_percent
from simbench.faults.delivery import Delivery, Sweep
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.firings import dimmed, firing_of, firings, uniform, with_false_points
from simbench.faults.points_dimmed import still_seen
from simbench.faults.receipt import Receipt, judge, untouched

Air = Fog | Rain
DEPTH_M = 3.0  # mean depth of an echo of the air [judgement]
NEAR_ZONE_M = 10.0  # where it is met at all [judgement]
FAINTEST, BRIGHTEST = 0.01, 0.05  # its intensity, drawn evenly [judgement]
FOG = float(np.log(20.0))  # alpha times the optical range
EXTINCTION_SD_PER_KM = 2e-3
FEWEST = 100


def extinction_per_m(spec: Air) -> float:
    """alpha, in 1/m."""
    if isinstance(spec, Fog):
        return FOG / spec.mor_m if spec.mor_m > 0.0 else 0.0
    return float(1.076 * spec.rate_mmph**0.67 / (10.0 * np.log10(np.e)) * 1e-3)


def weather(spec: Air, delivery: Delivery, site: Site) -> Acted:
    """Attenuation first, then the air's own echoes before what is left."""
    alpha, sensor = extinction_per_m(spec), site.rig.lidar
    met = 1.0 - np.exp(-spec.backscatter * alpha * NEAR_ZONE_M)
    lost = points = false = 0

    def change(sweep: Sweep) -> Sweep:
        nonlocal lost, points, false
        seq, truth = sweep.scan.seq, sweep.truth
        passing = np.exp(-2.0 * alpha * truth.true_range_m)
        left = dimmed(sweep, sensor, passing, uniform(site, spec.name, seq))
        depth_m = -DEPTH_M * np.log1p(-uniform(site, spec.name, seq, "depth"))
        echo_m = sensor.min_range_m + depth_m
        # The air is before what was hit, seen through the air or not.
        hit_m = np.full(firings(sensor), np.inf)
        hit_m[firing_of(sweep, sensor)] = truth.true_range_m
        at = np.flatnonzero((uniform(site, spec.name, seq, "met") < met) & (echo_m < hit_m))
        bright = FAINTEST + (BRIGHTEST - FAINTEST) * uniform(site, spec.name, seq, "intensity")[at]
        result = with_false_points(left, sensor, at, echo_m[at], bright.astype(np.float32))
        real = truth.part_id >= 0
        points += int(np.count_nonzero(real))
        lost += int(np.count_nonzero(real) - np.count_nonzero(result.truth.part_id >= 0))
        false += len(at)
        return result if alpha > 0.0 else sweep

    after = delivery.with_sweeps(change)
    all_firings = firings(sensor) * len(delivery.sweeps)
    return Acted(
        delivery=after,
        realised={
            "extinction": 1e3 * alpha,
            "lost": 100.0 * lost / max(points, 1),
            "false": 100.0 * false / max(all_firings, 1),
        },
    )


def weather_receipts(
    spec: Air, step: Step, site: Site, asked_per_km: Callable[[Any], float]
) -> tuple[Receipt, ...]:
    """asked_per_km: the extinction that the spec means, worked out by another formula."""
    both, sensor = compared(step), site.rig.lidar
    before, alpha = both.before, 1e-3 * asked_per_km(spec)
    real = ~before.false
    found, n = _extinction_per_km(both)
    depth = 1.0 - np.exp(-np.maximum(before.true_range_m - sensor.min_range_m, 0.0) / DEPTH_M)
    veiled = -np.expm1(-spec.backscatter * alpha * NEAR_ZONE_M)
    seen = still_seen(sensor, before, np.exp(-2.0 * alpha * before.true_range_m))
    chance = 1.0 - seen * (1.0 - veiled * depth)
    shots = sensor.columns * len(sensor.elevation_deg) * len(step.before.sweeps)
    nothing = np.ones(max(shots - len(depth), 0))
    in_air = veiled * np.concatenate([depth, nothing])
    new = ~both.known & both.after.false
    invented = int(np.count_nonzero(~both.known & ~both.after.false)) + _moved(both)
    note = "intensities after against before, over range"
    result = [
        judge(
            fault=spec.name, quantity="extinction", unit="1/km", requested=1e3 * alpha,
            realised=step.realised["extinction"], measured=found, systematic=5.0 * EXTINCTION_SD_PER_KM,
            allowed=10.0 * alpha, note=note if found is not None else f"only {n} points are left",
        ),
        loss(
            spec.name, "points lost", requested=100.0 * float(chance[real].mean()) if real.any() else 0.0,
            realised=step.realised["lost"], measured=both.percent_lost(real),
            points=int(np.count_nonzero(real)), allowed=mean_limit_percent(chance[real]),
            note="points counted before and after, against the range law",
        ),
        *untouched(
            fault=spec.name, quantity="points moved or invented", unit="points",
            found=[(float(invented), 0.1)], note="points that stay, before and after",
        ),
    ]  # fmt: skip
    if spec.backscatter > 0.0:
        result.append(
            judge(
                fault=spec.name, quantity="echoes of the air", unit="% of firings",
                requested=100.0 * float(in_air.mean()) if len(in_air) else 0.0,
                realised=step.realised["false"],
                measured=100.0 * int(np.count_nonzero(new)) / shots if shots else None,
                systematic=50.0 / max(shots, 1), allowed=mean_limit_percent(in_air),
                note="new points on no part of anything",
            )
        )  # fmt: skip
    return tuple(result)


def _fog_receipts(spec: Fog, step: Step, site: Site) -> tuple[Receipt, ...]:
    # Koschmieder: over one optical range, contrast falls to 2 %.
    return weather_receipts(spec, step, site, lambda s: -1000.0 * float(np.log(0.05)) / s.mor_m)


def _rain_receipts(spec: Rain, step: Step, site: Site) -> tuple[Receipt, ...]:
    def asked(s: Rain) -> float:
        return float(np.log(10.0 ** (0.1076 * s.rate_mmph**0.67)))

    return weather_receipts(spec, step, site, asked)


def _moved(both: Compared) -> int:
    was, now = both.before.xyz_m[both.stays], both.after.xyz_m[both.known]
    return int(np.count_nonzero((was != now).any(axis=1))) if len(was) == len(now) else len(was)


def _extinction_per_km(both: Compared) -> tuple[float | None, int]:
    """Least squares of the logarithm of the intensities' ratio over twice the true range."""
    was, now = _of(both.before, both.stays), _of(both.after, both.known)
    if len(was) != len(now):
        return float("nan"), len(was)
    lit = (was[:, 0] > 1e-3) & (now[:, 0] > 1e-6) & (was[:, 2] == 0.0)
    if np.count_nonzero(lit) < FEWEST:
        return None, int(np.count_nonzero(lit))
    fall: Float64[np.ndarray, " k"] = np.log(was[lit, 0] / now[lit, 0])
    path_m = 2.0 * was[lit, 1]
    return 1e3 * float(np.sum(fall * path_m) / np.sum(path_m**2)), len(fall)


def _of(points: Points, rows: np.ndarray) -> Float64[np.ndarray, "k 3"]:
    return np.stack([points.intensity[rows], points.true_range_m[rows], points.false[rows]], axis=1)


DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=Fog, act=weather, receipts=_fog_receipts),
    DeliveryFault(spec=Rain, act=weather, receipts=_rain_receipts),
)
