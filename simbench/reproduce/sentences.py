"""The findings' sentences: nothing here is written by hand but the words between the numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from simbench.case import ORACLE
from simbench.explain.attribution import Attribution
from simbench.reproduce.boards import BoardTable
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD, OURS
from simbench.reproduce.conditions import CellTable, ConditionTable, RigTable
from simbench.reproduce.effects import Mended
from simbench.reproduce.elsewhere import ANY_DISTANCE, AS_IT_IS, Elsewhere
from simbench.reproduce.fit.study import Fit
from simbench.reproduce.grids import Strip
from simbench.reproduce.protocol import Dependence
from simbench.reproduce.sheets_fit import fit_words
from simbench.reproduce.slopes import Slopes
from simbench.reproduce.steps import Changed
from simbench.reproduce.words import COLUMNS, bounds, interval
from simbench.score.statistics import Paired, Summary

LARGEST = 4  # parts of an error that are named


def boards(tables: Sequence[BoardTable]) -> Iterator[str]:
    """Table I."""
    for table in tables:
        printed = 100 * sum(table.printed) / len(table.printed)
        yield (
            f"{table.system}: TPR of a static board, mean over the cameras: paper {printed:.1f} %; ours "
            f"{_share(table.mean)} with the calibration that was found, {_share(table.mean_true)} with "
            f"the true one ({_runs(table.mean)})."
        )


def agreement(table: ConditionTable, varied: Mapping[str, Dependence]) -> Iterator[str]:
    """Table II and III, and what its frames are worth."""
    yield f"Ours here: {table.words}; {table.cells[0].raw.runs} runs a cell."
    for cell in table.cells:
        printed = cell.raw.printed
        yield (
            f"{cell.cell}: paper {100 * printed.baseline:.1f} → {100 * printed.fusion:.1f} %; ours: raw box "
            f"{_share(cell.pipelines[BASELINE])}, box without ground {_share(cell.pipelines[GROUND])}, "
            f"P-Fusion {_share(cell.pipelines[METHOD])}, robust {_share(cell.pipelines[OURS])}; "
            f"oracle {_share(cell.pipelines[ORACLE])}."
        )
        yield from _worth(cell, varied)


def _mean(cell: CellTable, pipeline: str) -> float:
    return cell.pipelines[pipeline].mean or 0.0


def _worth(cell: CellTable, varied: Mapping[str, Dependence]) -> Iterator[str]:
    alike, apart = cell.raw.dependence, varied.get(cell.cell)
    if alike.icc is None or alike.effective_n is None:
        return
    words = (
        f"{cell.cell}: the paper's {cell.raw.printed.n} frames of two passes are worth "
        f"{alike.effective_n:.1f} independent ones if its passes had the same errors "
        f"(intra-class correlation {alike.icc:.2f})"
    )
    if apart is not None and apart.icc is not None and apart.effective_n is not None:
        words += (
            f", {apart.effective_n:.1f} if their levels differed as within physics they may ({apart.icc:.2f})"
        )
    yield f"{words}."


def helping(table: ConditionTable) -> Iterator[str]:
    """The method without errors."""
    for cell in table.cells:
        yield (
            f"{cell.cell}, no error injected: P-Fusion {_gain(cell.ground.gain)} on the box without ground "
            f"({_share(cell.pipelines[GROUND])}), and {_gain(cell.raw.gain)} on the raw box "
            f"({_share(cell.pipelines[BASELINE])}); {_runs(cell.pipelines[METHOD])}."
        )
    above = [cell.cell for cell in table.cells if _mean(cell, METHOD) > _mean(cell, ORACLE)]
    if above:
        yield (
            f"{', '.join(above)}, no error injected: P-Fusion's TPR is above that of the oracle, which maps "
            "the target's points and no other: the measure rewards a thin slice of the target."
        )


def purpose(table: ConditionTable) -> Iterator[str]:
    """Eq. 5, and the premise of hypothesis 2."""
    yield f"Errors here: {table.words}; {table.cells[0].raw.runs} runs a cell."
    for cell in table.cells:
        few = ", ".join(
            f"{COLUMNS[name]} {100 * value:.0f} %"
            for name in (BASELINE, GROUND, METHOD, OURS)
            if (value := cell.missed_few[name]) is not None
        )
        hit, above = cell.premise[METHOD]
        premise = (
            ""
            if hit is None
            else f" Where P-Fusion's TPR is above 50 %, its median point is on the target "
            f"in {100 * hit:.1f} % of {above} pairs."
        )
        yield (
            f"{cell.cell}: fewer than {table.t1_points} of the target's points are missed (Eq. 5) "
            f"in so many of {cell.raw.pairs} pairs: {few}.{premise}"
        )


def fitted(fit: Fit) -> Iterator[str]:
    """The verdict of a fit, and what it predicts."""
    verdict, *more = fit_words(fit)
    yield f"{fit.system}, {COLUMNS[fit.baseline]}. {' '.join((verdict, *more[: len(fit.cells) + 1]))}"
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


def different(rows: Sequence[Elsewhere]) -> Iterator[str]:
    """What brings the baselines nearer to what was printed."""
    words = {"none": "without errors", "bounds": "with all at bounds"}
    for cell in CELLS if rows else ():
        mine = [one for one in rows if one.cell == cell.name]
        tpr = {
            (one.what, one.condition, name): mean
            for one in mine
            for name in (BASELINE, GROUND)
            if (mean := one.tpr[name].mean) is not None
        }
        printed = cell.printed.baseline
        as_it_is = ", ".join(
            f"{COLUMNS[name]} {100 * tpr[AS_IT_IS, at, name]:.1f} % {words[at]}"
            for name in (BASELINE, GROUND)
            for at in words
        )
        spanned = [
            COLUMNS[name]
            for name in (BASELINE, GROUND)
            for ends in (sorted(tpr[AS_IT_IS, at, name] for at in words),)
            if ends[0] <= printed <= ends[1]
        ]
        scenes = [key for key in tpr if key[0] not in (AS_IT_IS, ANY_DISTANCE)]
        what, at, name = min(scenes, key=lambda key: abs(tpr[key] - printed))
        answer = (
            f"Nothing, if its baseline was the {' or the '.join(spanned)}: as it is, it lies on both sides"
            if spanned
            else f"With one thing changed nearest: {what} ({COLUMNS[name]}, {words[at]}) "
            f"{100 * tpr[what, at, name]:.1f} %"
        )
        yield (
            f"{cell.name}: paper {100 * printed:.1f} %; as it is: {as_it_is}. {answer} "
            f"({_runs(mine[0].tpr[BASELINE])})."
        )
        highest = max(tpr[ANY_DISTANCE, at, BASELINE] for at in words)
        yield (
            f"{cell.name}: whatever distance was annotated, the raw box has at most {100 * highest:.1f} %, "
            f"{'less than' if highest < printed else 'not less than'} the paper's."
        )


def alone(strips: Sequence[Strip], cause: str) -> Iterator[str]:
    """One cause and nothing else."""
    for one in strips:
        if one.cause != cause or one.pipeline not in (BASELINE, GROUND, METHOD):
            continue
        told = [
            f"{100 * change.difference.mean:+.1f}{interval(change.difference, 100.0, 1, signed=True)} at "
            f"{level:g}"
            for level, change in zip(one.level[1:], one.change[1:], strict=True)
            if change.difference.mean is not None
        ]
        start = one.tpr[0]
        yield (
            f"{one.cell}, {COLUMNS[one.pipeline]}, nothing else wrong: "
            f"{'no value' if start is None else f'{100 * start:.1f} %'} without it; points of TPR: "
            f"{', '.join(told)} {one.unit} (n = {one.n}; physical up to {one.bound:g})."
        )


def _is_told(pipeline: str, metric: str) -> bool:
    """Of all that was measured: both metrics of the method, the baseline's TPR."""
    return pipeline == METHOD or (pipeline == BASELINE and metric == "tpr")


