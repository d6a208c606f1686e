"""How much is measured: in full, or a little of everything to see that it runs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Size:
    """columns: of a sweep (None: all). turns: timed calls of each side. image_px: of all cameras (None: as
    the sensor file says). spawn: work in processes of their own, else in this one. windows: of the real-time
    rows. recording_s: of the memory row. drive_s: of drives without images (None: as the catalogue says)."""

    columns: int | None
    turns: int
    image_px: tuple[int, int] | None
    spawn: bool
    windows: int
    recording_s: float
    drive_s: float | None


FULL = Size(columns=None, turns=21, image_px=None, spawn=True, windows=7, recording_s=60.0, drive_s=None)
QUICK = Size(columns=16, turns=1, image_px=(32, 20), spawn=False, windows=1, recording_s=0.2, drive_s=0.3)
