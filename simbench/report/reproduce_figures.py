"""The figures of the reproduction, from its answer: legible in print, no meaning by colour alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from simbench.case import ORACLE
from simbench.report import palette
from simbench.report.figures import as_svg, grid
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD, OURS, PIPELINES
from simbench.reproduce.conditions import ConditionTable
from simbench.reproduce.effects import Mended
from simbench.reproduce.elsewhere import Elsewhere
from simbench.reproduce.grids import HeatMap, Strip
from simbench.reproduce.sheets_paper import PARTS
from simbench.reproduce.slopes import Slopes
from simbench.reproduce.steps import Changed
from simbench.score.statistics import Summary

COLOURS = {
    BASELINE: palette.RAW, GROUND: "#E69F00", METHOD: palette.METHOD, OURS: palette.RIGHT,
    ORACLE: palette.ORACLE,
}  # fmt: skip
SHORT = {BASELINE: "raw box", GROUND: "box, no ground", METHOD: "P-Fusion", OURS: "robust", ORACLE: "oracle"}
MARKERS = "osD"
WIDE = 816.0


def tpr_bars(table: ConditionTable) -> Markup:
    """The paper's bars (grey, SD over its frames) beside ours (SD over runs) in every cell."""
    names = (*PIPELINES, ORACLE)

    def draw(figure: Any) -> None:
        plot = figure.subplots()
        step = 1.0 / 9.0
        for at, cell in enumerate(table.cells):
            printed = cell.raw.printed
            rows = [
                (printed.baseline, printed.baseline_sd, "#C4CAD2", "///", "paper, baseline"),
                (printed.fusion, printed.fusion_sd, "#8C95A1", "...", "paper, P-Fusion"),
                *(
                    (cell.pipelines[n].mean, cell.pipelines[n].sd, COLOURS[n], "", f"ours, {SHORT[n]}")
                    for n in names
                ),
            ]
            for i, (mean, sd, colour, hatch, label) in enumerate(rows):
                if mean is None:
                    continue
                x = at + (i - 0.5 * (len(rows) - 1)) * step
                plot.bar(
                    x, mean, width=0.9 * step, color=colour, hatch=hatch, edgecolor="white", lw=0.4,
                    label=label if at == 0 else None,
                )  # fmt: skip
                if sd is not None:
                    top = min(sd, 1.0 - mean)
                    plot.errorbar(
                        x, mean, yerr=[[min(sd, mean)], [top]], color=palette.INK, lw=0.9, capsize=2
                    )
        plot.set_xticks(range(len(table.cells)), [cell.cell for cell in table.cells])
        plot.set(ylim=(0.0, 1.0), ylabel="TPR (mean, SD)")
        plot.axhline(0.5, color=palette.MUTED, lw=0.8, ls=":")
        grid(plot)
        figure.legend(loc="outside upper center", ncols=4)

    return as_svg(WIDE, 300, f"TPR by cell, {table.words}", draw)


def budget_bars(table: ConditionTable) -> Markup:
    """What the error of the method's raw positions is made of, a column a cell: signed means, 95 % over
    runs."""
    by_name = {cell.cell: cell for cell in table.cells}

    def column(plot: Any, cell: str) -> None:
        for i, (axis, hatch) in enumerate((("longitudinal", ""), ("lateral", "///"))):
            for y, part in enumerate(PARTS):
                one = by_name[cell].budget[axis][part]
                if one.mean is None:
                    continue
                place, colour = y + 0.38 * (i - 0.5), palette.METHOD if i == 0 else palette.CLEAN
                plot.barh(
                    place, one.mean, height=0.36, color=colour, hatch=hatch, edgecolor="white", lw=0.3,
                    label=axis,
                )  # fmt: skip
                if one.ci95 is not None:
                    plot.plot(one.ci95, [place, place], color=palette.INK, lw=1.1)
        plot.set_xlim(-2.0, 2.0)

    parts = [part.replace("_", " ") for part in PARTS]
    return _by_cell(WIDE, 250, f"Error budget, {table.words}", list(by_name), parts, "m", column)


def _by_cell(
    width: float,
    height: float,
    title: str,
    cells: Sequence[str],
    rows: Sequence[str],
    what: str,
    column: Callable[[Any, str], None],
) -> Markup:
    """Cells side by side, the same rows in each, about a line at zero; `column` draws one. what: along x."""

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(cells), sharey=True, sharex=True, squeeze=False)[0]
        for plot, cell in zip(plots, cells, strict=True):
            column(plot, cell)
            plot.axvline(0.0, color=palette.INK, lw=0.8)
            plot.set_title(cell)
            plot.set_xlabel(what)
            grid(plot, "x")
            plot.locator_params(axis="x", nbins=4)
        plots[0].set_yticks(range(len(rows)), rows, fontsize=8.5)
        plots[0].set_ylim(len(rows) - 0.4, -0.6)
        handles, labels = plots[0].get_legend_handles_labels()
        if labels:
            once = dict(zip(labels, handles, strict=True))
            figure.legend(once.values(), once.keys(), loc="outside upper center", ncols=5)

    return as_svg(width, height, title, draw)


