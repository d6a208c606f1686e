"""Stop as soon as the verdict is clear: looks at 20, 40 and 80 runs, and at no other number.

Each look may be wrong, so each gets a part of alpha = 0.05 (Lan & DeMets, Biometrika 70, 1983; spending of
Pocock's type, alpha ln(1 + (e - 1) t) at t = 1/4, 1/2, 1), PASS and REGRESSION separately. The nominal levels
below spend .0494; all of .05 would allow .0179, .0189 and .0279.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from simbench.verdict.decide import MARGIN, Judgement, judge
from simbench.verdict.differences import Better, Values

LEVELS: Final[Mapping[int, float]] = {20: 0.0177, 40: 0.0185, 80: 0.0276}
"""One-sided nominal p of the look at so many runs."""
LOOKS: Final = tuple(LEVELS)


def decide_at(
    look: int, old: Values, new: Values, *, better: Better, margin: float = MARGIN, rng: np.random.Generator,
    identical: bool = False,
) -> Judgement:  # fmt: skip
    """Judge the first `look` runs of both sides at this look's level.

    INCONCLUSIVE means go on to the next look; at the last one the budget is spent, and it stays. ValueError:
    no look is planned at this number of runs, or the sides do not share exactly so many.
    """
    if look not in LEVELS:
        raise ValueError(f"looks are at {', '.join(map(str, LOOKS))} runs, not at {look}")
    shared = sum(run in new for run in old)
    if shared != look or len(old) != look or len(new) != look:
        raise ValueError(f"a look at {look} runs got {len(old)} old and {len(new)} new ones, {shared} shared")
    judgement = judge(
        old, new, better=better, margin=margin, alpha=LEVELS[look], rng=rng, identical=identical
    )
    if look != LOOKS[-1] or judgement.verdict != "INCONCLUSIVE":
        return judgement
    spent = f"budget of {look} runs spent"
    return replace(judgement, note=f"{spent}; {judgement.note}" if judgement.note else spent)


def next_look(runs: int) -> int | None:
    """The first look beyond `runs` runs; None: there is none."""
    return next((look for look in LOOKS if look > runs), None)
