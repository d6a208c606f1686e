"""The strip of a frontier: the curve with its band, what was measured, the limit, bound and estimate."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64
from markupsafe import Markup
from scipy.special import betaincinv, expit, logit, ndtr, ndtri

from simbench.frontier.curve import GRID
from simbench.frontier.requirements import Requirement
from simbench.report import palette
from simbench.report.figures import as_svg, grid


def strip(item: Requirement) -> Markup:
    """One pipeline along one axis. Shares: dots are shares of runs; means: dots are runs."""
    answer, curve, error = item.found.answer, item.found.curve, item.found.curve.error
    low, high = item.axis.ends
    place = low + GRID * (high - low)
    at = low + item.found.levels * (high - low)

    def draw(figure: Any) -> None:
        plot = figure.subplots()
        if answer.factors is not None:
            below, above = _within_counts(
                item, *(shown(item, curve.margin - factor * error) for factor in answer.factors)
            )
            plot.fill_between(place, below, above, color=palette.METHOD, alpha=0.15, lw=0)
        plot.plot(place, shown(item, curve.margin), color=palette.METHOD, lw=1.6)
        if item.goal.functional == "mean":
            values = shown(item, item.found.margins)
            plot.plot(
                np.repeat(at, values.shape[1]), values.ravel(), ".", color=palette.MUTED, ms=3, alpha=0.5
            )
        plot.plot(at, dots(item), "o", color=palette.METHOD, ms=4)
        line = float(shown(item, np.zeros(1))[0])
        plot.axhline(line, color=palette.WRONG, lw=1.2, ls="--")
        if answer.safe_to is not None:
            plot.axvspan(low, low + answer.safe_to * (high - low), color=palette.RIGHT, alpha=0.10, lw=0)
            plot.axvline(low + answer.safe_to * (high - low), color=palette.RIGHT, lw=1.6)
        if answer.best is not None:
            plot.axvline(low + answer.best * (high - low), color=palette.INK, lw=1.0, ls=":")
        unit = f" ({item.unit})" if item.unit else ""
        metric = item.question.limits[0].metric
        label = "share of runs" if item.goal.functional == "share" else metric.name
        plot.set(xlabel=f"{item.axis.name}{unit}", ylabel=label, xlim=(low, high))
        if item.goal.functional == "share":
            plot.set_ylim(-0.03, 1.05)
        grid(plot)

    return as_svg(560, 210, item.sentence, draw)


def _within_counts(
    item: Requirement, below: Float64[np.ndarray, " m"], above: Float64[np.ndarray, " m"]
) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
    """A band of shares no wider than what was counted at the levels says by itself (Clopper-Pearson, 95 %):
    where all runs keep a limit, the band of the curve alone is far too wide."""
    if item.goal.functional == "mean":
        return below, above
    met = (item.found.margins >= 0.0).sum(axis=1).astype(np.float64)
    n = item.found.margins.shape[1]
    least = np.where(met > 0, betaincinv(np.maximum(met, 1.0), n - met + 1.0, 0.025), 0.0)
    most = np.where(met < n, betaincinv(met + 1.0, np.maximum(n - met, 1.0), 0.975), 1.0)
    return (
        np.maximum(below, np.interp(GRID, item.found.levels, least)),
        np.minimum(above, np.interp(GRID, item.found.levels, most)),
    )


def shown(item: Requirement, margin: Float64[np.ndarray, "*m"]) -> Float64[np.ndarray, "*m"]:
    """A margin as what is drawn: a share, or the metric's own value."""
    least = item.goal.share
    if item.goal.functional == "share":
        if item.goal.monotone:
            return np.asarray(expit(margin + logit(least)))
        return np.asarray(ndtr(margin + ndtri(least)))
    limit = item.question.limits[0]
    return limit.value + margin if limit.metric.better == "higher" else limit.value - margin


def dots(item: Requirement) -> Float64[np.ndarray, " k"]:
    """What was measured at every level."""
    values = item.measured()
    return values if item.goal.functional == "share" else shown(item, values)
