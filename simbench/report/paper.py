"""What the paper printed, to be shown beside our runs: Shen et al., arXiv 2311.04410, Table II.

Which manoeuvre its scenario 1 and 2 are is not said (the figure is missing): 1 = approach, 2 = recede is
assumed, and labelled so wherever a value of this table is shown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PaperTpr:
    """Mean TPR (shares) before and after P-Fusion over n frames."""

    scenario: str  # as the paper numbers it
    baseline: float
    fusion: float
    n: int


TABLE_II: Mapping[tuple[str, str], PaperTpr] = {
    ("overtake-approach", "car"): PaperTpr(scenario="S1", baseline=0.3172, fusion=0.6502, n=10),
    ("overtake-recede", "car"): PaperTpr(scenario="S2", baseline=0.6815, fusion=0.8165, n=19),
    ("overtake-approach", "wearable"): PaperTpr(scenario="S1", baseline=0.4876, fusion=0.6546, n=6),
    ("overtake-recede", "wearable"): PaperTpr(scenario="S2", baseline=0.5577, fusion=0.7529, n=10),
}