def heat(maps: Sequence[HeatMap]) -> Markup:
    """Mean TPR over trigger offset and body shake, a row a cell, a column a pipeline."""
    cells = list(dict.fromkeys(one.cell for one in maps))

    def draw(figure: Any) -> None:
        plots = figure.subplots(len(cells), len(PIPELINES), squeeze=False)
        for row, cell in enumerate(cells):
            for column, name in enumerate(PIPELINES):
                one = next(m for m in maps if m.cell == cell and m.pipeline == name)
                plot, values = plots[row][column], np.array(one.tpr, dtype=float)
                shown = plot.imshow(values, origin="lower", vmin=0.0, vmax=1.0, cmap="viridis", aspect="auto")
                for (y, x), value in np.ndenumerate(values):
                    if np.isfinite(value):
                        colour = "white" if value < 0.6 else palette.INK
                        plot.text(x, y, f"{value:.2f}", ha="center", va="center", fontsize=8, color=colour)
                plot.set_xticks(range(len(one.offset_ms)), [f"{v:g}" for v in one.offset_ms])
                plot.set_yticks(range(len(one.shake_deg)), [f"{v:g}" for v in one.shake_deg])
                plot.tick_params(length=0)
                if row == 0:
                    plot.set_title(SHORT[name])
                if row == len(cells) - 1:
                    plot.set_xlabel("trigger offset (ms)")
                if column == 0:
                    plot.set_ylabel(f"{cell}\nbody shake (deg RMS)")
        figure.colorbar(shown, ax=plots, label="TPR", shrink=0.7)

    return as_svg(WIDE, 40 + 200 * len(cells), "TPR over trigger offset and body shake", draw)


def strip_maps(strips: Sequence[Strip], cell: str) -> Markup:
    """Mean TPR under one cause alone, a row a cause, a column a level; a bar where physics ends."""
    mine = [one for one in strips if one.cell == cell]
    causes = list(dict.fromkeys(one.cause for one in mine))

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(PIPELINES), sharey=True, squeeze=False)[0]
        for plot, name in zip(plots, PIPELINES, strict=True):
            rows = [next(s for s in mine if s.cause == c and s.pipeline == name) for c in causes]
            values = np.array([one.tpr for one in rows], dtype=float)
            shown = plot.imshow(values, vmin=0.0, vmax=1.0, cmap="viridis", aspect="auto")
            for (y, x), value in np.ndenumerate(values):
                if np.isfinite(value):
                    colour = "white" if value < 0.6 else palette.INK
                    plot.text(x, y, f"{value:.2f}", ha="center", va="center", fontsize=7.5, color=colour)
            for y, one in enumerate(rows):
                edge = sum(level <= one.bound * (1 + 1e-9) for level in one.level) - 0.5
                plot.plot([edge, edge], [y - 0.5, y + 0.5], color=palette.WRONG, lw=2.2)
            plot.set_title(SHORT[name])
            plot.set_xticks([])
            plot.tick_params(length=0)
        labels = [
            f"{c}: {', '.join(f'{v:.3g}' for v in next(s for s in mine if s.cause == c).level)} "
            f"{next(s for s in mine if s.cause == c).unit}"
            for c in causes
        ]
        plots[0].set_yticks(range(len(causes)), labels, fontsize=8)
        figure.colorbar(shown, ax=plots, label="TPR", shrink=0.7)

    return as_svg(WIDE + 120, 60 + 26 * len(causes), f"TPR under one cause alone, {cell}", draw)


