"""The paper's figure: distances of several objects over time, a colour an object, a mark a camera.

Above the distances, with the true ones as thin lines; below how far two cameras are apart where both see one
object, on a scale that is linear up to 0.1 m and logarithmic beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

import numpy as np
from markupsafe import Markup

from simbench.distances import Curve, TrueCurve, disagreements
from simbench.report import palette
from simbench.report.figures import as_svg, grid

WIDE, HIGH = 816.0, 430.0  # user units: two columns of the page
MARKS = ("o", "s", "^", "D", "v", "P", "X", "p")  # of cameras; they repeat where there are more
LINEAR_M = 0.1


def distance_figure(true: Sequence[TrueCurve], curves: Sequence[Curve], label: str) -> Markup:
    """One pipeline's curves of one run. Objects without any curve are left out."""
    seen = {curve.object_name for curve in curves}
    shown = [one for one in true if one.object_name in seen]
    colours = {one.object_name: palette.OBJECTS[i % len(palette.OBJECTS)] for i, one in enumerate(shown)}
    cameras = sorted({curve.camera for curve in curves})
    marks = {camera: MARKS[i % len(MARKS)] for i, camera in enumerate(cameras)}

    def draw(figure: Any) -> None:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3.2, 1))
        for axes in (above, below):
            grid(axes)
        for one in shown:
            above.plot(one.t_ns * 1e-9, one.distance_m, color=colours[one.object_name], lw=0.9, zorder=1)
        for curve in curves:
            above.plot(
                *_with_gaps(curve), color=colours[curve.object_name], lw=0.8, alpha=0.9, ms=4.2,
                marker=marks[curve.camera], mfc="none", mew=0.8, zorder=2,
            )  # fmt: skip
        largest_m = 0.0
        for found in disagreements(curves):
            below.plot(
                found.t_ns * 1e-9, found.apart_m, ls="", marker="o", ms=3, mew=0, alpha=0.7,
                color=colours[found.object_name],
            )  # fmt: skip
            largest_m = max(largest_m, float(found.apart_m.max(initial=0.0)))
        above.set_ylim(bottom=0.0)
        above.set_ylabel("distance from the LiDAR (m)")
        below.set_yscale("symlog", linthresh=LINEAR_M)
        ticks = [0.0, LINEAR_M, 1.0, 10.0, 100.0]
        kept = [t for t in ticks if t <= max(1.0, 10.0 * largest_m)]
        below.set_ylim(-0.02, max(1.0, 1.6 * largest_m))
        below.set_yticks(kept, [f"{t:g}" for t in kept])
        below.minorticks_off()
        below.set_ylabel("apart (m)")
        below.set_xlabel("time (s)")
        _legend(figure, colours, marks)

    return as_svg(WIDE, HIGH, label, draw)


def _with_gaps(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and distances, broken where a scan in between has no value."""
    after = np.flatnonzero(np.diff(curve.scan_seq) > 1) + 1
    return np.insert(curve.t_ns * 1e-9, after, np.nan), np.insert(curve.distance_m, after, np.nan)


def _legend(figure: Any, colours: dict[str, str], marks: dict[str, str]) -> None:
    from matplotlib.lines import Line2D

    objects = [Line2D([], [], color=colour, lw=2.4, label=name) for name, colour in colours.items()]
    objects.append(Line2D([], [], color=palette.INK, lw=0.9, label="truth (centre)"))
    cameras = [
        Line2D([], [], ls="", marker=mark, mfc="none", color=palette.INK, ms=5.5, label=camera)
        for camera, mark in marks.items()
    ]
    nothing = Line2D([], [], ls="", label=" ")
    columns = list(zip_longest(objects, cameras, fillvalue=nothing))  # a legend is filled column by column
    figure.legend(
        handles=[entry for column in columns for entry in column], loc="outside upper center",
        ncols=len(columns), handletextpad=0.5, columnspacing=1.3,
    )  # fmt: skip
