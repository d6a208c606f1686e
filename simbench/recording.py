"""One run's data: what the pipelines receive, and apart from it, what really happened."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from fusion.messages import Calibration, CategorySize, Measurement
from simbench.log import Log
from simbench.truth import Truth


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """`messages` are in order of arrival. Pipelines get `calibration`, `categories` and `messages` only."""

    calibration: Calibration
    categories: Mapping[str, CategorySize]
    messages: tuple[Measurement, ...]
    truth: Truth

    @property
    def log(self) -> Log:
        """What pipelines get."""
        return Log(calibration=self.calibration, categories=self.categories, messages=self.messages)

    @property
    def by_target(self) -> tuple[Recording, ...]:
        """This recording once for every object that is scored, as if it were the only target."""
        return self._by_target or (self,)

    @cached_property
    def _by_target(self) -> tuple[Recording, ...]:
        return tuple(
            replace(self, truth=replace(self.truth, target_id=target, targets=()))
            for target in self.truth.targets
        )