def mended_bars(rows: Sequence[Mended]) -> Markup:
    """What mending one thing gives back, in TPR and in metres, a column a cell."""
    cells = list(dict.fromkeys(one.cell for one in rows))
    things = list(dict.fromkeys(one.what for one in rows))

    def draw(figure: Any) -> None:
        plots = figure.subplots(2, len(cells), sharey=True, squeeze=False, sharex="row")
        for column, cell in enumerate(cells):
            mine = {one.what: one for one in rows if one.cell == cell}
            for row, (what, sign) in enumerate((("tpr", 1.0), ("mae_m", -1.0))):
                plot = plots[row][column]
                for y, thing in enumerate(things):
                    difference = getattr(mine[thing], what).difference
                    if difference.mean is None:
                        continue
                    gain = sign * difference.mean
                    plot.barh(y, gain, height=0.6, color=palette.RIGHT if gain > 0 else palette.WRONG)
                    points = [sign * point for point in difference.points]
                    plot.plot(points, [y] * len(points), "|", color=palette.INK, ms=7)
                plot.axvline(0.0, color=palette.INK, lw=0.8)
                plot.set_yticks(range(len(things)), things)
                plot.invert_yaxis() if column == 0 and not plot.yaxis_inverted() else None
                grid(plot, "x")
                plot.locator_params(axis="x", nbins=4)
                if row == 0:
                    plot.set_title(cell)
                plot.set_xlabel("gain in TPR" if row == 0 else "gain in MAE (m)")

    return as_svg(WIDE, 380, "What mending one thing gives back", draw)


def step_dots(rows: Sequence[Changed]) -> Markup:
    """TPR of each variant minus that of the method as it is, a column a cell, 95 % over runs."""
    mine = [one for one in rows if "tpr" in one.differences]
    cells, names = (list(dict.fromkeys(getattr(r, k) for r in mine)) for k in ("cell", "name"))
    label = {one.name: f"{one.step or '–'} {one.title}: {one.what}" for one in mine}

    def column(plot: Any, cell: str) -> None:
        for one in mine:
            if one.cell == cell:
                _dot(plot, names.index(one.name), one.differences["tpr"].difference)

    return _by_cell(
        WIDE + 160, 70 + 21 * len(names), "One step or reading changed", cells,
        [label[name] for name in names], "difference in TPR", column,
    )  # fmt: skip


def slope_dots(rows: Sequence[Slopes]) -> Markup:
    """TPR from none of a cause to its bound, the others anywhere within physics: a column a cell."""
    mine = [one for one in rows if one.metric == "tpr"]
    cells, names = (list(dict.fromkeys(getattr(one, k) for one in mine)) for k in ("cell", "pipeline"))
    causes = list(dict.fromkeys(slope.cause for one in mine for slope in one.causes))

    def column(plot: Any, cell: str) -> None:
        for one in (row for row in mine if row.cell == cell):
            i, colour = names.index(one.pipeline), COLOURS[one.pipeline]
            for slope in one.causes:
                y = causes.index(slope.cause) + 0.24 * (i - 1)
                plot.plot(slope.ci, [y, y], color=colour, lw=1.3)
                plot.plot([slope.effect], [y], MARKERS[i], color=colour, ms=4.5, label=SHORT[one.pipeline])

    return _by_cell(
        WIDE, 100 + 34 * len(causes), "What each cause costs amid the others", cells, causes,
        "change of TPR", column,
    )  # fmt: skip


def scene_dots(rows: Sequence[Elsewhere]) -> Markup:
    """TPR of the baselines with one thing changed, a column a cell; the line: what the paper printed."""
    changes = list(dict.fromkeys(one.what for one in rows))
    printed = {cell.name: cell.printed.baseline for cell in CELLS}

    def column(plot: Any, cell: str) -> None:
        for one in (row for row in rows if row.cell == cell):
            words = "no error" if one.condition == "none" else "all at bounds"
            for i, name in enumerate((BASELINE, GROUND)):
                mean, y, colour = (
                    one.tpr[name].mean,
                    changes.index(one.what) + 0.22 * (2 * i - 1),
                    COLOURS[name],
                )
                if mean is not None:
                    filled = colour if one.condition == "none" else "none"
                    plot.plot(
                        [mean],
                        [y],
                        MARKERS[i],
                        color=colour,
                        ms=6,
                        mfc=filled,
                        label=f"{SHORT[name]}, {words}",
                    )
        plot.axvline(printed[cell], color=palette.WRONG, lw=1.4, ls="--", label="paper, baseline")
        plot.set_xlim(0.0, 1.0)

    return _by_cell(
        WIDE + 160, 110 + 30 * len(changes), "What would have to be different", list(printed), changes,
        "TPR", column,
    )  # fmt: skip


def _dot(plot: Any, y: float, difference: Summary) -> None:
    if difference.mean is None:
        return
    colour = {1: palette.RIGHT, -1: palette.WRONG}.get(int(np.sign(difference.mean)), palette.MUTED)
    if difference.ci95 is not None:
        plot.plot(difference.ci95, [y, y], color=palette.INK, lw=1.1)
    else:
        plot.plot(difference.points, [y] * len(difference.points), "|", color=palette.MUTED, ms=6)
    plot.plot([difference.mean], [y], "o", color=colour, ms=5)
