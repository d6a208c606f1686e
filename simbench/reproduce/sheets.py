"""The tables of the reproduction as text, once; the page, CSV and LaTeX are made of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from simbench.case import ORACLE
from simbench.reproduce.answer import Answer
from simbench.reproduce.boards import BoardTable
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD, OURS, PIPELINES
from simbench.reproduce.conditions import READINGS, CellTable, ConditionTable
from simbench.reproduce.fit.study import CellReach, Fit
from simbench.reproduce.plan import SCENE_CONDITIONS
from simbench.reproduce.tables import Spread, TprTable
from simbench.score.statistics import Summary

COLUMNS = {
    BASELINE: "raw box",
    GROUND: "box without ground",
    METHOD: "P-Fusion",
    OURS: "robust",
    ORACLE: "oracle",
}
PARTS = ("surface_to_centre", "reference_lag", "lever_arm", "heading", "wrong_cluster")
ASSUMED = "S1 is taken for overtake-approach, S2 for overtake-recede: the paper does not say which is which."
NONE = "–"


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """name: of its files. rows: as many words as columns in each. texts: how many columns, from the left, are
    words, not numbers."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    texts: int = 1


def sheets(told: Answer) -> tuple[Sheet, ...]:
    """All tables, in the order of the paper, then ours."""
    found = [table_i(told.boards)]
    for table in told.conditions:
        found += [table_ii(table), table_ii_test(table), table_iii(table), unmeasured(table)]
    for table in told.conditions:
        found += [mae(table), readings(table)]
    found += [steps(told)] if told.steps else []
    found += [other_scenes(told)] if told.elsewhere else []
    found += [mended(told)] if told.mended else []
    for fit in told.fits:
        found += [levels(fit), predictions(fit)]
    return tuple(found)


def table_i(boards: tuple[BoardTable, ...]) -> Sheet:
    """TPR of a static board."""
    rows: list[tuple[str, ...]] = []
    for board in boards:
        rows += [
            (board.system, row.camera, NONE, share(row.tpr), share(row.tpr_true), str(row.tpr.n))
            for row in board.pairs
        ]
        printed = 100.0 * sum(board.printed) / len(board.printed)
        rows.append(
            (
                board.system,
                "mean",
                f"{printed:.1f}",
                share(board.mean),
                share(board.mean_true),
                str(board.mean.n),
            )
        )
    values = "; ".join(f"{b.system}: {', '.join(f'{100 * v:g}' for v in b.printed)}" for b in boards)
    return Sheet(
        texts=2, name="table-1", title="Table I: TPR (%) of a static board after calibration",
        columns=("rig", "camera", "paper", "found calibration", "true calibration", "calibrations"),
        rows=tuple(rows),
        notes=(
            f"The paper's pairs, in its order (which camera is which it does not say): {values}.",
            "20 poses a camera; clicks err by 1 px, corners among LiDAR points by 10 mm (1 SD).",
        ),
    )  # fmt: skip


def table_ii(table: ConditionTable) -> Sheet:
    """TPR before and after, the paper's beside ours."""
    rows = [
        (
            cell.cell, title,
            f"{100 * p.baseline:.1f} ({100 * p.baseline_sd:.1f})",
            f"{100 * p.fusion:.1f} ({100 * p.fusion_sd:.1f})",
            share(one.before), share(one.after), share(one.gain.difference, signed=True),
            f"{one.runs}", f"{one.pairs}",
        )
        for cell, title, one in _both(table)
        for p in (one.printed,)
    ]  # fmt: skip
    return Sheet(
        name=f"table-2-{table.condition}",
        title=f"Table II: TPR (%) of the baseline and of P-Fusion; {table.words}",
        columns=(
            "cell", "baseline", "paper: before (SD)", "paper: after (SD)", "ours: before", "ours: after",
            "ours: gain", "runs", "pairs",
        ),
        rows=tuple(rows), texts=2,
        notes=(ASSUMED, "Ours: all eligible pairs, every run weighs the same, 95 % over runs in brackets."),
    )  # fmt: skip


