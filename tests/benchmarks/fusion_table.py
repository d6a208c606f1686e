"""Tables of `docs/fusion.md` from the result.json of runs: a mean over runs and its one-sided 95 % bound.

    python3 dev.py run simbench run ... --out out/clean
    python3 dev.py run python tests/benchmarks/fusion_table.py out/clean --must clean

The bound is on the side that a limit has to fear: the lower one of what should be high, the upper one of what
should be low. From 20 runs on it is BCa's, from 6 on Student's, below there is none. A run without a value
counts as missing, is printed, and fails the limit.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.seeding import stream
from simbench.score.statistics import BOOTSTRAP_RUNS, MIN_RUNS, bca_interval, paired, t_interval

SHOWN = ("tpr", "hit_rate", "precision", "recall", "mae_m.smooth", "coverage.smooth", "gross_rate.smooth")
Group = tuple[str, str, str, str]  # scenario, system, faults, pipeline
Runs = Mapping[int, float | None]  # by seed

MUST: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "clean": {
        "car": {"precision": 0.99, "recall": 0.80, "mae_m.smooth": 0.06, "coverage.smooth": 0.98},
        "wearable": {"precision": 0.99, "recall": 0.80, "mae_m.smooth": 0.15, "coverage.smooth": 0.98},
    },
    "errors": {
        "car": {
            "precision": 0.97, "recall": 0.65, "mae_m.smooth": 0.10, "gross_rate.smooth": 0.01,
            "coverage.smooth": 0.95,
        },
        "wearable": {
            "precision": 0.97, "recall": 0.65, "mae_m.smooth": 0.20, "gross_rate.smooth": 0.01,
            "coverage.smooth": 0.95,
        },
    },
}  # fmt: skip
"""What `robust` must hold, by kind of run and system."""


@dataclass(frozen=True, kw_only=True)
class Value:
    """A metric over runs. `bound`: where it may be at worst; None below 6 runs."""

    mean: float | None
    bound: float | None
    higher: bool
    missing: int

    def keeps(self, limit: float) -> bool:
        """Whether the bound keeps the limit; a missing run or a missing bound does not."""
        if self.bound is None or self.missing:
            return False
        return self.bound >= limit if self.higher else self.bound <= limit


def read(folders: Iterable[Path]) -> list[dict[str, Any]]:
    """All rows of several runs."""
    rows: list[dict[str, Any]] = []
    for folder in folders:
        path = folder / "result.json" if folder.is_dir() else folder
        rows += json.loads(path.read_text(encoding="utf-8"))["rows"]
    return rows


def grouped(rows: Iterable[Mapping[str, Any]]) -> dict[Group, dict[str, dict[int, float | None]]]:
    """Values by group, metric and seed."""
    found: dict[Group, dict[str, dict[int, float | None]]] = {}
    for row in rows:
        key = (row["scenario"], row["system"], row["faults"], row["pipeline"])
        found.setdefault(key, {}).setdefault(row["metric"], {})[row["seed"]] = row["value"]
    return found


def value(runs: Runs, higher: bool, *path: str) -> Value:
    """The mean over runs that have one, and its bound. `path` names the random numbers of the bootstrap."""
    known = np.array([v for v in runs.values() if v is not None], dtype=np.float64)
    bound = None
    if len(known) >= MIN_RUNS:
        two_sided = (
            bca_interval(known, stream(0, "fusion table", *path), level=0.9)
            if len(known) >= BOOTSTRAP_RUNS
            else t_interval(known, level=0.9)
        )
        bound = two_sided[0] if higher else two_sided[1]
    mean = float(known.mean()) if len(known) else None
    return Value(mean=mean, bound=bound, higher=higher, missing=len(runs) - len(known))


def table(rows: Sequence[Mapping[str, Any]], must: str | None, metrics: Sequence[str]) -> list[str]:
    """Markdown lines: a row per scenario, system, fault set and pipeline."""
    better = {row["metric"]: row["better"] == "higher" for row in rows}
    lines = ["| scenario | rig | pipeline | " + " | ".join(f"`{m}`" for m in metrics) + " |"]
    lines.append("|" + "---|" * (3 + len(metrics)))
    for (scenario, system, faults, pipeline), values in grouped(rows).items():
        name = short(pipeline)
        if name == "oracle":
            continue
        limits = MUST[must][system] if must is not None and name == "robust" else {}
        cells = []
        for metric in metrics:
            found = value(values[metric], better[metric], scenario, system, faults, pipeline, metric)
            cells.append(_cell(found, limits.get(metric)))
        lines.append(f"| {scenario} | {system} | {name} | " + " | ".join(cells) + " |")
    return lines


def _cell(found: Value, limit: float | None) -> str:
    text = "-" if found.mean is None else f"{found.mean:.3f}"
    if found.bound is not None:
        text += f" ({'≥' if found.higher else '≤'} {found.bound:.3f})"
    if found.missing:
        text += f", {found.missing} without"
    if limit is not None and not found.keeps(limit):
        text = f"**{text}**"
    return text


def against(rows: Sequence[Mapping[str, Any]], baseline: str, metrics: Sequence[str]) -> list[str]:
    """Markdown lines: what each pipeline has more than a baseline, paired by seed, and the exact test's p."""
    groups = grouped(rows)
    lines = ["| scenario | rig | pipeline | metric | difference | 95 % interval | p |", "|" + "---|" * 7]
    for (scenario, system, faults, pipeline), values in groups.items():
        if short(pipeline) in (baseline, "oracle"):
            continue
        base = next((g for k, g in groups.items() if k[:3] == (scenario, system, faults)
                     and short(k[3]) == baseline), None)  # fmt: skip
        if base is None:
            raise SystemExit(f"fusion_table.py: {scenario}, {system} has no runs of {baseline}")
        for metric in metrics:
            rng = stream(0, "fusion table", scenario, system, faults, pipeline, metric)
            found = paired(base[metric], values[metric], rng)
            d = found.difference
            if d.mean is None:
                continue
            ci = "-" if d.ci95 is None else f"{d.ci95[0]:+.3f} to {d.ci95[1]:+.3f}"
            p = "-" if found.sign_flip_p is None else f"{found.sign_flip_p:.2g}"
            lines.append(
                f"| {scenario} | {system} | {short(pipeline)} | `{metric}` | {d.mean:+.3f} | {ci} | {p} |"
            )
    return lines


def short(pipeline: str) -> str:
    """The name without the file that it comes from."""
    return pipeline.rpartition(":")[2]


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="fusion_table.py", description=__doc__.partition("\n")[0])
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="folders of `simbench run`")
    parser.add_argument("--must", choices=sorted(MUST), help="mark in bold what robust's bound does not keep")
    parser.add_argument("--against", metavar="PIPELINE", help="also differences from this one")
    parser.add_argument("--metrics", nargs="+", default=list(SHOWN))
    options = parser.parse_args(arguments)
    rows = read(options.runs)
    print("\n".join(table(rows, options.must, options.metrics)))
    if options.against:
        print()
        print("\n".join(against(rows, options.against, options.metrics)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
