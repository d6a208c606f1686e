"""What the paper could not ask, as tables: steps, other scenes, what to mend, what each cause costs."""

from __future__ import annotations

from simbench.reproduce.answer import Answer
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD
from simbench.reproduce.plan import SCENE_CONDITIONS
from simbench.reproduce.sheet import Sheet
from simbench.reproduce.slopes import Slope
from simbench.reproduce.words import COLUMNS, NONE, bounds, metres, share


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
        notes=("algorithm: robust in place of P-Fusion. MAE: below 0 is better. Every interval by itself.",),
    )  # fmt: skip


def all_slopes(told: Answer) -> Sheet:
    """What each cause costs amid the others."""
    metres_of = {(one.cell, one.pipeline): one.causes for one in told.slopes if one.metric != "tpr"}
    rows = [
        (
            one.cell, COLUMNS[one.pipeline], slope.cause,
            _changed(slope, 100.0, 1),
            _changed(metre, 1.0, 2), str(one.n), f"{one.r2:.2f}",
        )
        for one in told.slopes
        if one.metric == "tpr"
        for slope, metre in zip(one.causes, metres_of[one.cell, one.pipeline], strict=True)
    ]  # fmt: skip
    return Sheet(
        name="slopes",
        title="What each cause changes from none to its bound, the others anywhere within physics",
        columns=("cell", "pipeline", "cause", "TPR (points)", "MAE (m)", "runs", "R2 of TPR"),
        rows=tuple(rows), texts=3,
        notes=(
            "Straight lines through the runs of the fit's design, in which all levels vary at once; the "
            "intervals of a cell and pipeline hold together at 95 %.",
        ),
    )  # fmt: skip


def _changed(one: Slope, scale: float, digits: int) -> str:
    return f"{scale * one.effect:+.{digits}f}{bounds(one.ci, scale, digits, signed=True)}"
