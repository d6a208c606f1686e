"""The page's tables as plain data: every number comes from a row of a case, averaged over runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from scenarios.seeding import stream
from simbench.case import ORACLE, JobResult
from simbench.faults.receipt import MISMATCH, OK, UNVERIFIABLE, Status
from simbench.report.choose import Group, case_of
from simbench.report.names import OURS
from simbench.report.words import NONE, pipeline_words, told_words
from simbench.results import latency_ms
from simbench.score.metrics import METRICS
from simbench.score.statistics import summarize


@dataclass(frozen=True, kw_only=True)
class Column:
    """One metric of the numbers table. `factor`, `digits`: how it is printed."""

    metric: str
    head: str
    unit: str
    factor: float
    digits: int
    group: str = ""


COLUMNS = (
    Column(metric="tpr", head="TPR", unit="%", factor=100, digits=1, group="mapping"),
    Column(metric="precision", head="precision", unit="%", factor=100, digits=1, group="mapping"),
    Column(metric="recall", head="recall", unit="%", factor=100, digits=1, group="mapping"),
    Column(metric="hit_rate", head="hit rate", unit="%", factor=100, digits=1, group="mapping"),
    Column(metric="mae_lateral_m.raw", head="raw", unit="m", factor=1, digits=2, group="MAE lateral"),
    Column(metric="mae_lateral_m.smooth", head="smooth", unit="m", factor=1, digits=2, group="MAE lateral"),
    Column(
        metric="mae_longitudinal_m.raw", head="raw", unit="m", factor=1, digits=2, group="MAE longitudinal"
    ),
    Column(
        metric="mae_longitudinal_m.smooth",
        head="smooth",
        unit="m",
        factor=1,
        digits=2,
        group="MAE longitudinal",
    ),
    Column(metric="mae_m.raw", head="raw", unit="m", factor=1, digits=2, group="MAE of both"),
    Column(metric="mae_m.smooth", head="smooth", unit="m", factor=1, digits=2, group="MAE of both"),
    Column(metric="coverage.raw", head="raw", unit="%", factor=100, digits=0, group="coverage"),
    Column(metric="coverage.smooth", head="smooth", unit="%", factor=100, digits=0, group="coverage"),
    Column(metric="gross_rate.smooth", head="> 1 m", unit="%", factor=100, digits=0, group="gross"),
    Column(metric="latency_ms.p50", head="p50", unit="ms", factor=1, digits=1, group="latency"),
)
WITHOUT_TARGET = (
    Column(
        metric="false_objects_per_frame", head="false", unit="1/frame", factor=1, digits=2, group="objects"
    ),
    COLUMNS[-1],
)
DEFINITIONS = {metric.name: metric.definition for metric in METRICS}


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A printed value, what stands under it (range or interval, empty for one run), and why it is missing."""

    metric: str
    text: str
    spread: str
    why: str


@dataclass(frozen=True, kw_only=True)
class Line:
    """One pipeline on one side of a group. `pairs`, `frames`: counts of the runs together."""

    pipeline: str
    words: str
    side: str
    runs: int
    failed: int
    pairs: int
    frames: int
    cells: tuple[Cell, ...]


def columns(group: Group) -> tuple[Column, ...]:
    """What the group's table shows."""
    return COLUMNS if group.has_target() else WITHOUT_TARGET


def lines(group: Group) -> tuple[Line, ...]:
    """All pipelines and the oracle, without and with errors."""
    names = [*group.pipelines, *([ORACLE] if group.has_target() else [])]
    return tuple(_line(group, side, name) for name in names for side in group.sides)


@dataclass(frozen=True, kw_only=True)
class NameLine:
    """What a pipeline of the tables is: its words, its name on the command line, what it takes."""

    words: str
    pipeline: str
    takes: str


def name_lines(groups: Sequence[Group]) -> tuple[NameLine, ...]:
    """One line for each of our own pipelines that ran, and for the oracle where there is one."""
    named = dict.fromkeys(name for group in groups for name in group.pipelines)
    if any(group.has_target() for group in groups):
        named[ORACLE] = None
    return tuple(
        NameLine(words=OURS[name].name, pipeline="" if name == ORACLE else name, takes=OURS[name].takes)
        for name in named
        if name in OURS
    )


