"""The figures, as inline SVG for a column of about 400 px. matplotlib is imported with the first one.

Text stays text (the page's font), ids are salted by content, no date: same numbers, same bytes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from markupsafe import Markup

from fusion.explain import AoiExplanation
from simbench.case import JobResult
from simbench.paper import TABLE_II
from simbench.report import palette
from simbench.report.choose import (
    ORACLE,
    Group,
    Run,
    case_of,
    mean_of_runs,
    pairs_of,
    value_of,
)
from simbench.report.words import percent, pipeline_words, signed_m
from simbench.score.budget import PARTS
from simbench.score.localization import Fix, FrameScore

COLUMN = 400.0  # user units
PAD, GAP = 4 / 72, 0.04  # inches; share of a subplot
STYLE: Mapping[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "simbench",
    "font.family": ["DejaVu Sans"],
    "font.size": 10,
    "axes.edgecolor": palette.MUTED,
    "axes.labelcolor": palette.INK,
    "axes.labelsize": 10,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.grid": False,
    "grid.color": palette.RULE,
    "grid.linewidth": 0.7,
    "xtick.color": palette.MUTED,
    "ytick.color": palette.MUTED,
    "xtick.labelcolor": palette.INK,
    "ytick.labelcolor": palette.INK,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "text.color": palette.INK,
    "legend.frameon": False,
    "legend.fontsize": 9.5,
    "lines.solid_capstyle": "round",
}
BUDGET_WORDS: Mapping[str, str] = {
    "surface_to_centre": "surface to centre",
    "reference_lag": "reference lag",
    "lever_arm": "lever arm",
    "heading": "heading",
    "reference_noise": "GNSS noise",
    "sensor_attitude": "sensor attitude",
    "wrong_cluster": "wrong cluster",
    "rest": "rest",
    "total": "total",
}


def _style() -> AbstractContextManager[None]:
    import matplotlib

    return matplotlib.rc_context(dict(STYLE))  # type: ignore[arg-type]


def as_svg(width: float, height: float, label: str, draw: Callable[[Any], None]) -> Markup:
    """A figure of width x height user units as inline SVG."""
    with _style():
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure
        from matplotlib.layout_engine import ConstrainedLayoutEngine

        figure = Figure(
            figsize=(width / 72, height / 72),
            layout=ConstrainedLayoutEngine(w_pad=PAD, h_pad=PAD, wspace=GAP, hspace=GAP),
        )
        FigureCanvasSVG(figure)
        draw(figure)
        text = io.StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return inline(text.getvalue(), label)


def inline(svg: str, label: str) -> Markup:
    """A matplotlib SVG without what a page needs not: declarations, metadata, namespaces, ids of groups."""
    body = svg[svg.index("<svg") :]
    head, _, rest = body.partition(">")
    box = re.search(r'viewBox="([^"]*)"', head)
    if box is None:
        raise ValueError("an SVG without viewBox")
    rest = re.sub(r"<metadata>.*?</metadata>", "", rest, flags=re.DOTALL)
    rest = re.sub(r'<g id="[^"]*"', "<g", rest)
    rest = re.sub(r"<!--.*?-->", "", rest, flags=re.DOTALL)
    rest = re.sub(r"\n\s*", "\n", rest)
    opening = Markup('<svg class="plot" viewBox="{}" role="img" aria-label="{}">').format(box[1], label)
    return opening + Markup(rest.strip())


def grid(axes: Any, which: str = "y") -> None:
    axes.grid(visible=True, axis=which)
    axes.tick_params(length=0)


# -- paired dots ----------------------------------------------------------------------------------------


def paired_dots(groups: Sequence[Group]) -> Markup:
    """TPR of baseline and method, a line per run; hollow diamonds: the paper; dashed: the oracle."""
    columns = min(len(groups), 4)
    rows = -(-len(groups) // columns)

    def draw(figure: Any) -> None:
        axes = figure.subplots(rows, columns, sharey=True, squeeze=False)
        for cell, group in zip(axes.flat, groups, strict=False):
            _one_pairing(cell, group)
        for cell in axes.flat[len(groups) :]:
            cell.set_visible(False)
        for row in axes:
            row[0].set_ylabel("TPR (%)")
        _pairing_legend(figure, groups)

    return as_svg(COLUMN, 164.0 + 212.0 * rows, "TPR per run, from baseline to method", draw)


def _one_pairing(axes: Any, group: Group) -> None:
    grid(axes)
    axes.set_ylim(-4, 104)
    axes.set_yticks([0, 20, 40, 60, 80, 100])
    axes.set_xlim(-0.45, 1.45)
    names = [group.baseline] + ([group.method] if group.method else [])
    axes.set_xticks(range(len(names)), [pipeline_words(name, short=True) for name in names])
    axes.set_title(f"{group.system},\n{short_scenario(group.scenario)}", fontsize=9.5)
    for side, shift in (("clean", -0.07), ("faulted", 0.07)):
        for _, result in group.results(side):
            values = [value_of(result, name, "tpr") for name in names]
            known = [(x + shift, 100.0 * v) for x, v in enumerate(values) if v is not None]
            colour = palette.CLEAN if side == "clean" else palette.METHOD
            axes.plot(*zip(*known, strict=True), color=colour, lw=1.2, alpha=0.75) if known else None
            for x, y in known:
                fill = colour if side == "clean" or x > 0.5 else palette.RAW
                axes.plot(x, y, "o", ms=6.5, mfc=fill, mec="white", mew=0.8, zorder=3)
    ceiling = mean_of_runs(group, group.main_side, ORACLE, "tpr")
    if ceiling is not None:
        axes.axhline(100.0 * ceiling, ls=(0, (4, 3)), lw=1.1, color=palette.ORACLE)
    printed = TABLE_II.get((group.scenario, group.system))
    if printed is not None:
        both = [100 * printed.baseline, 100 * printed.fusion][: len(names)]
        axes.plot(range(len(both)), both, ":", lw=1.0, color=palette.OTHER)
        axes.plot(range(len(both)), both, "D", ms=7, mfc="white", mec=palette.OTHER, mew=1.4, zorder=4)


def _pairing_legend(figure: Any, groups: Sequence[Group]) -> None:
    from matplotlib.lines import Line2D

    sides = {side for group in groups for side in group.sides}
    entries = []
    dot: dict[str, Any] = {"marker": "o", "ls": "", "mec": "white", "ms": 7}
    if "clean" in sides:
        entries.append(Line2D([], [], color=palette.CLEAN, label="no error", **dot))
    if "faulted" in sides:
        entries.append(Line2D([], [], color=palette.RAW, label="error, baseline", **dot))
        entries.append(Line2D([], [], color=palette.METHOD, label="error, method", **dot))
    if any((g.scenario, g.system) in TABLE_II for g in groups):
        entries.append(
            Line2D(
                [],
                [],
                marker="D",
                ls=":",
                mfc="white",
                mec=palette.OTHER,
                color=palette.OTHER,
                ms=7,
                label="paper (S1, S2 assumed)",
            )
        )
    entries.append(
        Line2D([], [], ls=(0, (4, 3)), color=palette.ORACLE, lw=1.1, label="oracle: all true points")
    )
    figure.legend(handles=entries, loc="outside lower center", ncols=2, handletextpad=0.5, columnspacing=1.2)


def short_scenario(name: str) -> str:
    return name.removeprefix("overtake-") if len(name) > 12 else name


# -- where the target was said to be --------------------------------------------------------------------


def birds_eye(result: JobResult, pipeline: str, like: Sequence[str]) -> Markup | None:
    """Truth, raw and smooth positions of one run from above, ego frame. None where nothing was scored.

    `like`: the pipelines whose figures must have the same axes. Raw positions beyond them are counted.
    """
    case = case_of(result, pipeline)
    if case is None or case.scores is None or not case.scores.frames:
        return None
    frames = case.scores.frames
    truth = np.array([f.true_centre_ego_m for f in frames])
    x_range, y_range = _ranges(result, like, truth)

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        grid(axes, "both")
        _true_paths(axes, frames)
        lost = 0
        stages: list[tuple[str, dict[str, Any]]] = [
            ("raw", {"marker": "o", "ls": "", "ms": 3.6, "mec": "none", "alpha": 0.75})
        ]
        if len({f.scan_seq for f in frames}) > 1:  # of one scan there is no trajectory
            stages.append(("smooth", {"ls": "-", "lw": 1.6}))
        for stage, style in stages:
            fixes = [f.raw if stage == "raw" else f.smooth for f in frames]
            known = np.array([f.position_ego_m[:2] for f in fixes if f is not None]).reshape(-1, 2)
            colour = palette.RAW if stage == "raw" else palette.METHOD
            for xy, label in _by_target(frames, fixes, f"{stage} ({len(known)})"):
                axes.plot(xy[:, 0], xy[:, 1], color=colour, label=label, zorder=2, **style)
            if stage == "raw":
                lost = int((~_within(known, x_range, y_range)).sum())
        axes.set_xlim(*x_range)
        axes.set_ylim(*y_range)
        axes.set_xlabel("longitudinal (m, ego frame)")
        axes.set_ylabel("lateral (m)")
        figure.legend(loc="outside upper center", ncols=3, handletextpad=0.5, columnspacing=1.4)
        if not any(f.raw is not None for f in frames):
            axes.annotate("no position", (0.5, 0.2), xycoords="axes fraction", ha="center", color=palette.RAW)
        if lost:
            axes.annotate(
                f"{lost} raw outside",
                (0.99, 0.04),
                xycoords="axes fraction",
                ha="right",
                fontsize=9,
                color=palette.RAW,
            )

    return as_svg(COLUMN, 168.0, f"Bird's-eye view of {pipeline_words(pipeline)}", draw)


def _true_paths(axes: Any, frames: Sequence[FrameScore]) -> None:
    """Where the target truly was: a line per target, a dot for one that is seen once."""
    for number, target in enumerate(dict.fromkeys(f.target for f in frames)):
        path = np.array([f.true_centre_ego_m for f in frames if f.target == target])
        style = {"ls": "-", "lw": 5} if len(path) > 1 else {"ls": "", "marker": "o", "ms": 9}
        axes.plot(
            path[:, 0], path[:, 1], color=palette.RULE, label="_" if number else "truth", zorder=1, **style
        )


def _by_target(
    frames: Sequence[FrameScore], fixes: Sequence[Fix | None], label: str
) -> Iterator[tuple[np.ndarray, str]]:
    """Positions [n 2] of each target, the first with a label for the legend."""
    for number, target in enumerate(dict.fromkeys(f.target for f in frames)):
        its = [x.position_ego_m[:2] for f, x in zip(frames, fixes, strict=True) if x and f.target == target]
        yield np.array(its).reshape(-1, 2), "_" if number else label


def _within(xy: np.ndarray, x: tuple[float, float], y: tuple[float, float]) -> np.ndarray:
    return np.asarray((xy[:, 0] >= x[0]) & (xy[:, 0] <= x[1]) & (xy[:, 1] >= y[0]) & (xy[:, 1] <= y[1]))


def _ranges(
    result: JobResult, pipelines: Sequence[str], truth: np.ndarray
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits that hold the truth and 95 % of the raw errors of all pipelines."""
    off = [
        np.abs(np.subtract(f.raw.position_ego_m, f.raw.centre_ego_m)[:2])
        for p in pipelines
        if (case := case_of(result, p)) is not None and case.scores is not None
        for f in case.scores.frames
        if f.raw is not None
    ]
    reach = np.percentile(np.array(off), 95, axis=0) if off else np.zeros(2)
    pad = np.maximum(1.15 * reach, (1.5, 1.0))
    low, high = truth[:, :2].min(axis=0) - pad, truth[:, :2].max(axis=0) + pad
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))


