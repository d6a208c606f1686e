"""The paper's method with one thing changed: each step removed or replaced in turn, and each alternative
reading of the text. A variant is a pipeline by its reference, `fusion.pipelines.variants:NAME`.

Step 6 removed needs no variant: positions before smoothing are scored beside those after it (`.raw`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fusion.aoi import AoiConfig
from fusion.clustering import ClusteringConfig
from fusion.ground import GroundConfig
from fusion.localize import LocalizeConfig
from fusion.pipelines.probabilistic import CATEGORIES, Probabilistic, ProbabilisticConfig
from fusion.shape import ShapeConfig
from fusion.smooth import SmootherConfig

EVERYTHING_M = 1e4


@dataclass(frozen=True, kw_only=True)
class Variant:
    """step: of the six that it changes (0: several). what: `removed`, or what stands in its place."""

    step: int
    title: str
    what: str
    config: ProbabilisticConfig

    def __call__(self) -> Probabilistic:
        """The pipeline."""
        return Probabilistic(self.config)


_OURS = ProbabilisticConfig()


def _bins(times: float) -> ProbabilisticConfig:
    """All bins so many times as wide."""
    return replace(
        _OURS, categories=tuple(replace(one, granularity_m=times * one.granularity_m) for one in CATEGORIES)
    )


no_ground = Variant(
    step=1, title="ground removal", what="removed",
    config=replace(_OURS, ground=GroundConfig(distance_m=0.0, length_m=EVERYTHING_M, width_m=EVERYTHING_M)),
)  # fmt: skip
paper_ground = Variant(
    step=1, title="ground removal", what="as printed: 16 trials, 80 % or nothing",
    config=replace(_OURS, ground=GroundConfig.paper()),
)  # fmt: skip
no_widening = Variant(
    step=2, title="enlarged box", what="removed: the box as it is",
    config=replace(_OURS, aoi=AoiConfig(widen=0.0)),
)  # fmt: skip
all_sides = Variant(
    step=2, title="enlarged box", what="also 100 % higher",
    config=replace(_OURS, aoi=AoiConfig(widen=1.0, heighten=1.0)),
)  # fmt: skip
twice_each_side = Variant(
    step=2, title="enlarged box", what="a whole width on either side",
    config=replace(_OURS, aoi=AoiConfig(widen=2.0)),
)  # fmt: skip
no_clusters = Variant(
    step=3, title="distance clusters", what="removed: all points of the box are one",
    config=_bins(EVERYTHING_M),
)  # fmt: skip
plain_k_means = Variant(
    step=3, title="distance clusters", what="plain K-means, not trimmed",
    config=replace(_OURS, clustering=ClusteringConfig.paper()),
)  # fmt: skip
half_bins = Variant(step=3, title="distance clusters", what="bins half as wide", config=_bins(0.5))
double_bins = Variant(step=3, title="distance clusters", what="bins twice as wide", config=_bins(2.0))
no_shape = Variant(
    step=4, title="shape similarity", what="removed: the cluster of most points",
    config=replace(_OURS, shape=ShapeConfig(pick="most_points")),
)  # fmt: skip
literal_argmax = Variant(
    step=4, title="shape similarity", what="as printed: argmax of KL, the least similar",
    config=replace(_OURS, shape=ShapeConfig(pick="least_similar")),
)  # fmt: skip
no_rotation = Variant(
    step=4, title="shape similarity", what="clusters are not rotated",
    config=replace(_OURS, shape=ShapeConfig(max_rotation_deg=0.0)),
)  # fmt: skip
mean_point = Variant(
    step=5, title="distance and angle", what="mean of all points, not the median point",
    config=replace(_OURS, localize=LocalizeConfig(representative="mean")),
)  # fmt: skip
paper_smoother = Variant(
    step=6, title="smoother", what="as printed: twice the plain standard deviation",
    config=replace(_OURS, smoother=SmootherConfig.paper()),
)  # fmt: skip
as_printed = Variant(
    step=0, title="several", what="ground, clusters and smoother as printed",
    config=ProbabilisticConfig.paper(),
)  # fmt: skip
