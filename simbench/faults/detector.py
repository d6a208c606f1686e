"""detector.edge_error: errors of the box edges that are correlated in time.

e[f] = bias + x[f], x AR(1): x[f] = a x[f-1] + sqrt(1 - a^2) sd N(0, 1), a = exp(-dt / tau); per object,
camera and edge, in units of the box's width (left, right) or height (top, bottom). Receipt: the delivered
edges against the true visible box.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float64

from fusion.messages import Detections
from scenarios.faults import EdgeError
from scenarios.seeding import stream
from simbench.faults.estimate import gain
from simbench.faults.receipt import Receipt, judge
from simbench.truth import ImageTruth, ObjectInfo

KEY = "detector.edge_error"
BORDER_PX = 2.0
FEWEST_BOXES = 10
OUTWARD = np.array([-1.0, -1.0, 1.0, 1.0])
NOTE = "delivered boxes against true visible boxes"


def edge_errors(
    spec: EdgeError, camera: str, objects: Sequence[ObjectInfo], frames: int, period_s: float, seed: int
) -> dict[int, Float64[np.ndarray, "f 4"]]:
    """Relative errors of the edges (x0, y0, x1, y1) by object, [frames 4]."""
    keep = np.exp(-period_s / spec.tau_s) if spec.tau_s > 0.0 else 0.0
    drive = np.sqrt(1.0 - keep**2)
    result = {}
    for info in objects:
        draw = stream(seed, "fault", KEY, camera, info.name).standard_normal((frames, 4))
        x = np.empty_like(draw)
        x[0] = draw[0]
        for f in range(1, frames):
            x[f] = keep * x[f - 1] + drive * draw[f]
        result[info.object_id] = spec.bias_fraction * OUTWARD + spec.sd_fraction * x
    return result


def receipts(
    spec: EdgeError,
    realised: Mapping[str, Mapping[int, Float64[np.ndarray, "f 4"]]],
    detections: Sequence[Detections],
    images: Sequence[ImageTruth],
    size_px: Mapping[str, tuple[int, int]],
    period_s: float,
) -> tuple[Receipt, ...]:
    """Over all boxes that the image's border does not cut. RMS: how often the drawn errors are contained in
    the delivered ones, times their RMS, so that another object's or camera's errors do not pass. With a time
    constant, also the correlation from one frame to the next; with a bias, the mean outward error.
    """
    found, drawn, follows = _compared(realised, detections, images, size_px)
    n = 4 * len(found)
    keep = float(np.exp(-period_s / spec.tau_s)) if spec.tau_s > 0.0 else 0.0
    free = max(n * (1.0 - keep**2) / (1.0 + keep**2), 1.0)
    enough = len(found) >= FEWEST_BOXES
    note = NOTE if enough else f"only {len(found)} uncut boxes were delivered"
    if not enough:  # then at least what was drawn is known
        everything = [errors for by_object in realised.values() for errors in by_object.values()]
        drawn = np.concatenate(everything) if everything else np.zeros((1, 4))

    def one(
        quantity: str,
        unit: str,
        requested: float,
        drawn_value: float,
        measured: float,
        sd: float,
        allowed: float,
    ) -> Receipt:
        return judge(
            fault=KEY, quantity=quantity, unit=unit, requested=requested, realised=drawn_value,
            measured=measured if enough else None, systematic=5.0 * sd, allowed=allowed, note=note,
        )  # fmt: skip

    asked_rms = float(np.hypot(spec.sd_fraction, spec.bias_fraction))
    rms = float(np.sqrt(np.mean(drawn**2)))
    held = rms * gain(found, drawn) if enough and rms > 0.0 else _rms(found)
    result = [one("edge RMS", "of side", asked_rms, rms, held, 1e-4, 5.0 * asked_rms / np.sqrt(2.0 * free))]
    if spec.bias_fraction != 0.0:
        allowed = 5.0 * spec.sd_fraction / np.sqrt(free) + 0.01 * abs(spec.bias_fraction)
        outward = float(np.mean(drawn * OUTWARD)), float(np.mean(found * OUTWARD)) if enough else 0.0
        result.append(one("outward bias", "of side", spec.bias_fraction, *outward, 1e-4, allowed))
    if enough and keep > 0.0 and spec.sd_fraction > 0.0 and follows.any():
        allowed = 5.0 * float(np.sqrt((1.0 - keep**2) / (4.0 * follows.sum()))) + 0.05
        bias = spec.bias_fraction * OUTWARD
        link = _link(drawn - bias, follows), _link(found - bias, follows)
        result.append(one("link to the next frame", "correlation", keep, *link, 1e-3, allowed))
    return tuple(result)


def _compared(
    realised: Mapping[str, Mapping[int, Float64[np.ndarray, "f 4"]]],
    detections: Sequence[Detections],
    images: Sequence[ImageTruth],
    size_px: Mapping[str, tuple[int, int]],
) -> tuple[Float64[np.ndarray, "n 4"], Float64[np.ndarray, "n 4"], Bool[np.ndarray, " n"]]:
    """Delivered and drawn relative errors of each uncut box, by camera, object and frame; whether the row
    before is the same object's in the frame before.
    """
    truth = {(i.sensor, i.seq): i for i in images}
    rows: dict[tuple[str, int, int], tuple[np.ndarray, np.ndarray]] = {}
    for message in detections:
        image = truth[(message.sensor, message.seq)]
        visible = {b.object_id: b.visible_px for b in image.boxes}
        width, height = size_px[message.sensor]
        for box, object_id in zip(message.boxes, image.detection_object_id, strict=True):
            seen = visible.get(object_id)
            if seen is None:
                continue
            x0, y0, x1, y1 = box.box_px
            if min(x0, y0, seen[0], seen[1]) < BORDER_PX:
                continue
            if max(x1, seen[2]) > width - BORDER_PX or max(y1, seen[3]) > height - BORDER_PX:
                continue
            side = np.array([seen[2] - seen[0], seen[3] - seen[1]] * 2)
            errors = realised.get(message.sensor, {}).get(object_id)
            rows[(message.sensor, object_id, message.seq)] = (
                (np.array(box.box_px) - np.array(seen)) / side,
                np.zeros(4) if errors is None else errors[message.seq],
            )
    keys = sorted(rows)
    follows = [i > 0 and keys[i] == (*keys[i - 1][:2], keys[i - 1][2] + 1) for i in range(len(keys))]
    return (
        np.array([rows[key][0] for key in keys]).reshape(-1, 4),
        np.array([rows[key][1] for key in keys]).reshape(-1, 4),
        np.array(follows, dtype=bool),
    )


def _rms(value: Float64[np.ndarray, "n 4"]) -> float:
    return float(np.sqrt(np.mean(value**2))) if len(value) else 0.0


def _link(errors: Float64[np.ndarray, "n 4"], follows: Bool[np.ndarray, " n"]) -> float:
    """Correlation of an error with that of the frame before; 0 where there is no error."""
    now, before = errors[follows], errors[np.flatnonzero(follows) - 1]
    power = float(np.sqrt(np.sum(now**2) * np.sum(before**2)))
    return float(np.sum(now * before)) / power if power > 0.0 else 0.0