def table_ii_test(table: ConditionTable) -> Sheet:
    """The paper's paired test on our pairs."""
    rows = []
    for cell, title, one in _both(table):
        p, d, dependence = one.printed, one.drawn, one.dependence
        rows.append(
            (
                cell.cell, title, f"{p.paired_t:.2f}", chance(p.paired_p),
                str(p.n), _drawn(d, "before"), _drawn(d, "after"), spread(d.get("t"), 2),
                chances(d.get("p_two_sided")), chances(d.get("p_one_sided")),
                NONE if dependence.icc is None else f"{dependence.icc:.2f}",
                NONE if dependence.effective_n is None else f"{dependence.effective_n:.1f}",
            )
        )  # fmt: skip
    return Sheet(
        name=f"table-2-test-{table.condition}",
        title=f"The paper's paired test on our pairs, for comparison only; {table.words}",
        columns=(
            "cell", "baseline", "paper: t", "paper: p", "N", "before (SD)", "after (SD)", "t", "p two-sided",
            "p one-sided", "ICC", "effective n",
        ),
        rows=tuple(rows), texts=2,
        notes=(
            "N pairs drawn at random from all runs and treated as independent: medians of 1,000 draws, 2.5 "
            "and 97.5 percentiles in brackets.",
            "ICC: intra-class correlation of pairs within runs; effective n: what N of them are worth.",
        ),
    )  # fmt: skip


def _both(table: ConditionTable) -> Iterator[tuple[CellTable, str, TprTable]]:
    for cell in table.cells:
        yield cell, COLUMNS[BASELINE], cell.raw
        yield cell, COLUMNS[GROUND], cell.ground


def _drawn(drawn: dict[str, Spread], what: str) -> str:
    mean, sd = drawn.get(what), drawn.get(f"{what}_sd")
    if mean is None:
        return NONE
    inner = "" if sd is None else f" ({100 * sd.median:.1f})"
    return f"{100 * mean.median:.1f}{inner} [{100 * mean.low:.1f}, {100 * mean.high:.1f}]"


def table_iii(table: ConditionTable) -> Sheet:
    """P-Fusion against one half, and all pipelines."""
    rows = [
        (
            cell.cell, f"{p.half_t:.2f}", chance(p.half_p),
            spread(cell.raw.drawn.get("half_t"), 2), chances(cell.raw.drawn.get("half_p")),
            *(share(cell.pipelines[name]) for name in COLUMNS),
        )
        for cell in table.cells
        for p in (cell.raw.printed,)
    ]  # fmt: skip
    return Sheet(
        name=f"table-3-{table.condition}",
        title=f"Table III: is the TPR above 50 %? And the TPR (%) of all pipelines; {table.words}",
        columns=("cell", "paper: t", "paper: p", "its test on ours: t", "p", *COLUMNS.values()),
        rows=tuple(rows),
        notes=(
            "One-sample, right-tailed t against 0.5. The oracle maps exactly the target's points through the "
            "calibration that is told; a pipeline that takes a thin slice of the target can score above it.",
        ),
    )  # fmt: skip


def unmeasured(table: ConditionTable) -> Sheet:
    """What the paper asked for and did not measure."""
    asked = (BASELINE, GROUND, METHOD, OURS)
    rows = []
    for cell in table.cells:
        hits = [cell.premise[name] for name in asked]
        rows.append(
            (
                cell.cell, *(plain_share(cell.missed_few[name]) for name in asked),
                *(f"{plain_share(hit)} of {above}" for hit, above in hits),
            )
        )  # fmt: skip
    few = f"misses < {table.t1_points} points"
    return Sheet(
        name=f"unmeasured-{table.condition}",
        title=f"What the paper asks for and does not measure (% of pairs); {table.words}",
        columns=(
            "cell", *(f"{few}: {COLUMNS[name]}" for name in asked),
            *(f"point is right where TPR > 0.5: {COLUMNS[name]}" for name in asked),
        ),
        rows=tuple(rows),
        notes=(
            f"Misses fewer than t1 = {table.t1_points} of the target's points: its Eq. 5.",
            "Point is right: the premise of its hypothesis 2, that the median point lies on the target where "
            "the TPR is above 0.5; of so many pairs.",
        ),
    )  # fmt: skip