def budget_means(results: Sequence[tuple[int, JobResult]], pipeline: str) -> dict[str, np.ndarray]:
    """Signed mean [runs 2] (longitudinal, lateral) per part and 'total', metres; of runs that have one."""
    rows: dict[str, list[np.ndarray]] = {part: [] for part in (*PARTS, "total")}
    for _, result in results:
        case = case_of(result, pipeline)
        budget = None if case is None or case.scores is None else case.scores.budget
        if budget is not None and budget.frames:
            for part, found in rows.items():
                found.append(budget.mean_m(part)[:2])
    return {part: np.array(found).reshape(-1, 2) for part, found in rows.items()}


def budget_bars(
    results: Sequence[tuple[int, JobResult]], pipeline: str, like: Sequence[str]
) -> Markup | None:
    """Signed error budget of the raw positions against the held GNSS: mean over runs, a tick per run."""
    means = budget_means(results, pipeline)
    if not len(means["total"]):
        return None
    every = np.concatenate([v for p in like for v in budget_means(results, p).values()])
    reach = max(0.05, 1.08 * float(np.abs(every).max()))
    parts = list(means)

    def draw(figure: Any) -> None:
        axes = figure.subplots(1, 2, sharey=True)
        rows = np.arange(len(parts))
        for axis, (cell, name) in enumerate(zip(axes, ("longitudinal", "lateral"), strict=True)):
            grid(cell, "x")
            values = np.array([means[p][:, axis].mean() for p in parts])
            colours = [palette.INK if p == "total" else palette.METHOD for p in parts]
            cell.barh(rows, values, height=0.62, color=colours, alpha=0.85)
            for row, part in zip(rows, parts, strict=True):
                cell.plot(
                    means[part][:, axis],
                    np.full(len(means[part]), row),
                    "|",
                    ms=8,
                    mew=1.1,
                    color=palette.AOI if part == "total" else palette.INK,
                )
            cell.axvline(0, color=palette.MUTED, lw=0.8)
            cell.axhline(len(parts) - 1.5, color=palette.RULE, lw=0.8)
            cell.set_xlim(-reach, reach)
            cell.set_title(f"{name} {signed_m(float(values[-1]))}", fontsize=9.5, fontweight="normal")
            cell.set_xlabel("mean error (m)")
            cell.spines["left"].set_visible(False)
        axes[0].set_yticks(rows, [BUDGET_WORDS[p] for p in parts])
        axes[0].invert_yaxis()

    return as_svg(COLUMN, 212.0, f"Signed error budget of {pipeline_words(pipeline)}", draw)


