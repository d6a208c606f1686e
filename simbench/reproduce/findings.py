"""What was found, in sentences that are made of the numbers: nothing here is written by hand but the words
between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from simbench.case import ORACLE
from simbench.reproduce.answer import Answer
from simbench.reproduce.cells import BASELINE, GROUND, METHOD, OURS
from simbench.reproduce.conditions import ConditionTable, RigTable
from simbench.reproduce.effects import Mended
from simbench.reproduce.fit.study import Fit
from simbench.reproduce.grids import Strip
from simbench.reproduce.sheets import COLUMNS, fit_words
from simbench.score.statistics import MIN_RUNS, Paired, Summary


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A question and what the runs say of it, a sentence a line."""

    question: str
    says: tuple[str, ...]


def findings(told: Answer) -> tuple[Finding, ...]:
    """All questions that this size of a reproduction answers."""
    by_name = {table.condition: table for table in told.conditions}
    found = [
        Finding(question="Do the tables agree?", says=tuple(_agreement(by_name["reached"]))),
        Finding(question="Does the method help when nothing is wrong?", says=tuple(_help(by_name["none"]))),
    ]
    if told.fits:
        found.append(
            Finding(
                question="Which levels of error bring the baseline to the paper's values?",
                says=tuple(line for fit in told.fits for line in _fit(fit)),
            )
        )
    if told.strips:
        found += [
            Finding(
                question="Does a sync offset alone matter?",
                says=tuple(_alone(told.strips, "trigger offset")),
            ),
            Finding(
                question="What does a spinning LiDAR do to a rig with a hardware trigger?",
                says=tuple(_alone(told.strips, "spin phase")),
            ),
        ]
    found.append(
        Finding(
            question="How much of the paper's 1.15 m and 1.07 m is the algorithm?",
            says=tuple(line for rig in by_name["none"].rigs for line in _metres(rig)),
        )
    )
    if told.mended:
        found.append(Finding(question="What to mend first?", says=tuple(_mend(told.mended))))
    return tuple(found)


def as_markdown(told: Answer, command: str) -> str:
    """`docs/findings.md`."""
    lines = [
        "# What the reproduction found",
        "",
        f"Made by `{command}` from {told.runs} runs; every number is of its `result.json`. "
        "Do not edit: a test compares this page with the stored result.",
        "",
        "Intervals in brackets are 95 % over runs. S1 is taken for overtake-approach and S2 for "
        "overtake-recede, which the paper does not say. Raw box: all points in the box; box without ground: "
        "after step 1.",
        "",
    ]
    for one in findings(told):
        lines += [f"## {one.question}", "", *(f"* {line}" for line in one.says), ""]
    if told.failures:
        lines += ["## Runs that failed", "", *(f"* {line}" for line in told.failures), ""]
    return "\n".join(lines).rstrip() + "\n"


def _agreement(table: ConditionTable) -> Iterator[str]:
    for cell in table.cells:
        printed = cell.raw.printed
        yield (
            f"{cell.cell}: paper {100 * printed.baseline:.1f} → {100 * printed.fusion:.1f} %; ours ("
            f"{table.words}): raw box {_share(cell.pipelines[BASELINE])}, box without ground "
            f"{_share(cell.pipelines[GROUND])}, P-Fusion {_share(cell.pipelines[METHOD])}, robust "
            f"{_share(cell.pipelines[OURS])}; oracle {_share(cell.pipelines[ORACLE])}."
        )
        icc, effective = cell.raw.dependence.icc, cell.raw.dependence.effective_n
        if icc is not None and effective is not None:
            yield (
                f"{cell.cell}: the paper's {printed.n} frames are worth {effective:.1f} independent ones, if "
                f"its passes differ as ours do (intra-class correlation {icc:.2f})."
            )


def _help(table: ConditionTable) -> Iterator[str]:
    for cell in table.cells:
        yield (
            f"{cell.cell}: P-Fusion {_gain(cell.ground.gain)} on the box without ground "
            f"({_share(cell.pipelines[GROUND])}), and {_gain(cell.raw.gain)} on the raw box "
            f"({_share(cell.pipelines[BASELINE])})."
        )


