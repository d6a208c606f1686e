"""A small picture of one fault: its name, its severity, what it does in a sentence, and a sketch."""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import UInt8

from scenarios.errors import BadInput
from scenarios.fault_set import describe_faults
from scenarios.faults import FAULTS, CalibrationMixup, FaultSpec, Trace
from scenarios.faults.detector import BoxLag, IdentitySwitches
from simbench.proving.places import place_where
from simbench.proving.prove import LEVEL, levels_of
from simbench.report import palette
from simbench.report.fault_pictures import (
    calibration,
    camera,
    detector,
    lidar,
    motion,
    reference,
    timing,
    tracks,
)
from simbench.report.fault_pictures.sketch import Ending, Sketch
from simbench.report.figures import STYLE

Draw = Callable[[FaultSpec, Any, Any], Sketch]
FAMILIES: Mapping[str, Draw] = {
    "calibration": calibration.sketch, "camera": camera.sketch, "detector": detector.sketch,
    "lidar": lidar.sketch, "motion": motion.sketch, "reference": reference.sketch, "timing": timing.sketch,
}  # fmt: skip
OVER_TIME: tuple[type[FaultSpec], ...] = (BoxLag, IdentitySwitches)
SEED = 0
WIDTH, HEAD, LINE = 480.0, 36.0, 12.0  # user units, 72 an inch
WRAP = 86  # characters of the sentence in a line
SCALE = 1.5  # pixels of a PNG or JPEG per user unit
SHADES = 5  # steps of a colour in a PNG of lines and dots, which keeps it small
QUALITY = 80  # of a JPEG


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """A fault at one severity, drawn without it and with it."""

    spec: FaultSpec
    level: int
    levels: int
    sketch: Sketch


def drawn(fault: str, level: int = LEVEL) -> Drawn:
    """BadInput: no such severity, or nothing that would be drawn differs."""
    levels = levels_of(fault)
    if not 1 <= level <= len(levels):
        raise BadInput(
            f"severity {level} of {fault} does not exist", field="--level", allowed=f"1 to {len(levels)}"
        )
    spec = levels[level - 1]
    place = place_where(FAULTS[fault])
    without, given = place.make((), SEED).data, place.make((spec,), SEED).data
    draw = tracks.sketch if isinstance(spec, OVER_TIME) else FAMILIES[fault.partition(".")[0]]
    sketch = draw(spec, without, given)
    if not sketch.shows_a_difference:
        raise BadInput(f"{fault} at severity {level} changes nothing that a picture would show")
    return Drawn(spec=spec, level=level, levels=len(levels), sketch=sketch)


def rendered(picture: Drawn, ending: Ending) -> bytes:
    """The bytes of a file with this ending: same picture, same bytes."""
    import matplotlib

    with matplotlib.rc_context(dict(STYLE)):  # type: ignore[arg-type]
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure
        from matplotlib.layout_engine import ConstrainedLayoutEngine

        sentence = textwrap.wrap(_summary(picture.spec.name), WRAP)
        head = HEAD + LINE * len(sentence)
        height = picture.sketch.height + head
        share = 1.0 - head / height
        figure = Figure(
            figsize=(WIDTH / 72, height / 72), facecolor=palette.PAPER,
            layout=ConstrainedLayoutEngine(w_pad=4 / 72, h_pad=4 / 72, wspace=0.03, hspace=0.03,
                                           rect=(0.0, 0.0, 1.0, share)),
        )  # fmt: skip
        _head(figure, picture, sentence, height)
        if ending == "svg":
            out = io.BytesIO()
            FigureCanvasSVG(figure)
            picture.sketch.paint(figure)
            figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
            return _lean(out.getvalue().decode("utf-8")).encode("utf-8")
        figure.set_dpi(72 * SCALE)
        canvas = FigureCanvasAgg(figure)
        picture.sketch.paint(figure)
        canvas.draw()  # type: ignore[no-untyped-call]
        rgb = np.asarray(canvas.buffer_rgba())[:, :, :3]  # type: ignore[no-untyped-call]
        return _encoded(rgb, ending, shades=picture.sketch.ending != "jpg")


def _encoded(rgb: UInt8[np.ndarray, "h w 3"], ending: Ending, shades: bool) -> bytes:
    """As PNG (perhaps in few shades) or JPEG."""
    import cv2

    if ending == "png" and shades:
        step = 255 // SHADES
        rgb = (np.round(rgb / step) * step).astype(np.uint8)
    how = [cv2.IMWRITE_PNG_COMPRESSION, 9] if ending == "png" else [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
    _, code = cv2.imencode(f".{ending}", np.ascontiguousarray(rgb[:, :, ::-1]), how)
    return bytes(code.tobytes())


def strength(spec: FaultSpec) -> str:
    """How strong it is, in words: '50 ms'."""
    if isinstance(spec, Trace):
        return f"a recorded gyro, {spec.scale:g} times"
    value = getattr(spec, spec.strength)
    shown = f"{value:g}" if isinstance(value, int | float) else str(value).replace("_", " ")
    if isinstance(spec, CalibrationMixup):
        return shown
    words = (shown, spec.unit) if isinstance(value, int | float) else (spec.unit, shown)
    return " ".join(words)


def _summary(fault: str) -> str:
    found = next(str(known["summary"]) for known in describe_faults() if known["name"] == fault)
    return found.replace("`", "")


def _head(figure: Any, picture: Drawn, sentence: list[str], height: float) -> None:
    def line(down: float, text: str, x: float = 8.0, **words: Any) -> None:
        figure.text(x / WIDTH, 1.0 - down / height, text, va="baseline", **words)

    line(17.0, picture.spec.name, fontsize=11, fontweight="bold")
    line(17.0, f"severity {picture.level} of {picture.levels}: {strength(picture.spec)}", x=WIDTH - 8.0,
         ha="right", fontsize=10)  # fmt: skip
    for row, text in enumerate(sentence):
        line(33.0 + LINE * row, text, fontsize=9, color=palette.MUTED)


def _lean(svg: str) -> str:
    """Without comments, metadata and leading blanks, and to the hundredth of a user unit."""
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r"(\d\.\d\d)\d+", r"\1", svg)
    return re.sub(r"\n\s*", "\n", svg)