def mae(table: ConditionTable) -> Sheet:
    """Localization, and what the error is made of."""
    rows = []
    for rig in table.rigs:
        printed = rig.mae.printed
        longitudinal, lateral = (
            {part: rig.budget[axis][part].mean for part in rig.budget[axis]}
            for axis in ("longitudinal", "lateral")
        )
        rows.append(
            (
                rig.system, f"{printed.mean_m:.2f} ({printed.sd_m:.2f}), {printed.n}",
                spread(rig.mae.drawn, 2), metres(rig.mae.gnss), metres(rig.mae.exact),
                *(metres(rig.exact[name]) for name in (BASELINE, OURS, ORACLE)),
                *(
                    f"{_signed(longitudinal[part])} / {_signed(lateral[part])}"
                    for part in PARTS
                ),
            )
        )  # fmt: skip
    return Sheet(
        name=f"mae-{table.condition}",
        title=f"Mean of MAE X and MAE Y (m), and what it is made of; {table.words}",
        columns=(
            "rig", "paper (SD), N", "paper's draw on ours", "P-Fusion, held GNSS", "P-Fusion, exact centre",
            "raw box, exact", "robust, exact", "oracle, exact", *(part.replace("_", " ") for part in PARTS),
        ),
        rows=tuple(rows),
        notes=(
            "Parts: signed mean along / across the road [m] of P-Fusion's raw positions against the held "
            "5 Hz GNSS.",
        ),
    )  # fmt: skip


def readings(table: ConditionTable) -> Sheet:
    """What other readings of the measure give."""
    rows = [
        (cell.cell, COLUMNS[name], *(plain_share(cell.readings[name][reading]) for reading in READINGS))
        for cell in table.cells
        for name in PIPELINES
    ]
    return Sheet(
        name=f"readings-{table.condition}",
        title=f"The measure read otherwise (%), one at a time; {table.words}",
        columns=("cell", "pipeline", *READINGS), texts=2,
        rows=tuple(rows),
        notes=(
            "tpr: as everywhere here. nonempty: pairs without points left out. pooled: counts summed first. "
            "centre, gnss: 15 % around the distance of the centre, of the held GNSS. precision: by exact "
            "labels.",
        ),
    )  # fmt: skip


def steps(told: Answer) -> Sheet:
    """Every variant against the method as it is."""
    rows = [
        (
            str(one.step) if one.step else NONE, one.title, one.what, one.cell,
            *(
                share(one.differences[m].difference, signed=True) if m in one.differences else NONE
                for m in ("tpr", "precision", "recall")
            ),
            metres(one.differences["mae_m.smooth"].difference, signed=True),
            str(one.differences["mae_m.smooth"].difference.n),
        )
        for one in told.steps
    ]  # fmt: skip
    return Sheet(
        name="steps", title="One step or reading changed: difference to the method as it is",
        columns=("step", "what", "change", "cell", "TPR (points)", "precision", "recall", "MAE (m)", "runs"),
        rows=tuple(rows), texts=4, notes=("Under the errors that reach the paper's first scenario.",),
    )  # fmt: skip


