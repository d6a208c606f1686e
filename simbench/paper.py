"""What the paper printed: Shen et al., arXiv 2311.04410, Tables I to III and the text below them.

Which manoeuvre its scenario 1 and 2 are is not said (the figure is missing): 1 = approach, 2 = recede is
assumed, and labelled so wherever a value of these tables is shown. Its "TPR" is the precision of the mapped
points, here as shares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PaperTpr:
    """A row of Tables II and III: mean TPR and its SD over n frames before and after P-Fusion, t and p of the
    paired test, and of the one-sample test against 0.5 (right-tailed). 0.001 stands for "< .001".
    """

    scenario: str  # as the paper numbers it
    baseline: float
    baseline_sd: float
    fusion: float
    fusion_sd: float
    n: int
    paired_t: float
    paired_p: float
    half_t: float
    half_p: float


@dataclass(frozen=True, kw_only=True)
class PaperMae:
    """The mean of MAE X and MAE Y over n frames of both scenarios, and its SD [m]."""

    mean_m: float
    sd_m: float
    n: int


TABLE_I: Mapping[str, tuple[float, ...]] = {
    "car": (0.949, 1.0, 1.0, 1.0, 0.70, 1.0),
    "wearable": (1.0, 1.0, 1.0),
}
"""TPR of a static board by LiDAR-camera pair, in the paper's order of pairs."""

TABLE_II: Mapping[tuple[str, str], PaperTpr] = {
    ("overtake-approach", "car"): PaperTpr(
        scenario="S1", baseline=0.3172, baseline_sd=0.2530, fusion=0.6502, fusion_sd=0.1901, n=10,
        paired_t=8.01, paired_p=0.001, half_t=2.50, half_p=0.017,
    ),
    ("overtake-recede", "car"): PaperTpr(
        scenario="S2", baseline=0.6815, baseline_sd=0.2602, fusion=0.8165, fusion_sd=0.1793, n=19,
        paired_t=6.54, paired_p=0.001, half_t=7.69, half_p=0.001,
    ),
    ("overtake-approach", "wearable"): PaperTpr(
        scenario="S1", baseline=0.4876, baseline_sd=0.1601, fusion=0.6546, fusion_sd=0.1814, n=6,
        paired_t=3.82, paired_p=0.006, half_t=2.09, half_p=0.046,
    ),
    ("overtake-recede", "wearable"): PaperTpr(
        scenario="S2", baseline=0.5577, baseline_sd=0.2217, fusion=0.7529, fusion_sd=0.1293, n=10,
        paired_t=6.34, paired_p=0.001, half_t=6.19, half_p=0.001,
    ),
}  # fmt: skip
"""By scenario and rig of ours; with Table III's columns."""

PASSES = 2
"""Trials of each scenario."""

MAE: Mapping[str, PaperMae] = {
    "car": PaperMae(mean_m=1.15, sd_m=0.62, n=57),
    "wearable": PaperMae(mean_m=1.07, sd_m=0.68, n=45),
}
"""By the rig whose LiDAR located the other road user."""
