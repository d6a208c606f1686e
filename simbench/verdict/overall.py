"""All metrics and groups of a suite together.

The suite passes when every one of them passes (intersection-union: each at alpha, no correction needed). It
has regressed when one REGRESSION survives Holm's adjustment over all; one that does not is INCONCLUSIVE.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from simbench.verdict.decide import WORST_FIRST, Judgement, Verdict
from simbench.verdict.holm import holm

Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True, kw_only=True)
class SuiteVerdict(Generic[Key]):
    """The worst verdict of all, and all judgements, worst first; within a verdict by how far the loss is
    beyond the margin. adjusted: Holm's p of each REGRESSION hypothesis that was tested.
    """

    verdict: Verdict
    judgements: tuple[tuple[Key, Judgement], ...]
    adjusted: Mapping[Key, float]
    note: str | None = None


def suite_verdict(judgements: Mapping[Key, Judgement]) -> SuiteVerdict[Key]:
    """Of judgements by metric and group, all at one alpha; without any: ERROR. ValueError: several alphas."""
    if not judgements:
        return SuiteVerdict(verdict="ERROR", judgements=(), adjusted={}, note="nothing was compared")
    if len({judgement.alpha for judgement in judgements.values()}) > 1:
        raise ValueError("judgements at different alphas cannot be taken together")
    tested = {key: j.p_regression for key, j in judgements.items() if j.p_regression is not None}
    adjusted = dict(zip(tested, holm(list(tested.values())), strict=True))
    rows = [(key, _adjust(judgement, adjusted.get(key))) for key, judgement in judgements.items()]
    rows.sort(key=lambda row: (WORST_FIRST.index(row[1].verdict), -row[1].beyond))
    return SuiteVerdict(verdict=rows[0][1].verdict, judgements=tuple(rows), adjusted=adjusted)


def _adjust(judgement: Judgement, adjusted: float | None) -> Judgement:
    if judgement.verdict != "REGRESSION" or adjusted is None or adjusted <= judgement.alpha:
        return judgement
    why = f"a regression alone, but not among all that was tested (Holm's p {adjusted:.3g})"
    note = f"{why}; {judgement.note}" if judgement.note else why
    return replace(judgement, verdict="INCONCLUSIVE", note=note)
