"""What the page calls our own pipelines: a name, a short one for axes, and one line on what each takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from simbench.case import ORACLE


@dataclass(frozen=True, kw_only=True)
class PlainName:
    """`name` stands in tables, `short` at axes (at most 14 letters). `takes`: which points are the
    object's."""

    name: str
    short: str
    takes: str


OURS: Mapping[str, PlainName] = {
    "static_projection": PlainName(
        name="raw box", short="raw box", takes="All points in the box: the paper's baseline."
    ),
    "static_projection_ground": PlainName(
        name="raw box, ground removed", short="no ground", takes="All points in the box but the ground."
    ),
    "probabilistic": PlainName(
        name="six steps",
        short="six steps",
        takes="The paper's method: modes of the distance in a wider box, of these the most similar shape.",
    ),
    "probabilistic_paper": PlainName(
        name="six steps as printed",
        short="as printed",
        takes="The same to the letter: 16 trials for a plane, or no ground at all; plain 2 SD.",
    ),
    "shrunken_median": PlainName(
        name="median of the box's middle",
        short="box's middle",
        takes="Points near the median distance of the box's middle half.",
    ),
    "nearest_gap": PlainName(
        name="nearest, up to a gap",
        short="up to a gap",
        takes="From the box's nearest point to the first gap of 0.5 m in range (Autoware's closest cluster).",
    ),
    "frustum_dbscan": PlainName(
        name="largest cluster in the box",
        short="largest",
        takes="The largest DBSCAN cluster among the box's points.",
    ),
    "roi_cluster": PlainName(
        name="best-fitting cluster",
        short="best fit",
        takes="The cluster of the whole sweep that fits the box best (Autoware's ROI cluster fusion).",
    ),
    "robust": PlainName(
        name="clusters over time",
        short="over time",
        takes="Ours: clusters of the deskewed sweep matched to boxes over time, and the centre behind them.",
    ),
    ORACLE: PlainName(
        name="oracle",
        short="oracle",
        takes="No pipeline: all true points of the target, then the same steps.",
    ),
}
