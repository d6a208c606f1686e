"""The figure of an attribution: a bar for every dividend with its interval, pipelines side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from markupsafe import Markup

from simbench.explain.attribution import Attribution, Effect
from simbench.explain.table import UNIT, shown, words
from simbench.report import palette
from simbench.report.figures import as_svg
from simbench.report.words import pipeline_words

LABEL = 34  # letters of a label on one line


def width(found: Sequence[Attribution]) -> int:
    """Of the figure, in its own units."""
    return 250 + 230 * len(found)


def bars(found: Sequence[Attribution], words: Callable[[str], str] = pipeline_words) -> Markup:
    """One metric. Filled: beyond chance among all dividends at once; the line is that interval (of the total
    its own). To the right: costs; to the left: gains. words: what a pipeline is called."""
    sets = list(dict.fromkeys(e.causes for a in found for e in shown(a)))
    sets.sort(key=lambda causes: (len(causes) or 99, causes))
    has_rest = any(a.remainder is not None for a in found)
    labels = [
        "all causes",
        *(_label(causes) for causes in sets),
        *(["three and more together"] if has_rest else []),
    ]
    metric = found[0].metric
    unit = "" if UNIT[metric] == "1" else f" ({UNIT[metric]})"

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
        for plot, one in zip(plots, found, strict=True):
            by_set = {e.causes: e for e in one.dividends}
            rows = [
                one.total,
                *(by_set.get(causes) for causes in sets),
                *([one.remainder] if has_rest else []),
            ]
            for place, effect in enumerate(rows):
                if effect is not None and effect.summary.mean is not None:
                    _bar(plot, place, effect, of_total=place == 0)
            plot.axvline(0.0, color=palette.INK, lw=0.8)
            plot.axhline(0.5, color=palette.RULE, lw=0.8)
            plot.set_title(words(one.pipeline))
            plot.grid(visible=True, axis="x")
            plot.tick_params(length=0)
            plot.locator_params(axis="x", nbins=5)
        plots[0].set_yticks(range(len(labels)), labels)
        plots[0].set_ylim(len(labels) - 0.4, -0.6)
        figure.supxlabel(f"loss of {metric}{unit}: right costs, left gains", fontsize=10)

    lines = sum(1 + label.count("\n") for label in labels)
    return as_svg(width(found), 70 + 15 * lines, f"What each cause costs of {metric}", draw)


def _bar(plot: Any, place: int, effect: Effect, of_total: bool) -> None:
    mean = effect.summary.mean or 0.0
    colour = palette.WRONG if mean > 0.0 else palette.METHOD
    filled = effect.counts
    edge = colour if filled else palette.CLEAN
    plot.barh(
        place, mean, height=0.62, lw=1.0, edgecolor=palette.INK if of_total else edge,
        color="none" if not filled else palette.CLEAN if of_total else colour,
    )  # fmt: skip
    bounds = effect.together
    if bounds is not None:
        plot.plot(bounds, [place, place], color=palette.INK, lw=1.1)


def _label(causes: tuple[str, ...]) -> str:
    text = words(causes)
    return text if len(text) <= LABEL else " +\n".join(causes)