def _line(group: Group, side: str, pipeline: str) -> Line:
    cases = {seed: c for seed, r in group.results(side) if (c := case_of(r, pipeline)) is not None}
    scored = [c for c in cases.values() if c.scores is not None]
    counts = {
        metric: sum(row.n for c in scored for row in c.rows if row.metric == metric)
        for metric in ("tpr", "coverage.raw")
    }
    cells = []
    for column in columns(group):
        values: dict[int, float | None] = {}
        why = ""
        for seed, case in cases.items():
            if column.metric.startswith("latency_ms"):
                values[seed] = latency_ms(case).get(column.metric, (None, 0))[0]
                continue
            row = next((r for r in case.rows if r.metric == column.metric), None)
            values[seed] = None if row is None else row.value
            why = why or ("" if row is None or row.why is None else row.why)
        cells.append(_cell(column, values, why, (group.scenario, group.system, side, pipeline)))
    return Line(
        pipeline=pipeline,
        words=pipeline_words(pipeline),
        side=side,
        runs=len(cases),
        failed=len(cases) - len(scored),
        pairs=counts["tpr"],
        frames=counts["coverage.raw"],
        cells=tuple(cells),
    )


def _cell(column: Column, values: dict[int, float | None], why: str, path: tuple[str, ...]) -> Cell:
    summary = summarize(values, stream(0, "summary", *path, column.metric))

    def text(value: float) -> str:
        return f"{column.factor * value:.{column.digits}f}"

    spread = ""
    if summary.ci95 is not None:
        spread = f"[{text(summary.ci95[0])}, {text(summary.ci95[1])}]"
    elif summary.n > 1 and summary.low is not None and summary.high is not None:
        low, high = text(summary.low), text(summary.high)
        spread = f"{low}–{high}" if low != high else ""
    return Cell(
        metric=column.metric,
        text=NONE if summary.mean is None else text(summary.mean),
        spread=spread,
        why=why if summary.mean is None else "",
    )


def heads(columns: Sequence[Column]) -> tuple[tuple[str, int], ...]:
    """The upper header: (words, how many columns)."""
    found: list[tuple[str, int]] = []
    for column in columns:
        if found and found[-1][0] == column.group:
            found[-1] = (column.group, found[-1][1] + 1)
        else:
            found.append((column.group, 1))
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class ReceiptLine:
    where: str
    fault: str
    quantity: str
    unit: str
    requested: str
    realised: str
    measured: str
    smallest: str
    status: str
    note: str


def receipt_lines(results: Iterable[JobResult]) -> tuple[ReceiptLine, ...]:
    return tuple(
        ReceiptLine(
            where=", ".join(
                (result.scenario.name, result.job.system, f"seed {result.job.seed}", result.faults.label)
            ),
            fault=r.fault,
            quantity=r.quantity,
            unit=r.unit,
            requested=f"{r.requested:.4g}",
            realised=f"{r.realised:.4g}",
            measured=NONE if r.measured is None else f"{r.measured:.4g}",
            smallest=f"{r.smallest:.2g}",
            status=r.status,
            note=r.note,
        )
        for result in results
        for r in result.receipts
    )


def _short(shake: str) -> str:
    """The end of a sentence on a shake: the road that gives it."""
    return shake.rpartition(": ")[2].removesuffix(" on this vehicle").replace("road class", "class")


@dataclass(frozen=True, kw_only=True)
class Badge:
    """`tone`: good, bad, or plain."""

    text: str
    tone: str
    title: str = ""


def badges(results: Sequence[JobResult], groups: Sequence[Group]) -> tuple[Badge, ...]:
    """Cases, receipts, a calibration that is not the true one, and what the shake is in the world."""
    found = []
    cases = [c for r in results for c in r.cases]
    bad = sum(c.status != "ok" for c in cases)
    if bad:
        found.append(Badge(text=f"{bad} of {len(cases)} cases failed", tone="bad"))
    else:
        found.append(Badge(text=f"{len(cases)} of {len(cases)} cases ok", tone="good"))
    statuses = [r.status for result in results for r in result.receipts]
    tones: dict[Status, str] = {OK: "good", MISMATCH: "bad", UNVERIFIABLE: "plain"}
    for status, tone in tones.items():
        count = statuses.count(status)
        if count:
            found.append(Badge(text=f"receipts {status}: {count} of {len(statuses)}", tone=tone))
    if any(result.job.told == "found" for result in results):
        found.append(Badge(text="calibration: found", tone="plain", title=told_words("found", False)))
    if not statuses:
        found.append(Badge(text="no errors injected, no receipts", tone="plain"))
    shakes: dict[tuple[str, str], str] = {}
    for result in results:
        if result.shake:
            shakes.setdefault((result.job.system, result.faults.label), result.shake)
    for (system, _), shake in dict.fromkeys((k, v) for k, v in shakes.items()):
        found.append(Badge(text=f"{system} shake: {_short(shake)}", tone="plain", title=shake))
    return tuple(found)
