"""Figures of a stress test: a curve along one axis, heat maps over two, clouds where there are more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from simbench.case import ORACLE
from simbench.report import palette
from simbench.report.figures import as_svg, grid
from simbench.report.words import pipeline_words
from simbench.score.metrics import METRICS
from simbench.stress.axes import Axis, Value, shown
from simbench.stress.table import Cell

BETTER = {metric.name: metric.better for metric in METRICS}
UNIT = {metric.name: metric.unit for metric in METRICS}
MOST_WRITTEN = 120  # cells of a heat map in which numbers stand
COLOURS = (palette.RAW, palette.METHOD, palette.RIGHT, palette.OTHER, *palette.OBJECTS[3:])


def colours_of(pipelines: Sequence[str]) -> Mapping[str, str]:
    """One colour a pipeline; the oracle is ink."""
    others = [name for name in pipelines if name != ORACLE]
    return {ORACLE: palette.ORACLE, **{n: COLOURS[i % len(COLOURS)] for i, n in enumerate(others)}}


def figure_of(axes: Sequence[Axis], cells: Sequence[Cell], metric: str, is_grid: bool) -> Markup:
    """One metric over the points, all pipelines side by side."""
    chosen = [cell for cell in cells if cell.metric == metric]
    pipelines = list(dict.fromkeys(cell.pipeline for cell in chosen))
    if len(axes) == 1:
        return _curves(axes[0], chosen, pipelines, metric)
    if len(axes) == 2 and is_grid:
        return _heat_maps(axes, chosen, pipelines, metric)
    return _clouds(axes, chosen, pipelines, metric)


def _curves(axis: Axis, cells: Sequence[Cell], pipelines: Sequence[str], metric: str) -> Markup:
    place = {value: (float(value) if axis.spread else float(i)) for i, value in enumerate(axis.values)}
    colours = colours_of(pipelines)

    def draw(figure: Any) -> None:
        plot = figure.subplots()
        for name in pipelines:
            mine = [cell for cell in cells if cell.pipeline == name and cell.summary.mean is not None]
            x = [_at(cell.point[0], place) for cell in mine]
            style = {"color": colours[name], "ls": "--" if name == ORACLE else "-", "lw": 1.6}
            plot.plot(x, [cell.summary.mean for cell in mine], label=pipeline_words(name), **style)
            for at, cell in zip(x, mine, strict=True):
                points = cell.summary.points
                plot.plot([at] * len(points), points, ".", color=colours[name], ms=3, alpha=0.5)
            sure = [(at, c.summary.ci95) for at, c in zip(x, mine, strict=True) if c.summary.ci95 is not None]
            if sure:
                plot.fill_between(
                    [at for at, _ in sure], [ci[0] for _, ci in sure], [ci[1] for _, ci in sure],
                    color=colours[name], alpha=0.15, lw=0,
                )  # fmt: skip
        if not axis.spread:
            plot.set_xticks(list(place.values()), [shown(value) for value in place])
        plot.set(xlabel=axis.name, ylabel=f"{metric}{_unit(metric)}")
        grid(plot)
        plot.legend()

    return as_svg(520, 300, f"{metric} along {axis.name}", draw)


def _at(value: Value, place: Mapping[Value, float]) -> float:
    return place[value] if value in place else float(value)


def _heat_maps(axes: Sequence[Axis], cells: Sequence[Cell], pipelines: Sequence[str], metric: str) -> Markup:
    across, up = axes
    rows, columns = len(up.values), len(across.values)
    table = {(cell.pipeline, *cell.point): cell.summary.mean for cell in cells}
    maps = {
        name: np.array(
            [[_number(table.get((name, x, y))) for x in across.values] for y in up.values], dtype=float
        )
        for name in pipelines
    }
    everything = np.concatenate([m.ravel() for m in maps.values()])
    known = everything[np.isfinite(everything)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    name_of_map = "viridis" if BETTER[metric] == "higher" else "viridis_r"

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(pipelines), sharey=True, squeeze=False)[0]
        for plot, name in zip(plots, pipelines, strict=True):
            plot.imshow(
                maps[name],
                origin="lower",
                aspect="auto",
                cmap=name_of_map,
                vmin=low,
                vmax=max(high, low + 1e-9),
            )
            plot.set_title(pipeline_words(name))
            plot.set_xticks(range(columns), [shown(v) for v in across.values], rotation=45 * (columns > 6))
            plot.set_yticks(range(rows), [shown(v) for v in up.values])
            plot.tick_params(length=0)
            if rows * columns <= MOST_WRITTEN:
                _write(plot, maps[name], low, high, BETTER[metric] == "higher")
        plots[0].set_ylabel(up.name)
        figure.supxlabel(across.name, fontsize=10)

    return as_svg(
        max(240 * len(pipelines), 420),
        60 + max(26 * rows, 140),
        f"{metric} over {across.name} and {up.name}",
        draw,
    )


def _write(plot: Any, values: np.ndarray, low: float, high: float, higher: bool) -> None:
    for row, column in np.ndindex(*values.shape):
        value = values[row, column]
        share = (value - low) / max(high - low, 1e-9)
        bright = share > 0.55 if higher else share < 0.45
        text = f"{value:.2f}" if np.isfinite(value) else "–"
        plot.text(column, row, text, ha="center", va="center", fontsize=8, color="#000" if bright else "#fff")


def _clouds(axes: Sequence[Axis], cells: Sequence[Cell], pipelines: Sequence[str], metric: str) -> Markup:
    colours = colours_of(pipelines)

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(axes), sharey=True, squeeze=False)[0]
        for number, (plot, axis) in enumerate(zip(plots, axes, strict=True)):
            place = {v: (float(v) if axis.spread else float(i)) for i, v in enumerate(axis.values)}
            for name in pipelines:
                mine = [c for c in cells if c.pipeline == name and c.summary.mean is not None]
                plot.plot(
                    [_at(c.point[number], place) for c in mine], [c.summary.mean for c in mine], ".",
                    color=colours[name], ms=5, label=pipeline_words(name),
                )  # fmt: skip
            plot.set_xlabel(axis.name)
            grid(plot)
        plots[0].set_ylabel(f"{metric}{_unit(metric)}")
        plots[0].legend()

    return as_svg(260 * len(axes) + 120, 260, f"{metric} against each axis", draw)


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def _unit(metric: str) -> str:
    return "" if UNIT[metric] == "1" else f" ({UNIT[metric]})"
