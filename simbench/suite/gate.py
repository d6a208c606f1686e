"""One question that a suite asks of a group of runs, and its answer. All gates of a run, worst first.

| kind | asks |
|---|---|
| `runs` | did every run end well |
| `limit` | does the mean over the runs keep an absolute limit |
| `baseline` | is a metric's mean worse than the baseline's by more than its margin |
| `rare` | are there gross failures where the baseline had none |
| `canary` | did the case fail that must |
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

Kind = Literal["runs", "limit", "baseline", "rare", "canary"]
ASKS: Final = ("limit", "baseline", "rare")
"""Kinds that ask something of the numbers."""
Outcome = Literal["ERROR", "REGRESSION", "FAIL", "INCONCLUSIVE", "PASS"]
WORST_FIRST: Final[tuple[Outcome, ...]] = ("ERROR", "REGRESSION", "FAIL", "INCONCLUSIVE", "PASS")
EXIT: Final = {"PASS": 0, "FAIL": 1, "REGRESSION": 1, "ERROR": 1, "INCONCLUSIVE": 4}
BENCH: Final = 3


@dataclass(frozen=True, kw_only=True)
class Gate:
    """old, new: means over runs, in `unit`. threshold: in words. difference: new - old, turned so that more
    is better; low, high: its one-sided bounds, of a limit the interval of the mean. n: runs that count. ours:
    an ERROR that the bench or the suite is to blame for, not the pipeline. beyond: by how much the gate is
    missed, in margins or limits, for the order. worst: the seed of the worst run; worst_group: its group,
    where that is not `group`."""

    group: str
    kind: Kind
    metric: str
    unit: str
    outcome: Outcome
    threshold: str = ""
    old: float | None = None
    new: float | None = None
    difference: float | None = None
    low: float | None = None
    high: float | None = None
    n: int = 0
    note: str = ""
    ours: bool = False
    beyond: float = 0.0
    worst: int | None = None
    worst_group: str | None = None
    margin: float | None = None
    limit: float | None = None

    @property
    def name(self) -> str:
        """What a test report calls it."""
        return f"{self.kind} {self.metric}" if self.metric else self.kind


def worst_first(gates: Iterable[Gate]) -> list[Gate]:
    """By outcome, then by how far beyond."""
    return sorted(
        gates, key=lambda g: (WORST_FIRST.index(g.outcome), not g.ours, -g.beyond, g.group, g.metric)
    )


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What a suite's run comes to. gates: worst first. problems: what is wrong with the run as a whole, each
    an ERROR of the bench's or of whoever asked. notes: what else a reader should know."""

    gates: tuple[Gate, ...]
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def outcome(self) -> Outcome:
        """The worst of all; INCONCLUSIVE where nothing was asked but whether the runs ended well."""
        if self.problems:
            return "ERROR"
        asked = [gate.outcome for gate in self.gates if gate.kind in ASKS or gate.outcome != "PASS"]
        return min(asked, key=WORST_FIRST.index, default="INCONCLUSIVE")

    @property
    def exit_code(self) -> int:
        """0 pass, 1 regression, failed limit or failed pipeline, 3 the bench, 4 inconclusive."""
        if self.problems or any(gate.outcome == "ERROR" and gate.ours for gate in self.gates):
            return BENCH
        return EXIT[self.outcome]

    @property
    def sentence(self) -> str:
        """The headline."""
        if self.problems:
            return f"ERROR: {self.problems[0]}"
        counts = [(o, sum(gate.outcome == o for gate in self.gates)) for o in WORST_FIRST]
        told = ", ".join(f"{count} {outcome}" for outcome, count in counts if count)
        if self.outcome == "INCONCLUSIVE" and not any(gate.kind in ASKS for gate in self.gates):
            return "INCONCLUSIVE: nothing was asked; give the suite limits, or a baseline with --against"
        return f"{self.outcome}: {told}"


def number(value: float | None, digits: int = 3) -> str:
    """A value as tables show it."""
    return "–" if value is None else f"{value:.{digits}f}"


def as_lines(gates: Sequence[Gate], most: int = 40) -> list[str]:
    """A table for a terminal, worst first; passes are counted only where there are many."""
    shown = [gate for gate in gates if gate.outcome != "PASS"] or list(gates)
    shown = shown[:most]
    cells = [
        (g.outcome, g.name, g.group, number(g.old), number(g.new), g.threshold, interval(g), g.note)
        for g in shown
    ]
    head = ("verdict", "gate", "group", "old", "new", "threshold", "difference or interval", "")
    widths = [max(len(row[i]) for row in [head, *cells]) for i in range(len(head) - 1)]
    lines = ["  ".join([*(w.ljust(n) for w, n in zip(row, widths, strict=False)), row[-1]]).rstrip()
             for row in [head, *cells]]  # fmt: skip
    left = len(gates) - len(shown)
    return [*lines, f"and {left} more"] if left else lines


def interval(gate: Gate) -> str:
    """Difference with its bounds, or the interval of a mean."""
    if gate.difference is None and gate.low is None:
        return ""
    bounds = "" if gate.low is None or gate.high is None else f" [{gate.low:+.3f}, {gate.high:+.3f}]"
    if gate.difference is None:
        return bounds.replace("+", "").strip()
    return f"{gate.difference:+.3f}{bounds}"
