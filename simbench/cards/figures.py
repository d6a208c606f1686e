"""Figures of a card: simulated sightings as small dots, recorded ones as large open diamonds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from simbench.cards.statistics import Sight
from simbench.report import palette
from simbench.report.figures import as_svg, grid

CATEGORIES = ("rider", "car", "pedestrian")
COLOUR: Mapping[str, str] = dict(zip(CATEGORIES, palette.OBJECTS, strict=False))
MOST_DOTS = 1500  # a category and panel
WIDE, HIGH = 400.0, 250.0


def histograms(ours: Sequence[Sight]) -> tuple[Markup, ...]:
    """How far, how fast, how visible, how many points: shares of the sightings of each category."""
    return (
        _histogram(ours, "range_m", "range (m)", np.arange(0.0, 82.0, 4.0)),
        _histogram(ours, "points", "points on it in a sweep", np.geomspace(1.0, 10_000.0, 21), log=True),
        _histogram(ours, "visible", "visible share in the best camera", np.linspace(0.0, 1.0, 11)),
        _histogram(ours, "speed_mps", "speed over ground (m/s)", np.arange(0.0, 16.0, 0.75)),
    )


def comparisons(ours: Sequence[Sight], theirs: Sequence[Sight]) -> tuple[Markup, ...]:
    """What depends on range, of both."""
    asked = (
        ("points", "points on it", True),
        ("height_px", "height of its box (px)", True),
        ("noise_m", "range noise (m, 1 SD)", True),
        ("intensity", "median intensity", False),
        ("shift_px", "points' centre right of the box's (px)", False),
    )
    return tuple(_over_range(ours, theirs, name, words, log) for name, words, log in asked)


def _histogram(
    rows: Sequence[Sight], name: str, words: str, bins: np.ndarray, *, log: bool = False
) -> Markup:
    def draw(figure: Any) -> None:
        axes = figure.subplots()
        for category in CATEGORIES:
            values = _column([row for row in rows if row.category == category], name)
            if not len(values):
                continue
            weights = np.full(len(values), 100.0 / len(values))
            axes.hist(
                np.clip(values, bins[0], bins[-1]), bins=bins, weights=weights, histtype="step", lw=1.6,
                color=COLOUR[category], label=f"{category} ({len(values)})",
            )  # fmt: skip
        if log:
            axes.set_xscale("log")
        axes.set(xlabel=words, ylabel="share of sightings (%)")
        grid(axes)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="best")

    return as_svg(WIDE, HIGH, f"histogram of {words}", draw)


def _over_range(ours: Sequence[Sight], theirs: Sequence[Sight], name: str, words: str, log: bool) -> Markup:
    def draw(figure: Any) -> None:
        axes = figure.subplots()
        for category in CATEGORIES:
            for rows, style in (
                (ours, {"marker": ".", "ms": 2.5, "alpha": 0.5}),
                (theirs, {"marker": "D", "ms": 7.0, "mfc": "none", "mew": 1.8}),
            ):
                mine = [row for row in rows if row.category == category]
                mine = mine[:: 1 + len(mine) // MOST_DOTS]
                x, y = _column(mine, "range_m", finite=False), _column(mine, name, finite=False)
                good = np.isfinite(y) & ((y > 0.0) if log else np.isfinite(y))
                label = category if rows is ours else f"{category}, recorded"
                if good.any():
                    axes.plot(x[good], y[good], ls="none", color=COLOUR[category], label=label, **style)
        if log:
            axes.set_yscale("log")
        else:
            axes.set_ylim(*_window(ours, theirs, name))
        axes.set(xlabel="range (m)", ylabel=words, xlim=(0.0, 80.0))
        grid(axes)
        handles, labels = axes.get_legend_handles_labels()
        if handles:
            axes.legend(handles, labels, loc="best", fontsize=7.5)

    return as_svg(WIDE, HIGH + 30.0, f"{words} over range", draw)


def _window(ours: Sequence[Sight], theirs: Sequence[Sight], name: str) -> tuple[float, float]:
    """What holds 98 in 100 simulated values and all recorded ones, with a margin."""
    mine, others = _column(ours, name), _column(theirs, name)
    ends = np.concatenate([np.percentile(mine, [1.0, 99.0]) if len(mine) else mine, others])
    if not len(ends):
        return 0.0, 1.0
    margin = 0.08 * float(np.ptp(ends)) + 1e-3
    return float(ends.min()) - margin, float(ends.max()) + margin


def _column(rows: Sequence[Sight], name: str, *, finite: bool = True) -> np.ndarray:
    values = np.array([getattr(row, name) for row in rows], dtype=np.float64)
    found: np.ndarray = values[np.isfinite(values)] if finite else values
    return found