# -- over frames, and inside one frame ------------------------------------------------------------------


def tpr_over_frames(group: Group, run: Run) -> Markup | None:
    """TPR of each scan (mean over its pairs) against time, one run. None where nothing was scored, or where a
    recording is one scan only."""
    wanted = [
        ("faulted", group.baseline, palette.RAW, "-"),
        ("faulted", group.method, palette.METHOD, "-"),
        ("clean", group.baseline, palette.CLEAN, ":"),
        ("clean", group.method, palette.CLEAN, "-"),
    ]
    curves = []
    for side, pipeline, colour, line in wanted:
        found: dict[int, list[float]] = {}
        for pair in pairs_of(run.side(side), pipeline).values():
            found.setdefault(pair.scan_stamp_ns, []).append(pair.tpr)
        if found and pipeline is not None:
            at = sorted(found)
            share = [100.0 * float(np.mean(found[t])) for t in at]
            words = f"{'error' if side == 'faulted' else 'no error'}, {pipeline_words(pipeline, short=True)}"
            curves.append((np.array(at) * 1e-9, share, colour, line, words))
    if not curves or all(len(t) < 2 for t, *_ in curves):
        return None

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        grid(axes)
        for t, share, colour, line, words in reversed(curves):
            axes.plot(t, share, line, color=colour, lw=1.4, marker="o", ms=2.6, label=words)
        axes.set_ylim(-4, 104)
        axes.set_xlabel("time of the scan (s)")
        axes.set_ylabel("TPR (%)")
        figure.legend(loc="outside upper center", ncols=2, handletextpad=0.5, columnspacing=1.4)

    return as_svg(COLUMN, 250.0, f"TPR over frames, seed {run.seed}", draw)


