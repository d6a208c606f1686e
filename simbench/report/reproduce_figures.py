"""The figures of the reproduction, from its answer: legible in print, no meaning by colour alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from simbench.case import ORACLE
from simbench.report import palette
from simbench.report.figures import as_svg, grid
from simbench.report.words import pipeline_words
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD, OURS, PIPELINES
from simbench.reproduce.conditions import ConditionTable
from simbench.reproduce.effects import Mended
from simbench.reproduce.elsewhere import Elsewhere
from simbench.reproduce.fit.study import Fit
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

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(table.cells), sharey=True, squeeze=False)[0]
        for plot, cell in zip(plots, table.cells, strict=True):
            for i, (axis, hatch) in enumerate((("longitudinal", ""), ("lateral", "///"))):
                for y, part in enumerate(PARTS):
                    one = cell.budget[axis][part]
                    if one.mean is None:
                        continue
                    place = y + 0.38 * (i - 0.5)
                    plot.barh(
                        place, one.mean, height=0.36, color=palette.METHOD if i == 0 else palette.CLEAN,
                        hatch=hatch, edgecolor="white", lw=0.3,
                        label=axis if y == 0 and plot is plots[0] else None,
                    )  # fmt: skip
                    if one.ci95 is not None:
                        plot.plot(one.ci95, [place, place], color=palette.INK, lw=1.1)
            plot.axvline(0.0, color=palette.INK, lw=0.8)
            plot.set_title(cell.cell)
            plot.set_xlabel("m")
            plot.set_xlim(-2.0, 2.0)
            grid(plot, "x")
        plots[0].set_yticks(range(len(PARTS)), [part.replace("_", " ") for part in PARTS])
        plots[0].set_ylim(len(PARTS) - 0.5, -0.5)
        figure.legend(loc="outside upper center", ncols=2)

    return as_svg(WIDE, 250, f"Error budget, {table.words}", draw)


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

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(cells), sharey=True, sharex=True, squeeze=False)[0]
        for plot, cell in zip(plots, cells, strict=True):
            for y, name in enumerate(names):
                one = next(r for r in mine if r.cell == cell and r.name == name)
                _dot(plot, y, one.differences["tpr"].difference)
            plot.axvline(0.0, color=palette.INK, lw=0.8)
            plot.set_title(cell)
            plot.set_xlabel("difference in TPR")
            grid(plot, "x")
            plot.locator_params(axis="x", nbins=4)
        plots[0].set_yticks(range(len(names)), [label[name] for name in names], fontsize=8)
        plots[0].set_ylim(len(names) - 0.4, -0.6)

    return as_svg(WIDE + 160, 70 + 21 * len(names), "One step or reading changed", draw)


def slope_dots(rows: Sequence[Slopes]) -> Markup:
    """TPR from none of a cause to its bound, the others anywhere within physics: a column a cell."""
    mine = [one for one in rows if one.metric == "tpr"]
    cells, names = (list(dict.fromkeys(getattr(one, k) for one in mine)) for k in ("cell", "pipeline"))
    causes = list(dict.fromkeys(slope.cause for one in mine for slope in one.causes))

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(cells), sharey=True, sharex=True, squeeze=False)[0]
        for plot, cell in zip(plots, cells, strict=True):
            for i, name in enumerate(names):
                one = next(row for row in mine if row.cell == cell and row.pipeline == name)
                for slope in one.causes:
                    y = causes.index(slope.cause) + 0.24 * (i - 1)
                    plot.plot(slope.ci, [y, y], color=COLOURS[name], lw=1.3)
                    plot.plot(
                        [slope.effect], [y], MARKERS[i], color=COLOURS[name], ms=4.5,
                        label=SHORT[name] if slope is one.causes[0] and cell == cells[0] else None,
                    )  # fmt: skip
            plot.axvline(0.0, color=palette.INK, lw=0.8)
            plot.set_title(cell)
            plot.set_xlabel("change of TPR")
            grid(plot, "x")
            plot.locator_params(axis="x", nbins=4)
        plots[0].set_yticks(range(len(causes)), causes, fontsize=8.5)
        plots[0].set_ylim(len(causes) - 0.4, -0.6)
        figure.legend(loc="outside upper center", ncols=len(names))

    return as_svg(WIDE, 100 + 34 * len(causes), "What each cause costs amid the others", draw)


def scene_dots(rows: Sequence[Elsewhere]) -> Markup:
    """TPR of the baselines with one thing changed, a column a cell; the line: what the paper printed."""
    changes = list(dict.fromkeys(one.what for one in rows))

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(CELLS), sharey=True, sharex=True, squeeze=False)[0]
        for plot, cell in zip(plots, CELLS, strict=True):
            for one in (row for row in rows if row.cell == cell.name):
                for i, name in enumerate((BASELINE, GROUND)):
                    mean, y = one.tpr[name].mean, changes.index(one.what) + 0.22 * (2 * i - 1)
                    if mean is None:
                        continue
                    none = one.condition == "none"
                    words = f"{SHORT[name]}, {'no error' if none else 'all at bounds'}"
                    plot.plot(
                        [mean], [y], MARKERS[i], color=COLOURS[name], ms=6,
                        mfc=COLOURS[name] if none else "none",
                        label=words if one.what == changes[0] and cell is CELLS[0] else None,
                    )  # fmt: skip
            label = "paper, baseline" if cell is CELLS[0] else None
            plot.axvline(cell.printed.baseline, color=palette.WRONG, lw=1.4, ls="--", label=label)
            plot.set(title=cell.name, xlim=(0.0, 1.0), xlabel="TPR")
            grid(plot, "x")
        plots[0].set_yticks(range(len(changes)), changes, fontsize=8)
        plots[0].set_ylim(len(changes) - 0.4, -0.6)
        figure.legend(loc="outside upper center", ncols=5)

    return as_svg(WIDE + 160, 110 + 30 * len(changes), "What would have to be different", draw)


def _dot(plot: Any, y: float, difference: Summary) -> None:
    if difference.mean is None:
        return
    colour = {1: palette.RIGHT, -1: palette.WRONG}.get(int(np.sign(difference.mean)), palette.MUTED)
    if difference.ci95 is not None:
        plot.plot(difference.ci95, [y, y], color=palette.INK, lw=1.1)
    else:
        plot.plot(difference.points, [y] * len(difference.points), "|", color=palette.MUTED, ms=6)
    plot.plot([difference.mean], [y], "o", color=colour, ms=5)


def posterior(fit: Fit) -> Markup:
    """Where the prior puts the two cells and where the paper is; and what the fit makes of each level."""
    columns = 5
    rows = -(-(len(fit.levels) + 1) // columns)

    def draw(figure: Any) -> None:
        plots = figure.subplots(rows, columns, squeeze=False).ravel()
        plane = np.array(fit.plane)
        plots[0].plot(plane[:, 0], plane[:, 1], ".", ms=3, color=palette.CLEAN, alpha=0.6)
        plots[0].plot(
            [fit.observed[0]], [fit.observed[1]], "D", ms=8, mfc="none", mew=1.6, color=palette.WRONG
        )
        plots[0].set(xlim=(0, 1), ylim=(0, 1), xlabel=f"TPR, {fit.cells[0]}", ylabel=f"TPR, {fit.cells[1]}")
        plots[0].set_title("prior (dots), paper (◇)")
        samples = np.array(fit.samples)
        for plot, level, column in zip(plots[1:], fit.levels, samples.T, strict=False):
            bins = np.linspace(0.0, level.bound, 13)
            plot.hist(column, bins=bins, color=palette.METHOD, density=True)
            plot.axhline(1.0 / level.bound, color=palette.INK, lw=1.0, ls="--")
            plot.set_title(level.name, fontsize=9.5)
            plot.set_xlabel(level.unit)
            plot.set_yticks([])
        for plot in plots[len(fit.levels) + 1 :]:
            plot.set_axis_off()

    words = f"Posterior of the levels, {fit.system}, {pipeline_words(fit.baseline)}"
    return as_svg(WIDE, 175 * rows, words, draw)


def alone_curves(fit: Fit) -> Markup:
    """The emulated baseline along one cause alone, both cells; dashed: what the paper printed."""
    columns = 5
    rows = -(-len(fit.levels) // columns)

    def draw(figure: Any) -> None:
        plots = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
        for plot, level in zip(plots, fit.levels, strict=False):
            curves = np.array(level.curve)
            for k, (cell, colour) in enumerate(zip(fit.cells, (palette.RAW, palette.METHOD), strict=True)):
                plot.plot(level.level, curves[:, k], color=colour, lw=1.6, marker="os"[k], markevery=5, ms=4,
                          label=cell)  # fmt: skip
                plot.axhline(fit.observed[k], color=colour, lw=1.1, ls="--")
            plot.set_ylim(0.0, 1.0)
            plot.set_title(level.name, fontsize=9.5)
            plot.set_xlabel(level.unit)
            grid(plot)
        for plot in plots[len(fit.levels) :]:
            plot.set_axis_off()
        handles, labels = plots[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2)

    return as_svg(WIDE, 30 + 165 * rows, f"One cause alone, {fit.system}", draw)
