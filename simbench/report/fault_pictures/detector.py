"""Boxes of one frame without a fault of the detector and with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx, Detection
from scenarios.faults import FaultSpec
from simbench.faults.delivery import Delivery, Shot
from simbench.proving.ground import measured
from simbench.report import palette
from simbench.report.fault_pictures.sketch import Sketch, delivery_of

ASPECT = 1.6  # width over height of what is drawn
AROUND = 2.6  # times the size of the box in its middle
INSIDE_PX = 2.0  # how far from the picture's edge a whole object's box ends


def sketch(spec: FaultSpec, before: Any, after: Any) -> Sketch:
    """Around the largest box that differs, of all frames of all cameras; the first of those."""
    one, two = delivery_of(before), delivery_of(after)
    rig = measured().staged.rig if isinstance(after, Delivery) else after[1]
    lenses = rig.pinholes
    camera, was, now = max(_frames(one, two), key=lambda f: _size_px(_largest(f[1], f[2], lenses[f[0]])))
    old, new = was.detections.boxes, now.detections.boxes
    kept, known = {_key(box) for box in new}, {_key(box) for box in old}
    view = _view(_largest(was, now, lenses[camera]), lenses[camera])

    def paint(figure: Any) -> None:
        left, right = figure.subplots(1, 2, sharey=True)
        for box in old:
            _outline(left, box, palette.INK)
            if _key(box) not in kept:
                _outline(right, box, palette.CLEAN, dashes=(0, (2, 2)))
        for box in new:
            fresh = _key(box) not in known
            _outline(right, box, palette.RAW if fresh else palette.INK)
        _name_categories(left, old, new)
        _name_categories(right, new, old)
        left.set_title(f"without: {len(old)} boxes", fontsize=9, fontweight="normal", color=palette.MUTED)
        right.set_title(f"with: {len(new)} boxes; dashed: gone", fontsize=9, fontweight="normal",
                        color=palette.MUTED)  # fmt: skip
        for axes in (left, right):
            axes.set_xlim(view[0], view[2])
            axes.set_ylim(view[3], view[1])
            axes.set_aspect("equal")
            axes.tick_params(length=0)
            axes.set_xlabel(f"{camera}, frame {was.truth.seq} (px)", fontsize=9)

    return Sketch(before={"boxes": _table(old)}, after={"boxes": _table(new)}, paint=paint, height=215.0)


def same_frames(one: Sequence[Shot], two: Sequence[Shot]) -> list[tuple[Shot, Shot]]:
    """Shots of the same exposure."""
    taken = {shot.truth.capture_ns: shot for shot in two}
    return [(shot, taken[shot.truth.capture_ns]) for shot in one if shot.truth.capture_ns in taken]


def _frames(one: Delivery, two: Delivery) -> list[tuple[str, Shot, Shot]]:
    return [(n, a, b) for n in one.shots for a, b in same_frames(one.shots[n], two.shots[n])]


def _key(box: Detection) -> tuple[object, ...]:
    return (box.box_px, box.category, box.track_id)


def _largest(was: Shot, now: Shot, lens: PinholeCamera) -> BoxPx | None:
    """Of the boxes that differ and end within the picture; None where there is none."""
    one, two = ({_key(box): box.box_px for box in shot.detections.boxes} for shot in (was, now))
    differ = [{**one, **two}[key] for key in sorted(one.keys() ^ two.keys())]
    whole = [
        (x0, y0, x1, y1)
        for x0, y0, x1, y1 in differ
        if min(x0, y0, lens.width_px - x1, lens.height_px - y1) > INSIDE_PX
    ]
    return max(whole, key=_size_px, default=None)


def _size_px(box_px: BoxPx | None) -> float:
    return 0.0 if box_px is None else max(box_px[2] - box_px[0], box_px[3] - box_px[1])


def _table(boxes: Sequence[Detection]) -> Float64[np.ndarray, "n 5"]:
    """Edges and which category, in the order of the alphabet of those that the detector knows."""
    known: list[str] = sorted(measured().staged.rig.rig.detector.categories)
    rows = [(*box.box_px, float(known.index(box.category))) for box in boxes]
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def _view(box_px: BoxPx | None, lens: PinholeCamera) -> BoxPx:
    """The part of the picture around a box; all of it where there is none."""
    size = np.array([lens.width_px, lens.height_px], dtype=np.float64)
    x0, y0, x1, y1 = box_px or (0.0, 0.0, *size)
    width = min(AROUND * max(x1 - x0, ASPECT * (y1 - y0)), size[0], ASPECT * size[1])
    half = 0.5 * np.array([width, width / ASPECT])
    middle = np.clip(0.5 * np.array([x0 + x1, y0 + y1]), half, size - half)
    (left, top), (right, bottom) = middle - half, middle + half
    return (float(left), float(top), float(right), float(bottom))


def _outline(axes: Any, box: Detection, colour: str, dashes: Any = "-") -> None:
    x0, y0, x1, y1 = box.box_px
    axes.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color=colour, linewidth=1.1, linestyle=dashes)


def _name_categories(axes: Any, boxes: Sequence[Detection], others: Sequence[Detection]) -> None:
    """Of boxes that are called something else on the other side."""
    named = {box.box_px: box.category for box in others}
    for box in boxes:
        if named.get(box.box_px, box.category) != box.category:
            axes.text(*box.box_px[:2], box.category, fontsize=8, va="bottom", clip_on=True)
