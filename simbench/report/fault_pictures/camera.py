"""One picture without the fault and with it, side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import UInt8

from scenarios.faults import FaultSpec
from simbench.report import palette
from simbench.report.fault_pictures.sketch import Sketch, delivery_of


def sketch(spec: FaultSpec, before: Any, after: Any) -> Sketch:
    """Of the camera whose last picture differs most."""
    one, two = _last(before), _last(after)
    camera = max(one, key=lambda name: (_apart(one[name], two[name]), name))

    def paint(figure: Any) -> None:
        for axes, rgb, title in zip(
            figure.subplots(1, 2), (one[camera], two[camera]), ("without", "with"), strict=True
        ):
            axes.imshow(rgb, interpolation="nearest")
            axes.set_title(f"{camera}, {title}", fontsize=9, fontweight="normal", color=palette.MUTED)
            axes.set_axis_off()

    return Sketch(
        before={"rgb": one[camera]}, after={"rgb": two[camera]}, paint=paint, height=170.0, ending="jpg"
    )


def _last(data: Any) -> dict[str, UInt8[np.ndarray, "h w 3"]]:
    """The last picture of each camera."""
    shots = delivery_of(data).shots
    return {name: taken[-1].image.rgb for name, taken in shots.items() if taken[-1].image is not None}


def _apart(one: np.ndarray, two: np.ndarray) -> float:
    return float(np.abs(one.astype(np.int64) - two).mean())