def other_scenes(told: Answer) -> Sheet:
    """What would have to be different."""
    printed = {cell.name: 100 * cell.printed.baseline for cell in CELLS}
    both = {(one.cell, one.what, one.condition): one for one in told.elsewhere}
    asked = tuple((name, condition) for name in (BASELINE, GROUND, METHOD) for condition in SCENE_CONDITIONS)
    rows = [
        (
            cell, what, f"{printed[cell]:.1f}",
            *(share(both[cell, what, condition].tpr[name]) for name, condition in asked),
            str(both[cell, what, SCENE_CONDITIONS[0]].tpr[BASELINE].n),
        )
        for cell, what in dict.fromkeys((one.cell, one.what) for one in told.elsewhere)
    ]  # fmt: skip
    words = {"none": "no error", "bounds": "all at bounds"}
    return Sheet(
        name="elsewhere", title="What would have to be different: TPR (%) with one thing changed",
        columns=(
            "cell", "what", "paper: baseline", *(f"{COLUMNS[name]}, {words[at]}" for name, at in asked),
            "runs",
        ),
        rows=tuple(rows), texts=2,
        notes=(
            "Whatever distance was annotated: the window of 15 % of the size stands where it holds most of "
            "the mapped points, pair by pair; no annotation gives more.",
            "The range over the runs in brackets.",
        ),
    )  # fmt: skip


def mended(told: Answer) -> Sheet:
    """What mending one thing gives back."""
    rows = [
        (
            one.cell, one.what, share(one.tpr.difference, signed=True),
            metres(one.mae_m.difference, signed=True),
            str(one.tpr.difference.n),
        )
        for one in told.mended
    ]  # fmt: skip
    return Sheet(
        name="mended", title="Everything at its physical bound, then one thing mended: change of P-Fusion",
        columns=("cell", "mended", "TPR (points)", "MAE (m)", "runs"), texts=2, rows=tuple(rows),
        notes=("algorithm: robust in place of P-Fusion. MAE: below 0 is better.",),
    )  # fmt: skip


def levels(fit: Fit) -> Sheet:
    """What the fit makes of every level."""
    rows = [
        (
            one.name, f"0 to {one.bound:g} {one.unit}", f"{one.p50:.3g} [{one.p5:.3g}, {one.p95:.3g}]",
            f"{one.mean:.3g} ({one.prior_mean:.3g})",
            *(_stretches(fits) for fits in one.fits), _stretches(one.fits_together),
            f"{fit.checked.holm_p[one.name]:.2f}",
        )
        for one in fit.levels
    ]  # fmt: skip
    return Sheet(
        name=f"levels-{fit.system}-{fit.baseline}",
        title=f"Levels that bring the {COLUMNS[fit.baseline]} to the paper's values, {fit.system}",
        columns=(
            "cause", "prior: uniform", "posterior: median [5 %, 95 %]", "mean (of the prior)",
            *(f"alone reaches {cell}" for cell in fit.cells), "alone reaches both", "check: Holm p",
        ),
        rows=tuple(rows), notes=tuple(fit_words(fit)),
    )  # fmt: skip


def fit_words(fit: Fit) -> Iterator[str]:
    """The verdict on a fit in sentences."""
    if fit.verdict == "conflict":
        yield (
            f"Prior-data conflict (p = {fit.joint_p:.3f}): no levels within physics give both values but "
            f"by chance; the posterior is where the bench comes nearest, not an explanation."
        )
    else:
        yield (
            f"Levels within physics give both values (prior predictive p = {fit.joint_p:.2f}): "
            f"{100 * fit.share:.1f} % of the prior does."
        )
    for one in fit.reach:
        yield (
            f"{one.cell}: printed {100 * one.observed:.1f} %, within reach {100 * one.lowest:.1f} to "
            f"{100 * one.highest:.1f} % (p = {one.tail_p:.3f}): "
            f"{reach_words(one)}."
        )
    yield f"If the paper's two scenarios are the other way round: p = {fit.exchanged_p:.3f}."
    yield (
        f"{fit.points} levels in a Sobol design; Gaussian-process emulators with "
        f"Q2 {', '.join(NONE if g.q2 is None else f'{g.q2:.2f}' for g in fit.emulators)}, run to run SD "
        f"{', '.join(f'{100 * g.noise_sd:.1f}' for g in fit.emulators)} points; discrepancy "
        f"{100 * fit.discrepancy:g} points; {fit.ess:.0f} effective draws."
    )
    coverage = ", ".join(f"{nominal}: {100 * value:.0f} %" for nominal, value in fit.checked.coverage.items())
    yield (
        f"On {fit.checked.truths} synthetic truths the intervals cover {coverage}; ranks are "
        f"{'uniform' if fit.checked.passed else 'NOT uniform'}"
        f"{f' ({fit.checked.why})' if fit.checked.why else ''}."
    )
    for other in fit.sensitivity:
        yield (
            f"With a discrepancy of {100 * other.discrepancy:g} points: p = {other.joint_p:.3f}, "
            f"{100 * other.share:.1f} % of the prior fits."
        )
    if fit.why:
        yield fit.why


