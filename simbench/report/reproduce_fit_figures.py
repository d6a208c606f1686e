"""The figures of the fit: where the prior and the posterior lie, and what one cause does alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

from simbench.report import palette
from simbench.report.figures import as_svg, grid
from simbench.report.reproduce_figures import WIDE
from simbench.report.words import pipeline_words
from simbench.reproduce.fit.study import Fit

COLUMNS = 5


def posterior(fit: Fit) -> Markup:
    """Where the prior puts the two cells and where the paper is; and what the fit makes of each level."""
    rows = -(-(len(fit.levels) + 1) // COLUMNS)

    def draw(figure: Any) -> None:
        plots = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
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
    rows = -(-len(fit.levels) // COLUMNS)

    def draw(figure: Any) -> None:
        plots = figure.subplots(rows, COLUMNS, squeeze=False, sharey=True).ravel()
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
