"""lidar.ghosts_percent: points where nothing is, from the pulses of other LiDARs.

Firings drawn with probability percent / 100 return a range drawn evenly, in place of what they had returned.
They are nobody's points (see `firings.with_false_points`). Receipt: false points that were not there before.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64

from scenarios.faults.lidar import Ghosts
from simbench.faults.chances import share_allowed
from simbench.faults.compared import BEAMS, compared
from simbench.faults.delivery import Delivery, Sweep
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.firings import firings, uniform, with_false_points
from simbench.faults.receipt import Receipt, judge, untouched

STRONGEST = 0.3  # intensity of a ghost: evenly from 0 to this [judgement]


def haunt(spec: Ghosts, delivery: Delivery, site: Site) -> Acted:
    """Also where the beam had returned nothing."""
    sensor, ghosts = site.rig.lidar, 0

    def change(sweep: Sweep) -> Sweep:
        nonlocal ghosts
        seq = sweep.scan.seq
        at = np.flatnonzero(uniform(site, spec.name, seq) < 0.01 * spec.percent)
        ghosts += len(at)
        if not len(at):
            return sweep
        span_m = max(spec.max_range_m - sensor.min_range_m, 0.0)
        range_m = sensor.min_range_m + span_m * uniform(site, spec.name, seq, "range")[at]
        strength = (STRONGEST * uniform(site, spec.name, seq, "intensity")[at]).astype(np.float32)
        return with_false_points(sweep, sensor, at, range_m, strength)

    after = delivery.with_sweeps(change)
    all_firings = firings(sensor) * len(delivery.sweeps)
    return Acted(delivery=after, realised={"ghosts": 100.0 * ghosts / max(all_firings, 1)})


def haunt_receipts(spec: Ghosts, step: Step, site: Site) -> tuple[Receipt, ...]:
    """New points of nobody, of all firings: how many; how their mean range lies; that no real point is new,
    and that none is lost but where a ghost stands.
    """
    both, sensor = compared(step), site.rig.lidar
    n = sensor.columns * len(sensor.elevation_deg) * len(step.before.sweeps)
    new = ~both.known & both.after.false
    count = int(np.count_nonzero(new))
    invented = int(np.count_nonzero(~both.known & ~both.after.false))
    before, after = _fired(step.before.sweeps), _fired(step.after.sweeps)
    gone = int(np.count_nonzero(~np.isin(before, after)))
    middle_m = 0.5 * (sensor.min_range_m + spec.max_range_m)
    spread_m = (spec.max_range_m - sensor.min_range_m) / np.sqrt(12.0 * max(count, 1))
    return (
        judge(
            fault=spec.name, quantity="false points", unit="% of firings", requested=spec.percent,
            realised=step.realised["ghosts"], measured=100.0 * count / n if n else None,
            systematic=50.0 / max(n, 1), allowed=100.0 * share_allowed(0.01 * spec.percent, n),
            note="new points on no part of anything",
        ),
        judge(
            fault=spec.name, quantity="mean range of false points", unit="m", requested=middle_m,
            realised=middle_m, measured=float(both.after.range_m[new].mean()) if count else None,
            estimator_sd=spread_m, allowed=0.0, note="ranges drawn evenly",
        ),
        *untouched(
            fault=spec.name, quantity="other points lost or invented", unit="points",
            found=[(float(invented + gone), 0.1)], note="points before and after",
        ),
    )  # fmt: skip


def _fired(sweeps: tuple[Sweep, ...]) -> Int64[np.ndarray, " n"]:
    """What names a firing that returned something."""
    found = [s.truth.fire_ns * BEAMS + s.scan.ring for s in sweeps]
    return np.concatenate([np.zeros(0, dtype=np.int64), *found])


DELIVERED: tuple[DeliveryFault, ...] = (DeliveryFault(spec=Ghosts, act=haunt, receipts=haunt_receipts),)
