"""The points of one sweep from above: those that stay, those that are lost, those that moved or are new."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from scenarios.faults import FaultSpec
from simbench.report import palette
from simbench.report.fault_pictures.sketch import Sketch, delivery_of

SWEEP = 0
REACH_M = 40.0  # around the sensor
CLOSE_M = (2.4, 1.5)  # around one thing
SMALL_SHARE = 0.03  # of the reach: what moves by less is looked at from close by
MOVED_M = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class _Points:
    """firing: (time in ns, ring). thing: what was hit, -1 the ground or nothing."""

    xy_m: Float64[np.ndarray, "n 2"]
    firing: Int64[np.ndarray, "n 2"]
    thing: Int64[np.ndarray, " n"]


def sketch(spec: FaultSpec, before: Any, after: Any) -> Sketch:
    """Of the first sweep; from close by, at the thing with most points, where points move by little."""
    one, two = _points(before), _points(after)
    was = {tuple(f): i for i, f in enumerate(one.firing.tolist())}
    source = np.array([was.get(tuple(f), -1) for f in two.firing.tolist()], dtype=np.int64)
    far_m = np.where(source >= 0, np.hypot(*(two.xy_m - one.xy_m[source]).T), np.inf)
    changed = far_m > MOVED_M
    lost = np.ones(len(one.xy_m), dtype=bool)
    lost[source[source >= 0]] = False
    moved = far_m[changed & np.isfinite(far_m)]
    close = len(moved) > 0 and float(np.median(moved)) < SMALL_SHARE * REACH_M
    middle = _middle(one) if close else np.zeros(2)
    span = np.array(CLOSE_M) if close else np.array([REACH_M, REACH_M])

    def shown(xy_m: np.ndarray) -> np.ndarray:
        return np.asarray((np.abs(xy_m - middle) <= span).all(axis=1))

    here, there = shown(one.xy_m), shown(two.xy_m)
    links = np.stack([one.xy_m[source], two.xy_m], axis=1)[changed & (source >= 0) & there]
    layers = {
        "stay": two.xy_m[there & ~changed], "lost": one.xy_m[here & lost], "new": two.xy_m[there & changed],
    }  # fmt: skip

    def paint(figure: Any) -> None:
        left, right = figure.subplots(1, 2, sharey=True)
        size = 3.0 if close else 1.3
        _dots(left, one.xy_m[here], palette.INK, size)
        left.set_title(f"without: {len(one.xy_m)} points", **_TITLE)
        _dots(right, layers["lost"], palette.SHIFT, size)
        _dots(right, layers["stay"], palette.INK, size)
        if close:
            _dots(right, links[:, 0], palette.RULE, size)
            for pair in links:
                right.plot(*pair.T, color=palette.RAW, linewidth=0.5, alpha=0.6)
        _dots(right, layers["new"], palette.RAW, size if close else 1.5 * size)
        right.set_title(_words(lost, changed, source), **_TITLE)
        for axes in (left, right):
            axes.set_xlim(middle[0] - span[0], middle[0] + span[0])
            axes.set_ylim(middle[1] - span[1], middle[1] + span[1])
            axes.set_aspect("equal")
            axes.tick_params(length=0)
            axes.set_xlabel("x forward (m)")
        left.set_ylabel("y left (m)")

    return Sketch(
        before={"points": one.xy_m[here]}, after={"points": two.xy_m[there]}, paint=paint,
        height=205.0 if close else 262.0, ending="png",
    )  # fmt: skip


_TITLE: Mapping[str, Any] = {"fontsize": 9, "fontweight": "normal", "color": palette.MUTED}


def _points(data: Any) -> _Points:
    sweep = delivery_of(data).sweeps[SWEEP]
    return _Points(
        xy_m=sweep.scan.xyz_m[:, :2].astype(np.float64),
        firing=np.stack([sweep.truth.fire_ns, sweep.scan.ring.astype(np.int64)], axis=1),
        thing=sweep.truth.object_id.astype(np.int64),
    )


def _middle(points: _Points) -> Float64[np.ndarray, "2"]:
    """Of the thing with most points; the first of those."""
    things, counts = np.unique(points.thing[points.thing >= 0], return_counts=True)
    middle: np.ndarray = np.median(points.xy_m[points.thing == things[counts.argmax()]], axis=0)
    return middle


def _words(lost: np.ndarray, changed: np.ndarray, source: np.ndarray) -> str:
    moved, new = int((changed & (source >= 0)).sum()), int((changed & (source < 0)).sum())
    parts = [(int(lost.sum()), "lost"), (moved, "moved"), (new, "new")]
    return "with: " + ", ".join(f"{count} {word}" for count, word in parts if count)


def _dots(axes: Any, xy_m: np.ndarray, colour: str, size: float) -> None:
    axes.plot(*xy_m.T, "o", color=colour, markersize=size, markeredgewidth=0)
