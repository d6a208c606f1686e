"""Messages of one camera over a second: when each was measured, what its stamp claims, when it arrives.

What differs is coloured; a cross is a frame that no message shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from scenarios.faults import FaultSpec
from simbench.faults.delivery import Delivery
from simbench.report import palette
from simbench.report.fault_pictures.sketch import Sketch, delivery_of

CAMERA = "cam-front"
WINDOW_S, LEAD_S = 1.0, 0.25
ROWS = ("measured", "stamp", "arrives")


def sketch(spec: FaultSpec, before: Any, after: Any) -> Sketch:
    """Of the second in which the first message differs, from a quarter of it earlier on."""
    (was, one), (now, two) = _messages(delivery_of(before)), _messages(delivery_of(after))
    changed, lost = ~_among(two, one), ~np.isin(was, now)
    first_s = min([*two[changed, 0], *one[lost, 0]], default=0.0)
    begin_s = max(first_s - LEAD_S, 0.0)

    def shown(messages: np.ndarray) -> np.ndarray:
        inside = (messages >= begin_s) & (messages <= begin_s + WINDOW_S)
        return np.asarray(inside.any(axis=1))

    here, there = shown(one), shown(two)
    gone = one[lost & here]

    def paint(figure: Any) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True)
        _draw(upper, one[here], np.zeros(here.sum(), dtype=bool), "without")
        _draw(lower, two[there], changed[there], "with")
        lower.plot(gone[:, 0], np.full(len(gone), 2.0), "x", color=palette.WRONG, markersize=6, mew=1.5)
        if len(gone):
            lower.annotate(
                "x: frame that is never delivered",
                (1.0, 1.04),
                xycoords="axes fraction",
                ha="right",
                fontsize=8,
            )
        lower.set_xlim(begin_s, begin_s + WINDOW_S)
        lower.set_xlabel(f"true time (s), {CAMERA}")

    return Sketch(
        before={"messages": one[here], "lost": gone[:0, 0]},
        after={"messages": two[there], "lost": gone[:, 0]},
        paint=paint,
        height=225.0,
    )


def _messages(delivery: Delivery) -> tuple[Int64[np.ndarray, " m"], Float64[np.ndarray, "m 3"]]:
    """Which frame each shows; middle of its exposure, stamp and arrival, in seconds. In order of arrival."""
    shots = sorted(delivery.shots[CAMERA], key=lambda shot: (shot.arrival_ns, shot.stamp_ns))
    rows = [(shot.truth.capture_ns, shot.stamp_ns, shot.arrival_ns) for shot in shots]
    frames = np.array([shot.truth.seq for shot in shots], dtype=np.int64)
    return frames, 1e-9 * np.array(rows, dtype=np.float64).reshape(-1, 3)


def _among(rows: np.ndarray, others: np.ndarray) -> np.ndarray:
    known = {tuple(row) for row in others.tolist()}
    return np.array([tuple(row) in known for row in rows.tolist()], dtype=bool)


def _draw(axes: Any, messages: np.ndarray, changed: np.ndarray, title: str) -> None:
    heights: Sequence[float] = (2.0, 1.0, 0.0)
    for row, differs in zip(messages, changed, strict=True):
        colour = palette.RAW if differs else palette.CLEAN
        axes.plot(row, heights, color=colour, linewidth=0.9)
        axes.plot(row, heights, "|", color=colour, markersize=9, markeredgewidth=1.8)
    axes.set_yticks(heights, ROWS)
    axes.set_ylim(-0.5, 2.5)
    axes.tick_params(length=0)
    axes.spines["left"].set_visible(False)
    axes.set_title(title, fontsize=9, fontweight="normal", color=palette.MUTED)
