"""Figures of a suite's page: differences with intervals against the margin, and runs old against new."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from simbench.report import palette
from simbench.report.figures import as_svg, grid
from simbench.suite.gate import Gate
from simbench.suite.side import Ran, Side

LOOK = {
    "PASS": (palette.RIGHT, "o"),
    "INCONCLUSIVE": (palette.MUTED, "s"),
    "FAIL": (palette.WRONG, "X"),
    "REGRESSION": (palette.WRONG, "X"),
    "ERROR": (palette.INK, "D"),
}
MOST_LETTERS = 30  # of a line of a title
MOST_DOTS = 200  # of a group
MOST_MARGINS = 6.0  # what lies farther out is drawn at the edge


def forest(gates: Sequence[Gate]) -> Markup:
    """Differences new - old in margins, more is better: 0 is the baseline, -1 what may be lost."""
    shown = [gate for gate in gates if gate.difference is not None and gate.margin]

    def draw(figure: Any) -> None:
        plot = figure.subplots()
        for i, gate in enumerate(shown):
            assert gate.difference is not None and gate.margin
            colour, mark = LOOK[gate.outcome]
            centre = _within(gate.difference / gate.margin)
            if gate.low is not None and gate.high is not None:
                ends = [_within(gate.low / gate.margin), _within(gate.high / gate.margin)]
                plot.plot(ends, [-i, -i], color=colour, lw=2.0, solid_capstyle="round")
            plot.plot([centre], [-i], mark, color=colour, ms=6)
        plot.axvline(0.0, color=palette.INK, lw=0.9)
        plot.axvline(-1.0, color=palette.WRONG, lw=1.2, ls="--")
        plot.set_yticks([-i for i in range(len(shown))], [f"{g.metric}   {g.group}" for g in shown])
        plot.set_ylim(-len(shown) + 0.4, 0.6)
        plot.set_xlim(-MOST_MARGINS - 0.2, MOST_MARGINS + 0.2)
        plot.set_xlabel("new - old in margins, to the right is better; dashed: what may be lost")
        grid(plot, "x")

    return as_svg(980, 70 + 22 * len(shown), "Differences between new and old with their intervals", draw)


def _within(value: float) -> float:
    return max(-MOST_MARGINS, min(MOST_MARGINS, value))


def old_and_new(gates: Sequence[Gate], old: Side | None, new: Side) -> Markup:
    """Every run of some groups: its value old, where there is one, joined by a line to its value new."""

    def draw(figure: Any) -> None:
        plots = figure.subplots(1, len(gates), squeeze=False)[0]
        for plot, gate in zip(plots, gates, strict=True):
            earlier = old.groups.get(gate.group) if old is not None else None
            for seed, run in _some(new.groups[gate.group].runs, gate.metric):
                then = earlier.runs.get(seed) if earlier is not None else None
                _run(plot, then.values.get(gate.metric) if then else None, run.values.get(gate.metric))
            if gate.limit is not None:
                plot.axhline(gate.limit, color=palette.WRONG, lw=1.2, ls="--")
            for x, mean in ((0, gate.old), (1, gate.new)):
                if mean is not None:
                    plot.plot([x - 0.22, x + 0.22], [mean, mean], color=palette.INK, lw=2.0, zorder=3)
            places = (0, 1) if old is not None else (1,)
            plot.set_xlim(places[0] - 0.5, 1.5)
            plot.set_xticks(places, ("old", "new")[-len(places) :])
            unit = f" ({gate.unit})" if gate.unit not in ("", "1") else ""
            plot.set_title(_title(gate), fontsize=7.5, loc="left")
            plot.set_ylabel(f"{gate.metric}{unit}", fontsize=8)
            grid(plot)

    return as_svg(240.0 * len(gates), 300, "Runs of the worst gates, old and new", draw)


def _some(runs: Mapping[str, Ran], metric: str) -> list[tuple[str, Ran]]:
    """All runs, or as many as can be told apart, evenly by value from the least to the greatest."""
    known = [item for item in runs.items() if item[1].values.get(metric) is not None]
    if len(known) <= MOST_DOTS:
        return known
    known.sort(key=lambda item: float(item[1].values[metric] or 0.0))
    return [known[round(i * (len(known) - 1) / (MOST_DOTS - 1))] for i in range(MOST_DOTS)]


def _run(plot: Any, before: float | None, after: float | None) -> None:
    if before is not None and after is not None:
        plot.plot([0, 1], [before, after], color=palette.RULE, lw=0.9, zorder=1)
    for x, value, colour in ((0, before, palette.MUTED), (1, after, palette.METHOD)):
        if value is not None:
            plot.plot([x], [value], "o", color=colour, ms=4, alpha=0.8, zorder=2)


def _title(gate: Gate) -> str:
    """Verdict and group, in lines no longer than a figure is wide."""
    lines = [gate.outcome, *gate.group.split("/", 4)]
    return "\n".join(line if len(line) <= MOST_LETTERS else line[: MOST_LETTERS - 1] + "…" for line in lines)