def _unit(metric: str) -> tuple[float, str, int]:
    """Scale, unit and digits of a change."""
    return (100.0, "points of TPR", 1) if metric == "tpr" else (1.0, "m of MAE", 2)


def amid(rows: Sequence[Slopes]) -> Iterator[str]:
    """What each cause costs the method, the others anywhere within physics."""
    for one in (row for row in rows if _is_told(row.pipeline, row.metric)):
        scale, unit, digits = _unit(one.metric)
        sure = sorted(
            (slope for slope in one.causes if slope.ci[0] > 0.0 or slope.ci[1] < 0.0),
            key=lambda slope: -abs(slope.effect),
        )
        words = "; ".join(
            f"{slope.cause} {scale * slope.effect:+.{digits}f}{bounds(slope.ci, scale, digits, signed=True)}"
            for slope in sure
        )
        rest = ", ".join(slope.cause for slope in one.causes if slope not in sure)
        yield (
            f"{one.cell}, {COLUMNS[one.pipeline]}, {unit} from none to the bound: "
            f"{words or 'nothing is beyond chance'}"
            f"{f'; not beyond chance: {rest}' if words and rest else ''} (n = {one.n})."
        )


def together(found: Mapping[str, Sequence[Attribution]]) -> Iterator[str]:
    """Groups of causes, each at its bound, taken apart: those sets of them that count among all at once."""
    told = ((cell, one) for cell, rows in found.items() for one in rows if _is_told(one.pipeline, one.metric))
    for cell, one in told:
        scale, unit, digits = _unit(one.metric)
        named = "; ".join(
            f"{' and '.join(e.causes)} {scale * (e.summary.mean or 0.0):+.{digits}f}"
            f"{bounds(e.together, scale, digits, signed=True)}"
            f"{' beyond their smaller sets' if len(e.causes) > 1 else ''}"
            for e in one.named
        )
        sure = f"beyond chance, all sets at once: {named}" if named else one.why
        total = one.total.summary
        yield (
            f"{cell}, {COLUMNS[one.pipeline]}, loss in {unit} with everything at its bound "
            f"{scale * (total.mean or 0.0):+.{digits}f}{interval(total, scale, digits, signed=True)}; "
            f"{sure} (n = {total.n})."
        )


