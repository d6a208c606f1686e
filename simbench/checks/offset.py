"""Cameras that expose later by dt and earlier by dt move the result by opposite amounts.

The drives are bare (the ego, one rider, flat ground), velocities are constant, boxes exact. An offset of dt
moves every box by dt times its velocity in the picture, in first order the opposite of what -dt does, and the
scans are the same to the last byte. If the result is moved by what moved the boxes, the mean longitudinal
shifts s(+dt) and s(-dt) against the run without offset are opposite. A shift to the same side both times is
no trace of motion: the box took in, or lost, points of something else. That is the claim; a pipeline that
maps by box edges alone may break it wherever something else stands or lies beside the object.

The even part e = (s(+dt) + s(-dt)) / 2 is worked out by seed, over the scans and cameras that all three runs
have. `does not hold` where the 99 % interval of its mean over seeds keeps farther from 0 than rounding.
dt = 30 ms: 0.16 m at 5.2 m/s, and below a period by far, so that pairing changes for no one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from simbench.checks.compare import ROUNDING_M
from simbench.checks.drives import COLUMNS, recorded, told
from simbench.checks.finding import NOTHING, Finding, ask, said_nothing
from simbench.checks.paired import interval, too_few
from simbench.drive import Driven
from simbench.plugins import Factory
from simbench.recording import Recording

OFFSET_MS = 30.0


@dataclass(frozen=True, kw_only=True)
class Shifts:
    """Mean longitudinal shifts [m] of one seed, cameras late and early by the same time."""

    seed: int
    late_m: float
    early_m: float

    @property
    def even_m(self) -> float:
        """What both signs have in common."""
        return 0.5 * (self.late_m + self.early_m)


def find(factory: Factory, seeds: Sequence[int]) -> Finding:
    """The answers to every seed's drive without offset, late and early."""
    found, anything = list[Shifts](), False
    for seed in seeds:
        runs = [ask(factory, told(bare(seed, ms))) for ms in (0.0, OFFSET_MS, -OFFSET_MS)]
        anything |= not said_nothing(runs)
        if (shifts := shifts_of(seed, *runs)) is not None:
            found.append(shifts)
    return judge(found, len(seeds)) if anything else NOTHING


def bare(seed: int, offset_ms: float) -> Recording:
    """A seed's bare drive with exact boxes, the cameras late by `offset_ms`."""
    return recorded(seed, columns=2 * COLUMNS, background=False, boxes="labels", offset_ms=offset_ms)


def shifts_of(seed: int, plain: Driven, late: Driven, early: Driven) -> Shifts | None:
    """Means over scans and cameras that all three runs have; None where there are none."""
    at, after, before = (_longitudinal_m(driven) for driven in (plain, late, early))
    common = [key for key in at if key in after and key in before]
    if not common:
        return None
    return Shifts(
        seed=seed,
        late_m=sum(after[key] - at[key] for key in common) / len(common),
        early_m=sum(before[key] - at[key] for key in common) / len(common),
    )


def _longitudinal_m(driven: Driven) -> dict[tuple[int, str, int], float]:
    return {
        (output.scan_seq, thing.sensor, thing.track_id): float(thing.position_ego_m[0])
        for output in driven.outputs
        for thing in output.objects
    }


def judge(found: Sequence[Shifts], asked: int) -> Finding:
    """What the seeds say."""
    even = [shifts.even_m for shifts in found]
    if few := too_few(even, asked, "an object in all three runs"):
        return few
    low, high = interval(even)
    late = sum(shifts.late_m for shifts in found) / len(found)
    early = sum(shifts.early_m for shifts in found) / len(found)
    worst = max(found, key=lambda shifts: abs(shifts.even_m))
    both = 0.5 * (late + early)
    why = (
        f"{1e3 * late:+.1f} mm late and {1e3 * early:+.1f} mm early; in common {1e3 * both:+.1f} "
        f"[{1e3 * low:+.1f}, {1e3 * high:+.1f}] mm over {len(found)} seeds, "
        f"the most {1e3 * worst.even_m:+.1f} (seed {worst.seed})"
    )
    opposite = low <= ROUNDING_M and high >= -ROUNDING_M
    return Finding(verdict="holds" if opposite else "does not hold", why=why)
