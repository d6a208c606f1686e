"""Points whose light is weakened on its way: by dirt on the window, by a laser that grew weak.

lidar.dirt_sector, lidar.reduced_range: only a share of the power comes back; a point is lost with the chance
that the sensor's own range law gives (`firings.detection_ratio`), and what stays is dimmer by that share.
Receipts: intensities after against before, and counted losses against what the range law says.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float64

from scenarios.faults.lidar import DirtSector, ReducedRange
from scenarios.scenario import LidarSensor
from simbench.faults.compared import (
    Compared,
    Points,
    compared,
    loss,
    mean_limit_percent,
    points_as_before,
)
from simbench.faults.delivery import Delivery, Sweep
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.firings import dimmed, each, uniform
from simbench.faults.receipt import Receipt, judge, untouched

DIM_SD_PERCENT = 1e-3  # of a median ratio of intensities in single precision
FEWEST = 20
SOFTNESS = 0.04  # the sensor's soft edge, as documented in `returns.py`


def _dim(
    fault: str, delivery: Delivery, site: Site, passing: Callable[[Sweep], Float64[np.ndarray, " n"]]
) -> tuple[Delivery, dict[str, float]]:
    """Every sweep dimmed, and how many of all points (and of those that get less light) are lost."""
    counts = {"real": 0, "dim": 0, "lost": 0}

    def change(sweep: Sweep) -> Sweep:
        share = passing(sweep)
        left = dimmed(sweep, site.rig.lidar, share, uniform(site, fault, sweep.scan.seq))
        counts["real"] += int(np.count_nonzero(sweep.truth.part_id >= 0))
        counts["dim"] += int(np.count_nonzero((share < 1.0) & (sweep.truth.part_id >= 0)))
        counts["lost"] += len(sweep.scan.ring) - len(left.scan.ring)
        return left

    after = each(delivery, change)
    lost = 100.0 * counts["lost"]
    return after, {"of all": lost / max(counts["real"], 1), "of dimmed": lost / max(counts["dim"], 1)}


# -- lidar.dirt_sector ------------------------------------------------------------------------------------


def soil(spec: DirtSector, delivery: Delivery, site: Site) -> Acted:
    """Light passes the patch twice."""
    through = (1.0 - spec.opacity) ** 2

    def passing(sweep: Sweep) -> Float64[np.ndarray, " n"]:
        x, y, z = sweep.scan.xyz_m.astype(np.float64).T
        aside = (np.rad2deg(np.arctan2(y, x)) - spec.azimuth_deg + 180.0) % 360.0 - 180.0
        above = np.rad2deg(np.arctan2(z, np.hypot(x, y))) - spec.elevation_deg
        dirty = (np.abs(aside) < 0.5 * spec.width_deg) & (np.abs(above) < 0.5 * spec.height_deg)
        return np.where(dirty, through, 1.0)

    after, realised = _dim(spec.name, delivery, site, passing)
    return Acted(delivery=after, realised={**realised, "through": 100.0 * through})


def soil_receipts(spec: DirtSector, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Losses and dimming inside the patch, and none outside."""
    both = compared(step)
    points = both.before
    real = ~points.false
    inside = _in_patch(spec, points) & real
    through = (1.0 - spec.opacity) ** 2
    chance = np.where(inside, 1.0 - still_seen(site.rig.lidar, points, np.full(len(inside), through)), 0.0)
    result = [
        _counted(spec.name, "points lost", both, real, chance, step.realised["of all"]),
        _counted(spec.name, "points lost in the patch", both, inside, chance, step.realised["of dimmed"]),
    ]
    if spec.opacity < 1.0:
        result.append(_light(spec.name, "light through the patch", both, inside, 100.0 * through, step))
    outside = ~inside
    gone = float(np.count_nonzero(both.lost & outside))
    kept = _kept_ratio(both, outside)
    gone += float(np.count_nonzero(np.abs(kept - 1.0) > 1e-5))
    result += untouched(
        fault=spec.name, quantity="points lost or dimmed elsewhere", unit="points", found=[(gone, 0.1)],
        note="points before and after",
    )  # fmt: skip
    return (*result, *points_as_before(spec.name, both))


def _in_patch(spec: DirtSector, points: Points) -> Bool[np.ndarray, " n"]:
    """By the angle between headings, and by height over the planar range."""
    x, y, z = points.xyz_m.T
    middle = np.deg2rad(spec.azimuth_deg)
    ahead, left = x * np.cos(middle) + y * np.sin(middle), y * np.cos(middle) - x * np.sin(middle)
    elevation_deg = np.rad2deg(np.arcsin(z / points.range_m))
    near = np.abs(elevation_deg - spec.elevation_deg) < spec.height_deg / 2.0
    return np.asarray((np.abs(np.rad2deg(np.arctan2(left, ahead))) < spec.width_deg / 2.0) & near)


