"""The page of a stress test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from simbench.case import ORACLE, Job
from simbench.files import write_text
from simbench.report import palette
from simbench.report.stress_figures import figure_of
from simbench.report.stress_worst import overlays
from simbench.report.words import pipeline_words
from simbench.score.metrics import METRICS as DEFINED
from simbench.score.statistics import MIN_RUNS
from simbench.stress.axes import Axis, Point, shown
from simbench.stress.ledger import Outcome
from simbench.stress.plan import Plan
from simbench.stress.table import METRICS, cells, worst

NAME = "stress.html"
PARTS = {
    "world": "world",
    "sensors": "sensing",
    "receipts": "receipts",
    "fusion and scores": "fusion and scores",
}


def write_page(
    plan: Plan, outcomes: Sequence[Outcome], jobs: Mapping[tuple[Point, int], Job], out: Path, *,
    title: str, command: str, wall_s: float, fresh: int,
) -> Path:  # fmt: skip
    """Write `out/stress.html` and return its path. jobs: by point and seed. wall_s: that `fresh` recordings
    took now."""
    seeds = len({outcome.seed for outcome in outcomes})
    made = Environment(
        loader=PackageLoader("simbench.report", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    table = cells(outcomes)
    definition = {metric.name: metric for metric in DEFINED}
    pipelines = [name for name in dict.fromkeys(o.pipeline for o in outcomes) if name != ORACLE]
    bad = {name: worst(outcomes, name) for name in pipelines}
    page = made.get_template("stress.html.j2").render(
        title=title,
        sentence=_sentence(plan, seeds),
        failed=[o for o in outcomes if o.status != "ok"],
        count=len(outcomes),
        figures=[
            (
                metric,
                definition[metric].better,
                definition[metric].definition,
                figure_of(plan.axes, table, metric, plan.design == "grid"),
            )
            for metric in METRICS
        ],
        seeds=seeds,
        few=f" (fewer than {MIN_RUNS}: no interval)" if seeds < MIN_RUNS else "",
        worst=[outcome for found in bad.values() for outcome in found],
        overlays=overlays(bad, jobs),
        words=pipeline_words,
        at=lambda point: at(plan.axes, point),
        number=lambda value: "–" if value is None else f"{value:.3f}",
        command=command,
        cost=cost(outcomes, wall_s, fresh),
        c=palette,
    )
    write_text(out / NAME, page)
    return out / NAME


def at(axes: Sequence[Axis], point: Point) -> str:
    """A point in words."""
    return ", ".join(f"{axis.name} {shown(value)}" for axis, value in zip(axes, point, strict=True))


def _sentence(plan: Plan, seeds: int) -> str:
    design = {"grid": "grid", "lhs": "Latin hypercube", "sobol": "Sobol sequence"}[plan.design]
    ranges = "; ".join(
        f"{axis.name} from {shown(axis.values[0])} to {shown(axis.values[-1])}"
        if axis.spread
        else f"{axis.name}: {', '.join(shown(v) for v in axis.values)}"
        for axis in plan.axes
    )
    return f"{len(plan.points)} points of a {design}, {seeds} seeds each, shared by all points. {ranges}."


def cost(outcomes: Sequence[Outcome], wall_s: float, fresh: int) -> str:
    """What the recordings took, and on what."""
    recordings = {(outcome.point, outcome.seed): outcome.seconds for outcome in outcomes}
    total = sum(sum(seconds.values()) for seconds in recordings.values())
    shares = ", ".join(
        f"{words} {sum(s.get(part, 0.0) for s in recordings.values()) / total:.0%}"
        for part, words in PARTS.items()
    )
    now = f"{fresh} of them now, {fresh / wall_s:.2f} a second" if fresh else "none of them now"
    return f"{len(recordings)} recordings, {now}; of {total:.0f} s of work: {shares}."