def distance_modes(found: AoiExplanation, surface_m: float | None) -> Markup:
    """The histogram of distances in the AOI after ground removal, its candidates, and the chosen one."""
    histogram = found.histogram
    candidates = np.flatnonzero(histogram.is_candidate)
    chosen = None if found.chosen is None else int(candidates[found.chosen])

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        grid(axes)
        if len(histogram.counts):
            colours = [
                palette.METHOD
                if b == chosen
                else palette.OUTSIDE
                if histogram.is_candidate[b]
                else palette.RULE
                for b in range(len(histogram.counts))
            ]
            axes.bar(
                histogram.edges_m[:-1],
                histogram.counts,
                width=np.diff(histogram.edges_m),
                align="edge",
                color=colours,
                edgecolor="white",
                lw=0.6,
            )
            for number, b in enumerate(candidates):
                middle = 0.5 * (histogram.edges_m[b] + histogram.edges_m[b + 1])
                axes.annotate(
                    chr(ord("A") + number),
                    (middle, histogram.counts[b]),
                    ha="center",
                    va="bottom",
                    xytext=(0, 1),
                    textcoords="offset points",
                    fontweight="bold",
                    zorder=5,
                    bbox={"fc": "white", "ec": "none", "pad": 1.0},
                )
            axes.set_ylim(0, 1.18 * histogram.counts.max())
        if surface_m is not None:
            axes.axvline(surface_m, color=palette.INK, lw=1.1, ls=(0, (4, 3)))
        axes.set_xlabel("planar distance from the LiDAR (m)")
        axes.set_ylabel("points in the AOI")
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        entries: list[Any] = [
            Patch(color=palette.METHOD, label="chosen"),
            Patch(color=palette.OUTSIDE, label="other modes"),
        ]
        if surface_m is not None:
            entries.append(Line2D([], [], color=palette.INK, lw=1.1, ls=(0, (4, 3)), label="true surface"))
        figure.legend(
            handles=entries, loc="outside upper center", ncols=3, handletextpad=0.5, columnspacing=1.4
        )

    return as_svg(COLUMN, 250.0, "Histogram of distances", draw)


