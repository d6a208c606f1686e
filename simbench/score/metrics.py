"""The specification of every metric, in one place; the documentation is made from this table.

`docs/` and the report print names, units and sentences from `METRICS`; the order is the order of the rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

T1_POINTS = 5
T1_PERCENT = 20.0
GROSS_M = 1.0
HIT_MARGIN_M = 0.2
WINDOW_SHARE = 0.15
MIN_ERROR_FRAMES = 5
TTC_HORIZON_S = 10.0
MIN_CLOSING_MPS = 0.1

Better = Literal["higher", "lower"]


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One metric: `per` is what `n` counts; `definition` is one sentence."""

    name: str
    unit: str
    better: Better
    per: str
    definition: str


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value with its count and the SD (n - 1) of what was averaged; a null value has a `why`."""

    value: float | None
    n: int
    sd: float | None = None
    why: str | None = None


@dataclass(frozen=True, kw_only=True)
class Row:
    """One metric of one case."""

    metric: str
    value: float | None
    unit: str
    better: Better
    n: int
    sd: float | None
    why: str | None


def null(why: str, n: int = 0) -> Estimate:
    """No value, and why."""
    return Estimate(value=None, n=n, why=why)


def mean_of(
    values: Sequence[float] | np.ndarray, *, of: str, at_least: int = 1, spread: bool = True
) -> Estimate:
    """Mean and SD of values; null with a reason where there are fewer than `at_least` of `of`."""
    array = np.asarray(values, dtype=np.float64)
    n = len(array)
    if n < at_least:
        return null(f"no {of}" if n == 0 else f"{n} {of}, at least {at_least} are needed", n)
    sd = float(array.std(ddof=1)) if spread and n > 1 else None
    return Estimate(value=float(array.mean()), n=n, sd=sd)


def ratio_of(counted: int, total: int, *, of: str) -> Estimate:
    """Counts summed first; null where the total is 0."""
    return Estimate(value=counted / total, n=total) if total else null(f"no {of}")


_MAPPING = (
    Metric(
        name="tpr",
        unit="1",
        better="higher",
        per="pair",
        definition="The paper's TPR: share of an eligible pair's mapped points whose planar distance is "
        "within 15 % of the category's longest horizontal side around the surface distance, mean over "
        "pairs, no mapped point counts 0.",
    ),
    Metric(
        name="tpr.centre",
        unit="1",
        better="higher",
        per="pair",
        definition="The same as tpr around the distance of the box centre.",
    ),
    Metric(
        name="tpr.gnss",
        unit="1",
        better="higher",
        per="pair",
        definition="The same as tpr around the distance of the held GNSS reference, over pairs that have "
        "one.",
    ),
    Metric(
        name="tpr.nonempty",
        unit="1",
        better="higher",
        per="pair",
        definition="The same as tpr over pairs with at least one mapped point, as the paper seems to count.",
    ),
    Metric(
        name="tpr.pooled",
        unit="1",
        better="higher",
        per="mapped point",
        definition="The same as tpr with counts summed over pairs before dividing.",
    ),
    Metric(
        name="precision",
        unit="1",
        better="higher",
        per="pair",
        definition="Share of an eligible pair's mapped points that hit the target by exact label, mean over "
        "pairs, no mapped point counts 0.",
    ),
    Metric(
        name="precision.pooled",
        unit="1",
        better="higher",
        per="mapped point",
        definition="The same as precision with counts summed over pairs before dividing.",
    ),
    Metric(
        name="recall",
        unit="1",
        better="higher",
        per="pair",
        definition="Share of the target's true points that project into the image which were mapped, mean "
        "over eligible pairs.",
    ),
    Metric(
        name="recall.pooled",
        unit="1",
        better="higher",
        per="true point",
        definition="The same as recall with counts summed over pairs before dividing.",
    ),
    Metric(
        name=f"coverage@{T1_POINTS}points",
        unit="1",
        better="higher",
        per="pair",
        definition=f"The paper's Eq. 5: share of eligible pairs whose selection misses fewer than "
        f"{T1_POINTS} of "
        "the target's points.",
    ),
    Metric(
        name=f"coverage@{T1_PERCENT:g}percent",
        unit="1",
        better="higher",
        per="pair",
        definition=f"The paper's Eq. 5: share of eligible pairs whose selection misses fewer than "
        f"{T1_PERCENT:g} % "
        "of the target's points.",
    ),
    Metric(
        name="hit_rate",
        unit="1",
        better="higher",
        per="pair",
        definition="Share of eligible pairs whose representative (the mapped point of middle planar "
        "distance) lies "
        f"in the target's 3-D box grown by {HIT_MARGIN_M:g} m on every side.",
    ),
    Metric(
        name="hit_rate.given_tpr",
        unit="1",
        better="higher",
        per="pair with tpr > 0.5",
        definition="The same as hit_rate over the pairs whose tpr exceeds 0.5: the premise of the paper's "
        "hypothesis 2.",
    ),
    Metric(
        name="false_objects_per_frame",
        unit="1/frame",
        better="lower",
        per="frame",
        definition="Output objects that stand for a false box or an unknown track id, per delivered scan.",
    ),
)

_ERRORS = {
    "mae_lateral_m": "Mean absolute lateral (y) error",
    "mae_longitudinal_m": "Mean absolute longitudinal (x) error",
    "mae_m": "Mean of the lateral and the longitudinal mean absolute error, as in the paper",
    "planar_m": "Mean horizontal distance to the reference",
}
_STAGES = {"raw": "of the per-frame positions", "smooth": "of the trajectory at its own stamps"}
_REFERENCES = {
    "": "against the target's true centre at the same stamp",
    ".gnss": "against the paper's held 5 Hz GNSS reference",
}

_LOCALIZATION = (
    *(
        Metric(
            name=f"{error}.{stage}{suffix}",
            unit="m",
            better="lower",
            per="eligible frame with a position",
            definition=f"{error_text} {stage_text} {reference_text}; null below {MIN_ERROR_FRAMES} frames.",
        )
        for stage, stage_text in _STAGES.items()
        for suffix, reference_text in _REFERENCES.items()
        for error, error_text in _ERRORS.items()
    ),
    *(
        Metric(
            name=f"coverage.{stage}",
            unit="1",
            better="higher",
            per="eligible frame",
            definition=f"Share of eligible frames that got a position {stage_text}.",
        )
        for stage, stage_text in (("raw", "of their own"), ("smooth", "from the trajectory"))
    ),
    Metric(
        name="gross_rate.smooth",
        unit="1",
        better="lower",
        per="eligible frame",
        definition=f"Share of eligible frames whose trajectory position is off by more than {GROSS_M:g} m "
        "in the plane, or missing.",
    ),
    Metric(
        name="lateral_clearance_error_m",
        unit="m",
        better="lower",
        per="run",
        definition="Absolute lateral error of the trajectory in the eligible frame in which the target is "
        "truly closest.",
    ),
    Metric(
        name="ttc_error_s",
        unit="s",
        better="lower",
        per="closing frame",
        definition="Mean absolute error of the time until the trajectory draws level (longitudinal gap over "
        f"closing speed, both limited to 0..{TTC_HORIZON_S:g} s) over eligible frames that truly close in "
        f"within {TTC_HORIZON_S:g} s.",
    ),
    Metric(
        name="time_to_first_valid_s",
        unit="s",
        better="lower",
        per="run",
        definition="Time from the first eligible frame to the first one whose position rests on a "
        "representative "
        "point on the target (a hit).",
    ),
)

BUDGET_PARTS: Mapping[str, str] = {
    "surface_to_centre": "from the target's centre to the median of its visible points",
    "reference_lag": "the held GNSS fix is older than the position",
    "lever_arm": "antennas sit beside what they stand for",
    "heading": "the ego's heading error turns the reference",
    "reference_noise": "bias and noise of the GNSS",
    "sensor_attitude": "the fusion is told the LiDAR's pose at rest, the body shakes",
    "wrong_cluster": "the pipeline took other points than the target's median one, or moved it",
    "rest": "range noise, and motion between firing and stamp",
    "total": "raw position minus held GNSS reference: the sum of the parts",
}
BUDGET_AXES = ("longitudinal", "lateral")
_BUDGET = tuple(
    Metric(
        name=f"budget_{axis}_m.{part}",
        unit="m",
        better="lower",
        per="eligible frame",
        definition=f"Part of the raw position's error against the held GNSS, {axis}, signed mean: {text}; "
        "the nearer to 0 the better.",
    )
    for axis in BUDGET_AXES
    for part, text in BUDGET_PARTS.items()
)

MAPPING: tuple[Metric, ...] = _MAPPING
LOCALIZATION: tuple[Metric, ...] = _LOCALIZATION
BUDGET: tuple[Metric, ...] = _BUDGET
METRICS: tuple[Metric, ...] = MAPPING + LOCALIZATION + BUDGET


def as_markdown() -> str:
    """The whole specification as tables, for `docs/metrics.md`."""
    head = ["| metric | unit | better | n counts | definition |", "|---|---|---|---|---|"]
    lines = []
    for title, metrics in (("Mapping", MAPPING), ("Localization", LOCALIZATION), ("Error budget", BUDGET)):
        rows = [f"| `{m.name}` | {m.unit} | {m.better} | {m.per} | {m.definition} |" for m in metrics]
        lines += [f"## {title}", "", *head, *rows, ""]
    return "\n".join(lines)


def rows_of(estimates: dict[str, Estimate]) -> tuple[Row, ...]:
    """One row per metric of `METRICS`, in its order; ValueError where one is missing or too many."""
    names = {metric.name for metric in METRICS}
    if names != set(estimates):
        raise ValueError(f"metrics and their specification differ: {sorted(names ^ set(estimates))}")
    return tuple(
        Row(
            metric=metric.name,
            value=estimates[metric.name].value,
            unit=metric.unit,
            better=metric.better,
            n=estimates[metric.name].n,
            sd=estimates[metric.name].sd,
            why=estimates[metric.name].why,
        )
        for metric in METRICS
    )
