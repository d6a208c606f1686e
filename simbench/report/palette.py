"""One palette for page, figures and video: Okabe and Ito's, which survives the common colour blindnesses.

Meaning never hangs on colour alone: right is also a dot, wrong a cross, not mapped a ring.
"""

from __future__ import annotations

RIGHT = "#009E73"
WRONG = "#D55E00"
OUTSIDE = "#56B4E9"
BOX = "#FFFFFF"
AOI = "#F0E442"
SHIFT = "#E69FC9"

INK = "#1B1F24"
MUTED = "#5F6B7A"
RULE = "#D5DAE1"
PAPER = "#FFFFFF"
PLAIN = "#39424E"  # behind points where there is no picture

CLEAN = "#7A8594"  # without injected errors
RAW = "#D55E00"  # the baseline under errors
METHOD = "#0072B2"  # the method under errors
ORACLE = "#1B1F24"
OTHER = "#9467A6"
OBJECTS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#B5478F",
    "#E69F00",
    "#56B4E9",
    "#1B1F24",
)  # one each, then again


def bgr(colour: str) -> tuple[int, int, int]:
    """'#RRGGBB' as OpenCV wants it."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return blue, green, red
