"""What the receipts of LiDAR faults share: points before against points after, told apart by firing time.

Nothing here knows how an injector works or what it drew. A spinning LiDAR returns one point a firing, so the
true firing time and the ring name a point.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from jaxtyping import Bool, Float64, Int64

from simbench.faults.delivery import Sweep
from simbench.faults.fault import Step
from simbench.faults.receipt import Receipt, judge, untouched

BEAMS = 1024  # more than any LiDAR has
SPREAD = np.int64(0x1E3779B97F4A7C15)


@dataclass(frozen=True, kw_only=True, eq=False)
class Compared:
    """All points of a step. before, after: every sweep's points in one row each, `stays` which of before are
    in after, `known` which of after were in before (both in the same order).
    """

    before: Points
    after: Points
    stays: Bool[np.ndarray, " n"]
    known: Bool[np.ndarray, " m"]

    @property
    def lost(self) -> Bool[np.ndarray, " n"]:
        return np.asarray(~self.stays)

    def percent_lost(self, among: Bool[np.ndarray, " n"] | None = None) -> float | None:
        """Of the points before, or of some of them; None where there are none."""
        lost = self.lost if among is None else self.lost[among]
        return 100.0 * float(np.mean(lost)) if len(lost) else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """Points of all sweeps. false: on no part of anything."""

    key: Int64[np.ndarray, " n"]
    xyz_m: Float64[np.ndarray, "n 3"]
    intensity: Float64[np.ndarray, " n"]
    ring: Int64[np.ndarray, " n"]
    true_range_m: Float64[np.ndarray, " n"]
    false: Bool[np.ndarray, " n"]

    @property
    def range_m(self) -> Float64[np.ndarray, " n"]:
        return np.asarray(np.linalg.norm(self.xyz_m, axis=1))


def compared(step: Step) -> Compared:
    """The points before and after a step. A point that turned from a real one into a false one, or back, is
    another point."""
    before, after = _points(step.before.sweeps), _points(step.after.sweeps)
    return Compared(
        before=before,
        after=after,
        stays=np.isin(before.key, after.key),
        known=np.isin(after.key, before.key),
    )


def _points(sweeps: tuple[Sweep, ...]) -> Points:
    def joined(name: str, of: str) -> np.ndarray:
        return np.concatenate([np.asarray(getattr(getattr(s, of), name)) for s in sweeps] or [np.zeros(0)])

    false = (joined("part_id", "truth") < 0) & (joined("object_id", "truth") < 0)
    ring = joined("ring", "scan").astype(np.int64)
    true_range_m = joined("true_range_m", "truth")
    # Two false points of one firing are the same one only if they stand at the same place.
    place = np.where(false, 1.0 + np.round(true_range_m * 1e4), 0.0).astype(np.int64)
    key = joined("fire_ns", "truth").astype(np.int64) * BEAMS + ring
    return Points(
        key=key ^ place * SPREAD,  # wraps round: a hash
        xyz_m=joined("xyz_m", "scan").astype(np.float64).reshape(-1, 3),
        intensity=joined("intensity", "scan").astype(np.float64),
        ring=ring,
        true_range_m=true_range_m,
        false=false,
    )


def mean_limit_percent(chance: Float64[np.ndarray, " n"]) -> float:
    """The same for unequal chances: 5 SD and two draws."""
    n = max(len(chance), 1)
    return 100.0 * (5.0 * sqrt(float(np.sum(chance * (1.0 - chance)))) + 2.0) / n


def loss(
    fault: str,
    quantity: str,
    *,
    requested: float,
    realised: float,
    measured: float | None,
    points: int,
    allowed: float,
    note: str = "points counted before and after",
) -> Receipt:
    """Of a share of lost points in per cent; the count is exact."""
    return judge(
        fault=fault, quantity=quantity, unit="%", requested=requested, realised=realised, measured=measured,
        systematic=50.0 / max(points, 1), allowed=allowed,
        note=note if points else "no point to lose was measured",
    )  # fmt: skip


def points_as_before(fault: str, both: Compared, *, places: bool = True) -> tuple[Receipt, ...]:
    """That a fault which only loses points leaves the others (and their places) alone and invents none."""
    changed = int(np.count_nonzero(~both.known))
    if places:
        was, now = both.before.xyz_m[both.stays], both.after.xyz_m[both.known]
        changed += int(np.count_nonzero((was != now).any(axis=1))) if len(was) == len(now) else len(was)
    return untouched(
        fault=fault, quantity="points moved or invented", unit="points", found=[(float(changed), 0.1)],
        note="points that stay, before and after",
    )  # fmt: skip
