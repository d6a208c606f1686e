"""Every metric over the runs of a group: what rows of `result.json` have in common but for their seed."""

from __future__ import annotations

import dataclasses
from array import array
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import isnan, nan
from typing import Any

from scenarios.seeding import stream
from simbench.score.statistics import summarize

GROUP = ("block", "scenario", "system", "faults", "calibration", "pipeline")


@dataclass(frozen=True, kw_only=True)
class _Runs:
    """head: of the entry. values: by place in `seeds`, not a number where a run has none."""

    head: Mapping[str, Any]
    seeds: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))


@dataclass(frozen=True)
class Summaries:
    """Rows go in, entries of `summary` come out; 16 bytes a row stay."""

    _groups: dict[tuple[str, ...], dict[str, _Runs]] = field(default_factory=dict)

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        for row in rows:
            key = {name: row[name] for name in GROUP if name in row}
            metrics = self._groups.setdefault(tuple(key.values()), {})
            if row["metric"] not in metrics:
                metrics[row["metric"]] = _Runs(
                    head={**key, **{name: row[name] for name in ("metric", "unit", "better")}}
                )
            runs = metrics[row["metric"]]
            runs.seeds.append(row["seed"])
            runs.values.append(nan if row["value"] is None else row["value"])

    def content(self) -> Iterator[dict[str, Any]]:
        """Equal-weight means, group by group in the order in which they came."""
        for metrics in self._groups.values():
            for metric, runs in metrics.items():
                told = ("scenario", "system", "faults", "pipeline")
                rng = stream(0, "summary", *(runs.head[name] for name in told), metric)
                values = {
                    seed: None if isnan(value) else value
                    for seed, value in zip(runs.seeds, runs.values, strict=True)
                }
                yield {**runs.head, **dataclasses.asdict(summarize(values, rng))}
