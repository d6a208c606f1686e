"""The paper's tables beside ours."""

from __future__ import annotations

from collections.abc import Iterator

from simbench.case import ORACLE
from simbench.reproduce.boards import BoardTable
from simbench.reproduce.cells import BASELINE, GROUND, METHOD, OURS, PIPELINES
from simbench.reproduce.conditions import READINGS, CellTable, ConditionTable
from simbench.reproduce.sheet import Sheet
from simbench.reproduce.tables import Spread, TprTable
from simbench.reproduce.words import (
    COLUMNS,
    NONE,
    chance,
    chances,
    metres,
    plain_share,
    share,
    signed,
    spread,
)

PARTS = ("surface_to_centre", "reference_lag", "lever_arm", "heading", "wrong_cluster")
ASSUMED = "S1 is taken for overtake-approach, S2 for overtake-recede: the paper does not say which is which."


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
            "ICC: intra-class correlation of pairs within runs; effective n: what N of them are worth "
            "that come from two passes, as the paper's do.",
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
    """Localization."""
    rows = [
        (
            rig.system, f"{printed.mean_m:.2f} ({printed.sd_m:.2f}), {printed.n}",
            spread(rig.mae.drawn, 2), metres(rig.mae.gnss), metres(rig.mae.exact),
            *(metres(rig.exact[name]) for name in (BASELINE, OURS, ORACLE)),
        )
        for rig in table.rigs
        for printed in (rig.mae.printed,)
    ]  # fmt: skip
    return Sheet(
        name=f"mae-{table.condition}", title=f"Mean of MAE X and MAE Y (m); {table.words}",
        columns=(
            "rig", "paper (SD), N", "paper's draw on ours", "P-Fusion, held GNSS", "P-Fusion, exact centre",
            "raw box, exact", "robust, exact", "oracle, exact",
        ),
        rows=tuple(rows),
        notes=("Both scenarios of a rig. Held GNSS: the newest fix of 5 Hz, of the antenna.",),
    )  # fmt: skip


def budget(table: ConditionTable) -> Sheet:
    """What the localization error is made of."""
    rows = []
    for cell in table.cells:
        longitudinal, lateral = (
            {part: of.mean for part, of in cell.budget[axis].items()} for axis in ("longitudinal", "lateral")
        )
        rows.append(
            (
                cell.cell, metres(cell.mae_gnss_m[METHOD]), metres(cell.mae_m[METHOD]),
                *(f"{signed(longitudinal[part])} / {signed(lateral[part])}" for part in PARTS),
            )
        )  # fmt: skip
    return Sheet(
        name=f"budget-{table.condition}",
        title=f"What the error of P-Fusion's positions is made of (m); {table.words}",
        columns=(
            "cell", "MAE, held GNSS", "MAE, exact centre", *(part.replace("_", " ") for part in PARTS),
        ),
        rows=tuple(rows),
        notes=(
            "Parts: signed mean along / across the road of the raw positions against the held 5 Hz GNSS. A "
            "rig sees the target's back in one scenario and its front in the other: the signs turn.",
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