def _fit(fit: Fit) -> Iterator[str]:
    verdict, *more = fit_words(fit)
    reach = " ".join(more[: len(fit.cells)])
    yield f"{fit.system}, {COLUMNS[fit.baseline]}. {verdict} {reach}"
    inside, outside = list[str](), list[str]()
    for one in fit.predictions:
        p = one.predicted
        if p.printed is not None:
            words = f"{one.what} (paper {p.printed:.2f}, predicted {p.p50:.2f} [{p.p5:.2f}, {p.p95:.2f}])"
            (inside if p.p5 <= p.printed <= p.p95 else outside).append(words)
    for what, those in (("inside", inside), ("outside", outside)):
        if those:
            yield (
                f"{fit.system}, {COLUMNS[fit.baseline]}: {what} the 90 % that these levels predict: "
                f"{'; '.join(those)}."
            )


def _alone(strips: tuple[Strip, ...], cause: str) -> Iterator[str]:
    for one in strips:
        if one.cause != cause or one.pipeline not in (BASELINE, GROUND, METHOD):
            continue
        told = [
            f"{100 * tpr:.1f} % at {level:g} {one.unit}"
            for level, tpr in zip(one.level, one.tpr, strict=True)
            if tpr is not None
        ]
        yield f"{one.cell}, {COLUMNS[one.pipeline]}, nothing else wrong: {', '.join(told)} (n = {one.n})."


def _metres(rig: RigTable) -> Iterator[str]:
    printed = rig.mae.printed
    yield (
        f"{rig.system}: paper {printed.mean_m:.2f} m; P-Fusion without errors {_m(rig.mae.gnss)} against the "
        f"held GNSS and {_m(rig.mae.exact)} against the exact centre; robust {_m(rig.exact[OURS])} and the "
        f"oracle's points {_m(rig.exact[ORACLE])} against the exact centre."
    )
    parts = [
        (axis, part, summary.mean)
        for axis, of in rig.budget.items()
        for part, summary in of.items()
        if part != "total" and summary.mean is not None
    ]
    largest = sorted(parts, key=lambda one: -abs(one[2]))[:5]
    words = ", ".join(f"{part.replace('_', ' ')} {axis} {mean:+.2f} m" for axis, part, mean in largest)
    yield f"{rig.system}: largest parts of the raw positions' error against the held GNSS: {words}."


def _mend(rows: tuple[Mended, ...]) -> Iterator[str]:
    for cell in dict.fromkeys(one.cell for one in rows):
        mine = [one for one in rows if one.cell == cell and one.tpr.difference.mean is not None]
        ordered = sorted(mine, key=lambda one: -(one.tpr.difference.mean or 0.0))
        words = "; ".join(
            f"{one.what} {100 * (one.tpr.difference.mean or 0.0):+.1f} points, "
            f"{_signed_m(one.mae_m.difference.mean)} MAE"
            for one in ordered
        )
        few = (
            "" if mine[0].tpr.difference.n >= MIN_RUNS else f" (n = {mine[0].tpr.difference.n}: numbers only)"
        )
        yield f"{cell}, everything at its physical bound, one thing mended: {words}{few}."


def _share(one: Summary) -> str:
    if one.mean is None:
        return "no value"
    inside = "" if one.ci95 is None else f" [{100 * one.ci95[0]:.1f}, {100 * one.ci95[1]:.1f}]"
    return f"{100 * one.mean:.1f} %{inside}"


def _m(one: Summary) -> str:
    if one.mean is None:
        return "no value"
    inside = "" if one.ci95 is None else f" [{one.ci95[0]:.2f}, {one.ci95[1]:.2f}]"
    return f"{one.mean:.2f} m{inside}"


def _signed_m(value: float | None) -> str:
    return "no" if value is None else f"{value:+.2f} m"


def _gain(gain: Paired) -> str:
    """What a paired difference of shares says: gains, loses, or neither beyond chance."""
    one = gain.difference
    if one.mean is None:
        return "has no value"
    points = f"{100 * one.mean:+.1f} points"
    if one.ci95 is None:
        return f"changes {points} (n = {one.n}: a number only)"
    inside = f"[{100 * one.ci95[0]:+.1f}, {100 * one.ci95[1]:+.1f}]"
    if one.ci95[0] > 0.0:
        return f"gains {points} {inside}"
    return f"loses {points} {inside}" if one.ci95[1] < 0.0 else f"changes nothing sure, {points} {inside}"
