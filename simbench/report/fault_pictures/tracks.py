"""Boxes of one camera over time, where single frames do not show what a fault does: lag, and ids."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float64

from scenarios.faults import FaultSpec
from scenarios.faults.detector import IdentitySwitches
from simbench.faults.delivery import Delivery, Shot
from simbench.report import palette
from simbench.report.fault_pictures.sketch import Sketch, delivery_of

Rows = Mapping[int, Float64[np.ndarray, "_ 4"]]
"""By object: time in s, left and right edge in px, id."""
LAG_S = 1.5
SWITCH_S = (1.0, 1.5)  # before and after the first switch of ids


def sketch(spec: FaultSpec, before: Any, after: Any) -> Sketch:
    """Of the camera in which the fault changes most."""
    one, two = delivery_of(before), delivery_of(after)
    return _identities(one, two) if isinstance(spec, IdentitySwitches) else _lag(one, two)


def _lag(one: Delivery, two: Delivery) -> Sketch:
    """Edges of the box that moves farthest from where it would be."""
    found = {
        (camera, thing): (rows, _rows(two, camera)[thing])
        for camera in one.shots
        for thing, rows in _rows(one, camera).items()
        if len(_rows(two, camera).get(thing, ())) == len(rows)
    }
    camera, thing = max(found, key=lambda key: _farthest_px(*found[key]))
    was, now = found[camera, thing]
    worst_s = float(now[_off_px(was, now).argmax(), 0])
    was, now = (rows[np.abs(rows[:, 0] - worst_s) <= 0.5 * LAG_S] for rows in (was, now))

    def paint(figure: Any) -> None:
        axes = figure.subplots()
        for rows, colour, word in ((was, palette.CLEAN, "without"), (now, palette.RAW, "with")):
            for side in (1, 2):
                axes.plot(rows[:, 0], rows[:, side], "o-", color=colour, markersize=3, linewidth=1.1,
                          label=word if side == 1 else None)  # fmt: skip
        axes.set_ylabel("left and right edge (px)", fontsize=9)
        axes.set_xlabel(f"true time (s); the box of one object in {camera}", fontsize=9)
        axes.legend(ncols=2, loc="lower left", bbox_to_anchor=(-0.02, 0.98))
        axes.tick_params(length=0)

    return Sketch(before={"edges": was}, after={"edges": now}, paint=paint, height=210.0)


def _identities(one: Delivery, two: Delivery) -> Sketch:
    """Middles of all boxes, those of objects whose ids change in the colour of the id."""
    camera = max(one.shots, key=lambda name: (len(_renamed(_rows(one, name), _rows(two, name))), name))
    was, now = _rows(one, camera), _rows(two, camera)
    renamed = _renamed(was, now)
    first_s = min((float(was[i][was[i][:, 3] != now[i][:, 3], 0][0]) for i in renamed), default=0.0)
    was, now = _between(was, first_s), _between(now, first_s)
    renamed = _renamed(was, now)
    ids = sorted({i for rows in (was, now) for thing in renamed for i in rows[thing][:, 3]})
    colour = {i: palette.OBJECTS[k % len(palette.OBJECTS)] for k, i in enumerate(ids)}

    def draw(axes: Any, rows: Rows, title: str) -> None:
        for thing, table in rows.items():
            middle = 0.5 * (table[:, 1] + table[:, 2])
            if thing not in renamed:
                axes.plot(table[:, 0], middle, color=palette.RULE, linewidth=1.0)
                continue
            for i in np.unique(table[:, 3]):
                own = table[:, 3] == i
                axes.plot(table[own, 0], middle[own], "o", color=colour[i], markersize=3.0, mew=0)
        axes.set_title(title, fontsize=9, fontweight="normal", color=palette.MUTED)
        axes.set_xlabel("true time (s)")
        axes.tick_params(length=0)

    def paint(figure: Any) -> None:
        left, right = figure.subplots(1, 2, sharey=True)
        draw(left, was, "without: a colour an id")
        draw(right, now, "with")
        left.set_ylabel(f"middle of the box,\n{camera} (px)", fontsize=9)

    def drawn(rows: Rows) -> dict[str, np.ndarray]:
        return {str(thing): table for thing, table in rows.items()}

    return Sketch(before=drawn(was), after=drawn(now), paint=paint, height=215.0)


def _between(rows: Rows, first_s: float) -> Rows:
    begin_s, end_s = first_s - SWITCH_S[0], first_s + SWITCH_S[1]
    cut = {i: table[(table[:, 0] >= begin_s) & (table[:, 0] <= end_s)] for i, table in rows.items()}
    return {i: table for i, table in cut.items() if len(table)}


def _rows(delivery: Delivery, camera: str) -> Rows:
    found: dict[int, list[tuple[float, float, float, float]]] = {}
    for shot in delivery.shots[camera]:
        for thing, row in _of(shot):
            found.setdefault(thing, []).append(row)
    return {thing: np.array(rows) for thing, rows in sorted(found.items())}


def _of(shot: Shot) -> list[tuple[int, tuple[float, float, float, float]]]:
    t_s = 1e-9 * shot.truth.capture_ns
    pairs = zip(shot.truth.detection_object_id, shot.detections.boxes, strict=True)
    return [(i, (t_s, b.box_px[0], b.box_px[2], float(b.track_id))) for i, b in pairs if i >= 0]


def _off_px(was: Float64[np.ndarray, "f 4"], now: Float64[np.ndarray, "f 4"]) -> Float64[np.ndarray, " f"]:
    off: np.ndarray = np.abs(now[:, 1:3] - was[:, 1:3]).sum(axis=1)
    return off


def _farthest_px(was: Float64[np.ndarray, "_ 4"], now: Float64[np.ndarray, "_ 4"]) -> float:
    return float(_off_px(was, now).max())


def _renamed(one: Rows, two: Rows) -> frozenset[int]:
    return frozenset(
        thing
        for thing in one.keys() & two.keys()
        if one[thing].shape == two[thing].shape and (one[thing][:, 3] != two[thing][:, 3]).any()
    )