def metres_of(table: ConditionTable) -> Iterator[str]:
    """The localization error without errors, and what it is made of."""
    for rig in table.rigs:
        yield _metres_of_rig(rig)
    for cell in table.cells:
        parts = [
            (axis, part, summary)
            for axis, of in cell.budget.items()
            for part, summary in of.items()
            if part != "total" and summary.mean is not None
        ]
        largest = sorted(parts, key=lambda one: -abs(one[2].mean or 0.0))[:LARGEST]
        words = ", ".join(
            f"{part.replace('_', ' ')} {axis} {one.mean:+.2f} m{interval(one, 1.0, 2, signed=True)}"
            for axis, part, one in largest
        )
        yield (
            f"{cell.cell}: largest parts of the raw positions' error against the held GNSS: {words}; MAE of "
            f"P-Fusion {_m(cell.mae_gnss_m[METHOD])} against it, {_m(cell.mae_m[METHOD])} against the exact "
            f"centre."
        )


def _metres_of_rig(rig: RigTable) -> str:
    return (
        f"{rig.system}: paper {rig.mae.printed.mean_m:.2f} m; P-Fusion without errors "
        f"{_m(rig.mae.gnss)} against the held GNSS and {_m(rig.mae.exact)} against the exact centre; "
        f"robust {_m(rig.exact[OURS])} and the oracle's points {_m(rig.exact[ORACLE])} "
        f"against the exact centre ({_runs(rig.mae.exact)})."
    )


def mending(rows: Sequence[Mended]) -> Iterator[str]:
    """Everything at its bound, one thing mended."""
    for cell in dict.fromkeys(one.cell for one in rows):
        mine = [one for one in rows if one.cell == cell and one.tpr.difference.mean is not None]
        ordered = sorted(mine, key=lambda one: -(one.tpr.difference.mean or 0.0))
        words = "; ".join(
            f"{one.what} {100 * (one.tpr.difference.mean or 0.0):+.1f}"
            f"{interval(one.tpr.difference, 100.0, 1, signed=True)} points, "
            f"{_change_m(one.mae_m.difference)} MAE"
            for one in ordered
        )
        yield (
            f"{cell}, everything at its physical bound, one thing mended: {words} "
            f"({_runs(mine[0].tpr.difference)}; every interval by itself)."
        )


def carrying(rows: Sequence[Changed]) -> Iterator[str]:
    """What changes when a step is removed or replaced."""
    for cell in dict.fromkeys(one.cell for one in rows):
        mine = [
            (one, one.differences["tpr"].difference)
            for one in rows
            if one.cell == cell and "tpr" in one.differences
        ]
        sure = sorted(
            ((one, d) for one, d in mine if d.ci95 is not None and (d.ci95[0] > 0.0 or d.ci95[1] < 0.0)),
            key=lambda pair: pair[1].mean or 0.0,
        )
        if not mine or mine[0][1].ci95 is None:
            continue
        words = "; ".join(
            f"{one.title} {one.what} {100 * (d.mean or 0.0):+.1f}{interval(d, 100.0, 1, signed=True)}"
            for one, d in sure
        )
        yield (
            f"{cell}, points of TPR: {words or 'no change is beyond chance'}; the other "
            f"{len(mine) - len(sure)} of {len(mine)} changes are not beyond chance, each by itself "
            f"({_runs(mine[0][1])})."
        )


def _share(one: Summary) -> str:
    return "no value" if one.mean is None else f"{100 * one.mean:.1f} %{interval(one, 100.0, 1)}"


def _m(one: Summary) -> str:
    return "no value" if one.mean is None else f"{one.mean:.2f} m{interval(one, 1.0, 2)}"


def _change_m(one: Summary) -> str:
    return "no" if one.mean is None else f"{one.mean:+.2f}{interval(one, 1.0, 2, signed=True)} m"


def _runs(one: Summary) -> str:
    """How many runs; without an interval it is a number only."""
    return f"n = {one.n}{'' if one.ci95 is not None else ': numbers only'}"


def _gain(gain: Paired) -> str:
    """What a paired difference of shares says: gains, loses, or neither beyond chance."""
    one = gain.difference
    if one.mean is None:
        return "has no value"
    points = f"{100 * one.mean:+.1f} points{interval(one, 100.0, 1, signed=True)}"
    if one.ci95 is None:
        return f"changes {points}"
    if one.ci95[0] > 0.0:
        return f"gains {points}"
    return f"loses {points}" if one.ci95[1] < 0.0 else f"changes nothing sure, {points}"