def reach_words(one: CellReach) -> str:
    """Whether any level reaches a cell, as far as the emulator knows."""
    if one.reached:
        return "reached"
    return "not reached" if one.excluded else "not known, the emulator is in doubt"


def predictions(fit: Fit) -> Sheet:
    """What the levels that fit predict of what was not fitted."""
    rows = [
        (
            one.what, _number(one.predicted.printed, 3),
            f"{one.predicted.p50:.3f} [{one.predicted.p5:.3f}, {one.predicted.p95:.3f}]",
            _number(one.predicted.tail_p, 3),
        )
        for one in fit.predictions
    ]  # fmt: skip
    return Sheet(
        name=f"predictions-{fit.system}-{fit.baseline}",
        title=f"Predicted from the {COLUMNS[fit.baseline]}'s fit, {fit.system}: none of these was fitted",
        columns=("number", "paper", "predicted: median [5 %, 95 %]", "chance of one as far out"),
        rows=tuple(rows),
    )


# -- words ---------------------------------------------------------------------------------------------------


def share(one: Summary, signed: bool = False) -> str:
    """A mean in per cent with its interval, or its range where there are too few runs for one."""
    return _summary(one, 100.0, 1, signed)


def metres(one: Summary, signed: bool = False) -> str:
    """The same in metres."""
    return _summary(one, 1.0, 2, signed)


def _summary(one: Summary, scale: float, digits: int, signed: bool) -> str:
    if one.mean is None:
        return NONE
    mark = "+" if signed else ""
    mean = f"{scale * one.mean:{mark}.{digits}f}"
    if one.ci95 is not None:
        return f"{mean} [{scale * one.ci95[0]:{mark}.{digits}f}, {scale * one.ci95[1]:{mark}.{digits}f}]"
    if one.n > 1 and one.low is not None and one.high is not None:
        return f"{mean} ({scale * one.low:{mark}.{digits}f} to {scale * one.high:{mark}.{digits}f})"
    return mean


def spread(one: Spread | None, digits: int) -> str:
    """Median and percentiles over draws."""
    return NONE if one is None else f"{one.median:.{digits}f} [{one.low:.{digits}f}, {one.high:.{digits}f}]"


def chance(p: float) -> str:
    """A p; what the paper prints as .001 stands for less."""
    return "< .001" if p <= 0.001 else f"{p:.3f}"


def chances(one: Spread | None) -> str:
    """Median and percentiles of p over draws."""
    return NONE if one is None else f"{chance(one.median)} [{chance(one.low)}, {chance(one.high)}]"


def plain_share(value: float | None) -> str:
    """In per cent."""
    return NONE if value is None else f"{100 * value:.1f}"


def _number(value: float | None, digits: int) -> str:
    return NONE if value is None else f"{value:.{digits}f}"


def _signed(value: float | None) -> str:
    return NONE if value is None else f"{value:+.2f}"


def _stretches(fits: tuple[tuple[float, float], ...]) -> str:
    return ", ".join(f"{low:.3g} to {high:.3g}" for low, high in fits) or "no level"
