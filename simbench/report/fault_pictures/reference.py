"""Fixes of the reference: how far each is from the target's true place, and how old the one that holds is."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64

from scenarios.faults import FaultSpec
from simbench.proving.ground import long
from simbench.report import palette
from simbench.report.fault_pictures.sketch import Sketch, delivery_of
from simbench.truth import GnssReference

SHOWN_S = 12.0


def sketch(spec: FaultSpec, before: Any, after: Any) -> Sketch:
    """Over the first seconds of the proving ground's long drive, in the ego frame."""
    one, two = _reference(before), _reference(after)
    was, now = _fixes(one), _fixes(two)
    was_old, now_old = _ages(one), _ages(two)

    def paint(figure: Any) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True)
        for side, column, line, mark, colour in (
            ("x", 1, "-", "o", palette.RAW), ("y", 2, (0, (4, 2)), "s", palette.METHOD),
        ):  # fmt: skip
            upper.plot(was[:, 0], was[:, column], color=palette.CLEAN, linestyle=line, linewidth=1.2,
                       label=f"{side}, without")  # fmt: skip
            upper.plot(now[:, 0], now[:, column], mark, color=colour, markersize=2.6, mew=0,
                       label=f"{side}, with")  # fmt: skip
        upper.set_ylabel("error of\na fix (m)", fontsize=9)
        upper.legend(ncols=4, loc="lower left", bbox_to_anchor=(-0.02, 0.98), fontsize=8.5,
                     handletextpad=0.4, handlelength=1.4, columnspacing=1.0)  # fmt: skip
        lower.plot(*now_old.T, color=palette.RAW, linewidth=1.1)
        lower.plot(*was_old.T, color=palette.CLEAN, linewidth=1.0)
        lower.set_ylabel("age of the\none held (s)", fontsize=9)
        lower.set_xlabel("true time (s); x forward, y left, ego frame", fontsize=9)
        lower.set_xlim(0.0, SHOWN_S)
        for axes in (upper, lower):
            axes.grid(visible=True, axis="y")
            axes.tick_params(length=0)

    return Sketch(
        before={"fixes": was, "age": was_old}, after={"fixes": now, "age": now_old}, paint=paint, height=240.0
    )


def _reference(data: Any) -> GnssReference:
    reference = delivery_of(data).reference
    if reference is None:
        raise ValueError("the proving ground has no reference")
    return reference


def _fixes(reference: GnssReference) -> Float64[np.ndarray, "m 3"]:
    """Instant (s), and error along x and y (m)."""
    true_m = long().captured.recording.truth.target_centre_ego_m(reference.fix_ns)
    off_m = (reference.position_ego_m - true_m)[:, :2]
    rows = np.column_stack([1e-9 * reference.fix_ns, np.round(off_m, 6)])
    return rows[rows[:, 0] <= SHOWN_S]


def _ages(reference: GnssReference) -> Float64[np.ndarray, "v 2"]:
    """Instant (s), and how old the last fix that is known is (s): corners of a saw, each fix replacing the
    one before it."""
    known, fix = 1e-9 * reference.available_ns, 1e-9 * reference.fix_ns
    rises = np.column_stack([known, known - fix])
    falls = np.column_stack([known[1:], known[1:] - fix[:-1]])
    corners = np.empty((len(rises) + len(falls), 2))
    corners[0::2], corners[1::2] = rises, falls
    return corners[corners[:, 0] <= SHOWN_S]
