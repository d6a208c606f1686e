"""Points that the LiDAR loses: at random, the weak ones, whole beams.

lidar.dropout_percent, lidar.dropout_weak: one uniform number per firing, lost below the chance.
lidar.beam_loss: rings drawn once a run, or spread evenly. Receipts: points counted before and after, for weak
points those of little intensity apart from the others, for beams the rings that fall silent.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from jaxtyping import Bool, Int64

from scenarios.faults.lidar import BeamLoss, Dropout, WeakDropout
from scenarios.seeding import stream
from simbench.faults.chances import share_allowed
from simbench.faults.compared import (
    compared,
    loss,
    mean_limit_percent,
    points_as_before,
)
from simbench.faults.delivery import Delivery, Sweep
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.firings import each, firing_of, uniform
from simbench.faults.receipt import Receipt, judge

EXACT_PERCENT = 1e-3


def share_percent(lost: list[Bool[np.ndarray, " _"]]) -> float:
    """How many of all points, in per cent."""
    return 100.0 * float(np.mean(np.concatenate(lost))) if sum(map(len, lost)) else 0.0


# -- lidar.dropout_percent --------------------------------------------------------------------------------


def drop(spec: Dropout, delivery: Delivery, site: Site) -> Acted:
    """Every point is lost with the same chance."""
    drawn: list[Bool[np.ndarray, " _"]] = []

    def change(sweep: Sweep) -> Sweep:
        lost = (
            uniform(site, spec.name, sweep.scan.seq)[firing_of(sweep, site.rig.lidar)] < 0.01 * spec.percent
        )
        drawn.append(lost)
        return sweep.keep(~lost)

    after = each(delivery, change)
    return Acted(delivery=after, realised={"lost": share_percent(drawn) if drawn else spec.percent})


def drop_receipts(spec: Dropout, step: Step, site: Site) -> tuple[Receipt, ...]:
    """The share of points that are gone, of all points before."""
    both = compared(step)
    n = len(both.before.key)
    return (
        loss(
            spec.name,
            "points lost",
            requested=spec.percent,
            realised=step.realised["lost"],
            measured=both.percent_lost(),
            points=n,
            allowed=100.0 * share_allowed(0.01 * spec.percent, n),
        ),
        *points_as_before(spec.name, both),
    )


# -- lidar.dropout_weak -----------------------------------------------------------------------------------


def drop_weak(spec: WeakDropout, delivery: Delivery, site: Site) -> Acted:
    """The weaker a point, the sooner it is lost."""
    drawn: dict[str, list[Bool[np.ndarray, " _"]]] = {"weak": [], "strong": []}

    def change(sweep: Sweep) -> Sweep:
        above = (sweep.scan.intensity.astype(np.float64) - spec.middle) / spec.width
        chance = 0.01 * spec.percent / (1.0 + np.exp(np.minimum(above, 500.0)))
        lost = uniform(site, spec.name, sweep.scan.seq)[firing_of(sweep, site.rig.lidar)] < chance
        weak = above < 0.0
        drawn["weak"].append(lost[weak])
        drawn["strong"].append(lost[~weak])
        return sweep.keep(~lost)

    after = each(delivery, change)
    return Acted(delivery=after, realised={name: share_percent(lost) for name, lost in drawn.items()})


def drop_weak_receipts(spec: WeakDropout, step: Step, site: Site) -> tuple[Receipt, ...]:
    """The share of points that are gone, below and above the middle intensity."""
    both = compared(step)
    intensity = both.before.intensity
    chance = 0.005 * spec.percent * (1.0 - np.tanh(0.5 * (intensity - spec.middle) / spec.width))
    result = []
    for name, among in (("weak", intensity < spec.middle), ("strong", intensity >= spec.middle)):
        n = int(np.count_nonzero(among))
        result.append(
            loss(
                spec.name,
                f"{name} points lost",
                requested=100.0 * float(chance[among].mean()) if n else 0.0,
                realised=step.realised[name],
                measured=both.percent_lost(among),
                points=n,
                allowed=mean_limit_percent(chance[among]),
            )
        )
    return (*result, *points_as_before(spec.name, both))


# -- lidar.beam_loss --------------------------------------------------------------------------------------


def lost_rings(spec: BeamLoss, rings: int, seed: int) -> Int64[np.ndarray, " r"]:
    """Which of the rings 0 .. rings - 1 are lost, sorted."""
    kept = max(1, rings - round(0.01 * spec.percent * rings))
    if spec.pattern == "even":
        keep = np.floor((np.arange(kept) + 0.5) * rings / kept).astype(np.int64)
    else:
        keep = stream(seed, "fault", BeamLoss.name).permutation(rings)[:kept]
    lost: np.ndarray = np.setdiff1d(np.arange(rings), keep)
    return lost


def lose_beams(spec: BeamLoss, delivery: Delivery, site: Site) -> Acted:
    """The same rings are silent in every sweep."""
    rings = len(site.rig.lidar.elevation_deg)
    lost = lost_rings(spec, rings, site.seed)
    after = each(delivery, lambda sweep: sweep.keep(~np.isin(sweep.scan.ring, lost)))
    heard = {int(ring) for sweep in delivery.sweeps for ring in np.unique(sweep.scan.ring)}
    return Acted(
        delivery=after,
        realised={"rings": 100.0 * len(lost) / rings, "heard": float(len(heard & {*lost.tolist()}))},
    )


def lose_beams_receipts(spec: BeamLoss, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Rings that returned something before and nothing after: how many, and what that says of all rings
    (those that only see the sky are silent anyway, which makes the share of all uncertain).
    """
    both = compared(step)
    rings = len(site.rig.lidar.elevation_deg)
    heard = np.unique(both.before.ring)
    silent, n = len(heard) - len(np.unique(both.after.ring)), len(heard)
    share = step.realised["rings"] / 100.0
    unheard = sqrt(share * (1.0 - share) / n * (rings - n) / max(rings - 1, 1)) if n else 1.0
    note = f"rings that fall silent, of {n} of {rings} that return anything"
    return (
        judge(
            fault=spec.name, quantity="rings", unit="%", requested=spec.percent,
            realised=step.realised["rings"], measured=100.0 * silent / n if n else None,
            systematic=5.0 * (EXACT_PERCENT + 100.0 * unheard), allowed=100.0 / rings, note=note,
        ),
        judge(
            fault=spec.name, quantity="rings that fall silent", unit="rings",
            requested=step.realised["heard"], realised=step.realised["heard"],
            measured=float(silent) if n else None, systematic=0.5, allowed=0.0, note=note,
        ),
        *points_as_before(spec.name, both),
    )  # fmt: skip


DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=WeakDropout, act=drop_weak, receipts=drop_weak_receipts),
    DeliveryFault(spec=Dropout, act=drop, receipts=drop_receipts),
    DeliveryFault(spec=BeamLoss, act=lose_beams, receipts=lose_beams_receipts),
)
