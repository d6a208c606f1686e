"""What a pipeline may see of a drive, wherever it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fusion.messages import Calibration, CategorySize, Measurement


@dataclass(frozen=True, kw_only=True, eq=False)
class Log:
    """`messages` are in order of arrival."""

    calibration: Calibration
    categories: Mapping[str, CategorySize]
    messages: tuple[Measurement, ...]
