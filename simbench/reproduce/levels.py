"""The causes that the paper names, or that its rigs have, each with the levels that physics and field reports
allow: the prior of the fit, and the bound of everything else.

Every prior is uniform between 0 and the bound (a frame late: yes with chance 1/4), because nothing is known
but what is possible. Bounds: a car's body pitches by 0.28 deg RMS on an ISO 8608 class C road; brackets in
use bend by 0.2 deg RMS; the static board of Table I is still mapped after 1 deg of turn; a wide lens left as
it is puts the corner 40 px off; boards that a person holds near the rig calibrate a zone of 2.5 to 3.5 m; a
tracker smooths over a frame; hosts stamp up to 150 ms late in field reports, and a hardware trigger with a
sweep that is passing hides up to 50 ms. They are the bench's numbers, argued in `docs/errors.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

Group = Literal["clocks", "body", "bracket", "calibration", "boxes"]
"""What one would mend at once: synchronisation, how smoothly one drives, mounts, calibration, the tracker."""
GROUPS: tuple[Group, ...] = ("clocks", "body", "bracket", "calibration", "boxes")
NONE_FAULTS = ("none",)
LATE_CHANCE = 0.25


@dataclass(frozen=True, kw_only=True)
class Level:
    """One cause. fault: as `--faults` takes it, `{}` where the level stands. unit: of the level. bound: the
    highest that is physical. chance: None: any level up to the bound; else 0, or the bound with this chance.
    """

    name: str
    group: Group
    fault: str
    unit: str
    bound: float
    chance: float | None = None


def _levels(offset_ms: float, shake_deg: float, *turning: Level) -> tuple[Level, ...]:
    return (
        Level(
            name="trigger offset", group="clocks", fault="timing.trigger_offset_ms={}", unit="ms",
            bound=offset_ms,
        ),
        *turning,
        Level(
            name="one frame late", group="clocks", fault="timing.stale_frames={}", unit="frame",
            bound=1.0, chance=LATE_CHANCE,
        ),
        Level(
            name="body shake", group="body", fault="motion.vibration_deg={}", unit="deg RMS", bound=shake_deg,
        ),
        Level(
            name="bracket flex", group="bracket", fault="motion.flex_deg={}", unit="deg RMS", bound=0.2,
        ),
        Level(
            name="extrinsic residual", group="calibration", fault="calibration.rotation_deg={}", unit="deg",
            bound=1.0,
        ),
        Level(
            name="undistorted lens", group="calibration", fault="calibration.undistorted_px={}",
            unit="px at the corner", bound=40.0,
        ),
        Level(
            name="clicks in a near zone", group="calibration",
            fault="calibration.click_noise_px={{noise_px: {}, near_m: 2.5, far_m: 3.5}}", unit="px",
            bound=3.0,
        ),
        Level(name="box lag", group="boxes", fault="detector.lag_frames={}", unit="frame", bound=1.0),
    )  # fmt: skip


_SPIN = Level(
    name="spin phase", group="clocks", fault="timing.trigger_angle_deg={}", unit="deg of the turn",
    bound=179.0,
)  # fmt: skip
LEVELS: dict[str, tuple[Level, ...]] = {
    "car": _levels(50.0, 0.3, _SPIN),
    "wearable": _levels(150.0, 3.0),
}
"""By rig. The wearable's cameras run freely: no spin phase; a wearer sways by 1 to 3 deg."""


def prior(levels: Sequence[Level], unit: Float64[np.ndarray, "n d"]) -> Float64[np.ndarray, "n d"]:
    """Levels of rows of numbers in 0..1: their prior, where those are uniform."""
    columns = [
        level.bound * (unit[:, i] if level.chance is None else unit[:, i] >= 1.0 - level.chance)
        for i, level in enumerate(levels)
    ]
    return np.column_stack(columns).astype(np.float64)


def faults_at(levels: Sequence[Level], values: Sequence[float]) -> tuple[str, ...]:
    """What `--faults` is given for these levels and no other error; a cause at 0 is not mentioned."""
    return NONE_FAULTS + tuple(
        level.fault.format(f"{value:.6g}")
        for level, value in zip(levels, values, strict=True)
        if value != 0.0
    )


def at_bounds(levels: Sequence[Level], groups: Sequence[str] = GROUPS) -> tuple[float, ...]:
    """Every cause of these groups at its bound, the others at 0."""
    return tuple(level.bound if level.group in groups else 0.0 for level in levels)
