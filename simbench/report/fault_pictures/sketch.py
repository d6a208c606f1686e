"""What a picture of a fault is made of: the numbers that are drawn without it and with it, and how."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from simbench.capture import Captured
from simbench.faults.delivery import Delivery
from simbench.proving.same import same

Ending = Literal["svg", "png", "jpg"]
ENDINGS: tuple[Ending, ...] = get_args(Ending)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sketch:
    """before, after: every array that is drawn, by what it is. paint: draws them on a matplotlib figure of
    `height` user units (72 an inch). ending: of the file that holds it in fewest bytes: svg for lines, png
    for many dots, jpg for what cameras see."""

    before: Mapping[str, np.ndarray]
    after: Mapping[str, np.ndarray]
    paint: Callable[[Any], None]
    height: float
    ending: Ending = "svg"

    @property
    def shows_a_difference(self) -> bool:
        """Whether anything that is drawn differs, to the byte."""
        return not same(dict(self.before), dict(self.after))


def delivery_of(data: Any) -> Delivery:
    """What arrives, of data that a place of faults made: a delivery, or a drive that was measured anew."""
    if isinstance(data, Delivery):
        return data
    captured, _ = data
    return drive_of(captured).measured


def drive_of(captured: Any) -> Captured:
    """The drive as it was measured, of data of a place where faults act while it is."""
    if not isinstance(captured, Captured):
        raise TypeError(f"not a drive: {type(captured).__name__}")
    return captured
