"""Answers as requirements: sentences, `requirements.yaml`, CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor, log10
from typing import Any

import numpy as np
import yaml

from scenarios.faults import FAULTS
from simbench.frontier.question import Question
from simbench.frontier.search import Found, Goal, runs_for, shown_share
from simbench.score.statistics import MIN_RUNS
from simbench.stress.axes import Axis

SCHEMA = "simbench-requirements/1"
UNITS = ("ms", "s", "deg", "m", "px", "ppm", "hz", "mps", "ns", "us", "mm", "dps")  # that end a field's name


@dataclass(frozen=True, kw_only=True, eq=False)
class Requirement:
    """A question's answer along an axis. seeds: of its runs."""

    axis: Axis
    question: Question
    goal: Goal
    found: Found
    seeds: tuple[int, ...]

    @property
    def unit(self) -> str:
        if self.axis.fault is not None and self.axis.path == FAULTS[self.axis.fault].strength:
            return FAULTS[self.axis.fault].unit
        last = self.axis.path.rpartition("_")[2]
        return last if last in UNITS else ""

    @property
    def step(self) -> float:
        """What numbers are rounded to: a hundredth to a thousandth of the range."""
        low, high = self.axis.ends
        return float(10.0 ** (floor(log10(high - low)) - 2))

    def value(self, level: float | None) -> float | None:
        """A level (0 to 1) as a value of the axis."""
        low, high = self.axis.ends
        return None if level is None else low + level * (high - low)

    def rounded(self, level: float | None, *, down: bool = False) -> float | None:
        """A level as a value of the axis, to the step; `down`: never more than it is."""
        value = self.value(level)
        if value is None:
            return None
        steps = floor(value / self.step + 1e-6) if down else round(value / self.step)
        return float(f"{max(steps * self.step, self.axis.ends[0]):.9g}")

    def said(self, level: float | None, *, down: bool = False) -> str:
        """The same with its unit."""
        value = self.rounded(level, down=down)
        return "" if value is None else f"{value:g} {self.unit}".rstrip()

    @property
    def safe_to(self) -> float | None:
        return self.rounded(self.found.answer.safe_to, down=True)

    @property
    def all_kept(self) -> bool:
        """Whether no run broke the limit at any level."""
        return bool((self.found.margins >= 0.0).all())

    @property
    def note(self) -> str | None:
        """What the number of runs allows."""
        n, least = len(self.seeds), self.goal.share
        if n < MIN_RUNS:
            return f"n = {n} run{'' if n == 1 else 's'}: illustration"
        if self.goal.functional == "mean" or n >= runs_for(least) or self.found.answer.broken_at_start:
            return None
        needed = f"{least:g} takes {runs_for(least)}"
        if self.all_kept:
            return f"{n} runs without a failure show a share of {shown_share(n):.2f}; {needed}"
        return (
            f"{n} runs without a failure show a share of {shown_share(n):.2f} only, {needed}: the bound "
            + ("leans on the logistic curve" if self.goal.monotone else "leans on the curve's smoothness")
        )

    @property
    def sentence(self) -> str:
        """The answer in words."""
        answer, name = self.found.answer, self.question.pipeline
        end = self.said(1.0)
        if answer.broken_at_start:
            return f"{name} breaks it at {self.said(0.0)} already"
        if answer.best is None and answer.safe_to == 1.0:
            return f"{name} is safe to >= {end} (the whole range)"
        best = (
            f"best estimate {self.said(answer.best)}"
            if answer.best is not None
            else f"not broken up to {end}"
        )
        if len(self.seeds) < MIN_RUNS:
            return f"{name}: {best}, no bound"
        if answer.safe_to is None:
            return f"{name} is not shown safe anywhere ({best})"
        return f"{name} is safe to >= {self.said(answer.safe_to, down=True)} ({best})"

    @property
    def again(self) -> str | None:
        """Where the limit holds once more after it was broken."""
        parts = [f"{self.said(a)} to {self.said(b)}" for a, b in self.found.answer.again]
        return f"holds again from {', '.join(parts)}: not counted" if parts else None

    def measured(self) -> np.ndarray:
        """The functional at every level as it was measured, a share, or the mean margin."""
        if self.goal.functional == "share":
            return np.asarray((self.found.margins >= 0.0).mean(axis=1))
        return np.asarray(self.found.margins.mean(axis=1))


def goal_words(goal: Goal) -> str:
    """What must keep a limit."""
    if goal.functional == "mean":
        return "mean over runs"
    curve = ", taken to fall only (logistic)" if goal.monotone else ""
    return f"share of runs that keep it >= {goal.share:g}{curve}"


def as_yaml(found: Sequence[Requirement], about: Mapping[str, Any]) -> str:
    """`requirements.yaml`. about: the scenario set and what was told to the bench."""
    content = {"schema": SCHEMA, **about, "requirements": [_entry(item) for item in found]}
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=100)


def as_csv(found: Sequence[Requirement], about: Mapping[str, Any]) -> str:
    """The same, one line each."""
    text = io.StringIO()
    lines = []
    for item in found:
        entry = _entry(item)
        low, high = entry.pop("interval_95") or (None, None)
        entry["holds_again"] = "; ".join(f"{a:g}-{b:g}" for a, b in entry["holds_again"])
        lines.append({**entry, "interval_low": low, "interval_high": high, **_flat(about)})
    writer = csv.DictWriter(text, fieldnames=list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()


def _entry(item: Requirement) -> dict[str, Any]:
    answer = item.found.answer
    shown = answer.safe_to is not None and not answer.broken_at_start
    low, high = answer.interval or (None, None)
    return {
        "requirement": f"{item.axis.name} <= {item.said(answer.safe_to, down=True)}" if shown else None,
        "pipeline": item.question.pipeline,
        "limit": item.question.limit,
        "holds_for": goal_words(item.goal),
        "axis": item.axis.name,
        "unit": item.unit,
        "safe_to": item.safe_to if shown else None,
        "best_estimate": item.rounded(answer.best),
        "interval_95": [item.rounded(low, down=True), item.rounded(high)] if answer.interval else None,
        "searched_from": item.axis.ends[0],
        "searched_to": item.axis.ends[1],
        "runs": len(item.seeds),
        "levels": len(item.found.levels),
        "holds_again": [[item.rounded(a), item.rounded(b)] for a, b in answer.again],
        "said": item.sentence,
        "note": item.note,
    }


def _flat(about: Mapping[str, Any]) -> dict[str, Any]:
    return {key: " ".join(map(str, v)) if isinstance(v, list) else v for key, v in about.items()}
