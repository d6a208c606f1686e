"""Groups that are judged together: those that differ by their scenario only, where there are 20 or more.

So many are taken as a sample of all scenarios, and the claim is about these; fewer are fixed, each a group by
itself.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass

from simbench.score.metrics import Metric
from simbench.suite.side import Side
from simbench.verdict.differences import Values
from simbench.verdict.nested import SCENARIOS


@dataclass(frozen=True, kw_only=True)
class Pool:
    """groups: one by itself, or 20 and more."""

    name: str
    groups: tuple[str, ...]

    @property
    def is_sample(self) -> bool:
        """Whether its scenarios stand for others."""
        return len(self.groups) >= SCENARIOS

    def values(self, side: Side, metric: Metric) -> Values:
        """By seed, of a sample by case (group/seed)."""
        return {
            f"{name}/{seed}" if self.is_sample else int(seed): run.values.get(metric.name)
            for name in self.groups
            for seed, run in side.groups[name].runs.items()
        }

    def case(self, run: Hashable) -> tuple[str, int]:
        """Group and seed of a key of `values`."""
        group, _, seed = str(run).rpartition("/")
        return group or self.name, int(seed)


def pools_of(names: Iterable[str]) -> list[Pool]:
    """Of groups by their names, in their order."""
    alike: dict[tuple[str, ...], list[str]] = {}
    for name in names:
        block, _, rest = name.partition("/")
        alike.setdefault((block, rest.partition("/")[2]), []).append(name)
    pools = []
    for (block, rest), groups in alike.items():
        if len(groups) >= SCENARIOS:
            pools.append(Pool(name=f"{block}/{len(groups)} scenarios/{rest}", groups=tuple(groups)))
        else:
            pools += [Pool(name=name, groups=(name,)) for name in groups]
    return pools


def group_of(case: Hashable) -> str:
    """Of a case (group/seed). In a sample every group is a scenario."""
    return str(case).rpartition("/")[0]
