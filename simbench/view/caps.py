"""How much of a recording a page holds, so that any recording's page stays small. docs/formats.md says so."""

from __future__ import annotations

MOST_SWEEPS = 200  # then every k-th
MOST_POINTS = 6_000  # of one sweep
MOST_POINTS_TOGETHER = 480_000
MOST_IMAGES = 360
MOST_CAMERAS = 16
MOST_STREAMS = 48  # rows of the table of stamps
MOST_OBJECTS = 300
MOST_BOXES = 60  # of one image
IMAGE_WIDTH_PX, JPEG_QUALITY = 320, 70
LONGEST_NAME = 60


def every_kth(count: int, most: int) -> int:
    """The smallest k at which every k-th of `count` are at most `most`."""
    return max(1, -(-count // most))


def short(name: str) -> str:
    """A name of a file as it is shown: one line, not too long."""
    line = "".join(c if c.isprintable() else "?" for c in name[: LONGEST_NAME + 1])
    return line if len(line) <= LONGEST_NAME else line[: LONGEST_NAME - 1] + "…"
