"""One run's data: what the pipelines receive, and apart from it, what really happened."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fusion.messages import Calibration, CategorySize, Measurement
from simbench.truth import Truth


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """`messages` are in order of arrival. Pipelines get `calibration`, `categories` and `messages` only."""

    calibration: Calibration
    categories: Mapping[str, CategorySize]
    messages: tuple[Measurement, ...]
    truth: Truth