MOST_CANDIDATES = 3


def descriptors(found: AoiExplanation) -> Markup:
    """S* and the 3x3 descriptors of the candidates before and after rotation, with their similarity."""
    listed = list(range(len(found.candidates)))
    if found.chosen is not None and found.chosen >= MOST_CANDIDATES:
        listed = [*listed[: MOST_CANDIDATES - 1], found.chosen]
    listed = listed[:MOST_CANDIDATES]

    def draw(figure: Any) -> None:
        axes = figure.subplots(2, 1 + MOST_CANDIDATES, squeeze=False)
        for cell in axes.flat:
            cell.set_axis_off()
        _cells(axes[0, 0], found.benchmark, "S*", chosen=False)
        for column, number in enumerate(listed, start=1):
            candidate, letter = found.candidates[number], chr(ord("A") + number)
            before = found.similarity_before(candidate)
            chosen = number == found.chosen
            _cells(axes[0, column], candidate.descriptor_before, f"{letter}: s = {before:.2f}", chosen=False)
            turned = np.rad2deg(candidate.rotation_rad)
            _cells(
                axes[1, column],
                candidate.descriptor,
                f"{turned:+.0f}°: s = {candidate.similarity:.2f}",
                chosen=chosen,
            )
        axes[1, 0].text(0.5, 0.5, "after\nrotation", ha="center", va="center", color=palette.MUTED)
        if len(listed) < 2:
            words = "one candidate:\nthe shape decides nothing" if listed else "no candidate"
            axes[0, -2].text(1.1, 0.5, words, ha="center", va="center", color=palette.MUTED)

    return as_svg(COLUMN, 250.0, "Shape descriptors", draw)


def _cells(axes: Any, shares: np.ndarray, title: str, chosen: bool) -> None:
    from matplotlib.patches import Rectangle

    axes.set_axis_on()
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_xlim(0, 3)
    axes.set_ylim(3, 0)
    axes.set_aspect("equal")
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_color(palette.METHOD if chosen else palette.MUTED)
        spine.set_linewidth(2.4 if chosen else 0.8)
    for index, share in enumerate(shares):
        row, column = divmod(index, 3)
        axes.add_patch(
            Rectangle((column, row), 1, 1, color=palette.METHOD, alpha=min(1.0, 2.2 * float(share)), lw=0)
        )
        dark = 2.2 * share > 0.55
        axes.text(
            column + 0.5,
            row + 0.5,
            percent(float(share), digits=0),
            ha="center",
            va="center",
            fontsize=8.5,
            color="white" if dark else palette.INK,
        )
    axes.set_title(title, fontsize=9.5, fontweight="bold" if chosen else "normal", loc="center")