# -- lidar.reduced_range ----------------------------------------------------------------------------------


def shorten(spec: ReducedRange, delivery: Delivery, site: Site) -> Acted:
    """The power that takes the sensor's range to the share asked for, whatever is hit."""
    left = 1.0 - 0.01 * spec.lost_percent
    power = left ** (1.0 / _law(site.rig.lidar))
    after, realised = _dim(spec.name, delivery, site, lambda sweep: np.full(len(sweep.scan.ring), power))
    return Acted(delivery=after, realised={**realised, "range": spec.lost_percent})


def shorten_receipts(spec: ReducedRange, step: Step, site: Site) -> tuple[Receipt, ...]:
    """The range that the dimmer intensities amount to, and counted losses."""
    both = compared(step)
    real = ~both.before.false
    law = _law(site.rig.lidar)
    kept = _kept_ratio(both, real)
    enough = len(kept) >= FEWEST
    measured = 100.0 * (1.0 - float(np.median(kept)) ** law) if enough else None
    note = "intensities after against before" if enough else f"only {len(kept)} points"
    power = np.full(len(real), (1.0 - 0.01 * spec.lost_percent) ** (1.0 / law))
    chance = np.where(real, 1.0 - still_seen(site.rig.lidar, both.before, power), 0.0)
    return (
        judge(
            fault=spec.name, quantity="range lost", unit="%", requested=spec.lost_percent,
            realised=step.realised["range"], measured=measured, systematic=5.0 * DIM_SD_PERCENT,
            allowed=0.01 * spec.lost_percent, note=note,
        ),
        _counted(spec.name, "points lost", both, real, chance, step.realised["of all"]),
        *points_as_before(spec.name, both),
    )  # fmt: skip


# -- estimators -------------------------------------------------------------------------------------------


def _law(sensor: LidarSensor) -> float:
    """Range grows with reflectivity to this power: data sheets give ranges at 10 and 80 per cent."""
    return float(np.log(sensor.range_at_80_percent_m / sensor.range_at_10_percent_m) / np.log(0.8 / 0.1))


def still_seen(
    sensor: LidarSensor, points: Points, passing: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, " n"]:
    """Chance by the data sheet's two ranges and the sensor's soft edge, told by a point's own intensity."""

    def log_odds(bright: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        reach_m = sensor.range_at_10_percent_m * (np.maximum(bright, 1e-6) * 10.0) ** _law(sensor)
        return np.asarray((1.0 - points.true_range_m / reach_m) / SOFTNESS)

    was, now = log_odds(points.intensity), log_odds(points.intensity * passing)
    return np.asarray(np.minimum(np.exp(np.logaddexp(0.0, -was) - np.logaddexp(0.0, -now)), 1.0))


def _kept_ratio(both: Compared, among: Bool[np.ndarray, " n"]) -> Float64[np.ndarray, " k"]:
    """Intensity after over before of every point that stays, among some."""
    was, some = both.before.intensity[both.stays], among[both.stays]
    now = both.after.intensity[both.known]
    lit = some & (was > 0.0)
    return np.asarray(now[lit] / was[lit]) if len(was) == len(now) else np.full(1, np.nan)


def _light(
    fault: str, quantity: str, both: Compared, among: Bool[np.ndarray, " n"], requested: float, step: Step
) -> Receipt:
    kept = _kept_ratio(both, among)
    enough = len(kept) >= FEWEST
    return judge(
        fault=fault, quantity=quantity, unit="%", requested=requested, realised=step.realised["through"],
        measured=100.0 * float(np.median(kept)) if enough else None, systematic=5.0 * DIM_SD_PERCENT,
        allowed=0.01 * requested,
        note="intensities after against before" if enough else f"only {len(kept)} points are left there",
    )  # fmt: skip


def _counted(
    fault: str,
    quantity: str,
    both: Compared,
    among: Bool[np.ndarray, " n"],
    chance: Float64[np.ndarray, " n"],
    realised: float,
) -> Receipt:
    n = int(np.count_nonzero(among))
    return loss(
        fault, quantity, requested=100.0 * float(chance[among].mean()) if n else 0.0, realised=realised,
        measured=both.percent_lost(among), points=n, allowed=mean_limit_percent(chance[among]),
        note="points counted before and after, against the range law",
    )  # fmt: skip


DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=DirtSector, act=soil, receipts=soil_receipts),
    DeliveryFault(spec=ReducedRange, act=shorten, receipts=shorten_receipts),
)
