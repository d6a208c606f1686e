"""Whether a frontier's bounds hold what they promise, and what the search saves.

    python3 dev.py run python tests/benchmarks/frontier.py [--trials 2000] [--runs 20,40]

Four synthetic curves, a quarter of the trials each. coverage: how often the true first crossing lies at or
beyond "safe to" (95 % promised; a curve that never crosses cannot be missed), and within the two-sided
interval. unshown: how often nothing could be called safe. rms: of the best estimate's error. dense: how many
even levels, read without a model, are as accurate; ratio: the search's levels to these. even: to as many even
levels as it takes to lie as close together as the search's do around its best estimate.
Exit code 0: measured, whatever came out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

import numpy as np

from simbench.frontier.crossing import Answer
from simbench.frontier.curve import Functional
from simbench.frontier.search import Goal
from tests.benchmarks.frontier_trials import CURVES, on_a_grid, trial_of, truth

DENSE = (10, 20, 40, 80, 160, 320)
DENSE_TRIALS = 100
BAND = (0.937, 0.962)  # 95 % +- 2.6 standard errors of 2,000 trials


@dataclass(frozen=True, kw_only=True)
class Row:
    """One curve and functional. dense: levels of an even grid as accurate; None: more than the densest."""

    curve: str
    trials: int
    bound: int
    interval: int
    unshown: int
    error: float
    levels: float
    even: float
    dense: int | None


def covered(answer: Answer, true: float | None) -> tuple[bool, bool]:
    """Whether "safe to" and the interval hold a true crossing. Nothing called safe: a bound of 0."""
    end = 1.0 if true is None else true
    bound = (answer.safe_to or 0.0) <= end
    if answer.interval is None:
        return bound, True
    low, high = answer.interval
    return bound, low <= end and (high is None or (true is not None and true <= high))


def row_of(curve: str, functional: Functional, runs: int, trials: int, grids: Sequence[int] = DENSE) -> Row:
    true = truth(curve, functional)
    end = 1.0 if true is None else true
    found = [trial_of(curve, Goal(functional=functional), trial, runs) for trial in range(trials)]
    held = [covered(answer, true) for answer, _ in found]
    error = _rms([(1.0 if a.best is None else a.best) - end for a, _ in found])
    dense = None
    if true is not None:
        for count in grids:
            errors = [
                on_a_grid(curve, functional, trial, runs, count) - end
                for trial in range(min(trials, DENSE_TRIALS))
            ]
            if _rms(errors) <= error:
                dense = count
                break
    return Row(
        curve=curve,
        trials=trials,
        bound=sum(bound for bound, _ in held),
        interval=sum(interval for _, interval in held),
        unshown=sum(not answer.safe_to for answer, _ in found),
        error=error,
        levels=float(np.mean([len(levels) for _, levels in found])),
        even=float(np.median([_to_even(answer, levels) for answer, levels in found])),
        dense=dense,
    )


def _to_even(answer: Answer, levels: Sequence[float]) -> float:
    """Levels of the search to those of an even grid as fine as it is around its best estimate."""
    if answer.best is None:
        return 1.0
    right = min(max(int(np.searchsorted(levels, answer.best)), 1), len(levels) - 1)
    return len(levels) / (1.0 + 1.0 / (levels[right] - levels[right - 1]))


def _rms(errors: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="frontier.py", description=__doc__.partition("\n")[0])
    parser.add_argument("--trials", type=int, default=2000, help="of each functional, over the four curves")
    parser.add_argument("--runs", default="20,40", help="seeds a level")
    options = parser.parse_args(arguments)
    each = max(options.trials // len(CURVES), 1)
    print(f"{'':32s}{'coverage':>18s}{'':>9s}{'rms':>8s}{'levels':>8s}{'dense':>7s}{'ratio':>8s}{'even':>8s}")
    print(f"{'functional, runs, curve':32s}{'bound':>9s}{'interval':>9s}{'unshown':>9s}")
    for functional in ("mean", "share"):
        for runs in (int(word) for word in options.runs.split(",")):
            rows = [row_of(curve, functional, runs, each) for curve in CURVES]
            for row in rows:
                _print(f"{functional} {runs} {row.curve}", row)
            total = sum(row.trials for row in rows)
            bound, interval = (
                sum(getattr(row, word) for row in rows) / total for word in ("bound", "interval")
            )
            verdict = "within" if BAND[0] <= bound <= BAND[1] else "outside"
            print(f"{'  all four':32s}{bound:9.1%}{interval:9.1%}   {verdict} 93.7-96.2 %\n", flush=True)
    return 0


def _print(name: str, row: Row) -> None:
    n = row.trials
    never = row.curve == "never crosses"
    dense = "-" if never else f">{DENSE[-1]}" if row.dense is None else str(row.dense)
    ratio = "-" if never else f"{'<' if row.dense is None else ''}{row.levels / (row.dense or DENSE[-1]):.2f}"
    print(
        f"{name:32s}{row.bound / n:9.1%}{row.interval / n:9.1%}{row.unshown / n:9.1%}{row.error:8.4f}"
        f"{row.levels:8.1f}{dense:>7s}{ratio:>8s}{'-' if never else f'{row.even:.2f}':>8s}",
        flush=True,
    )


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
