"""How often the verdict is wrong, and how often it finds out: calibration from recorded per-run values.

    python3 dev.py run python tests/benchmarks/verdict.py [--trials 5000] [--jobs 2]

Six kinds of difference (tests/benchmarks/verdict_runs.py), margin d = 0.05, alpha = 0.05, fixed numbers of
runs and looks at 20, 40, 80. Promised: of a true loss of exactly d, PASS and REGRESSION at most alpha each.
Wanted: PASS of a loss of 0 and REGRESSION of a loss of 2 d in 80 %, where planning says that so many runs do.
Shares with their Clopper-Pearson 95 % intervals; `!`: the whole interval lies above alpha.
Both gates: that of the mean, and a limit on the share of gross failures, the share that makes up a loss of d.
Exit code 0: measured, whatever came out.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

import numpy as np
from jaxtyping import Bool, Float64
from scipy.special import stdtr

from scenarios.seeding import stream
from simbench.campaign.jobs import each_of
from simbench.score.statistics import BOOTSTRAP_RUNS
from simbench.verdict.bounds import candidates, draw_counts
from simbench.verdict.decide import ALPHA
from simbench.verdict.rare import share
from simbench.verdict.sequential import LEVELS, LOOKS
from tests.benchmarks.verdict_runs import BEFORE, GROSS, MARGIN, Kind, kinds, record

FIXED = (12, 20, 40, 80)
LOSSES = (1.0, 0.0, 2.0)  # in margins
RESAMPLES = 1999
AT_ONCE = 250
SHARE_LIMIT = BEFORE + MARGIN / GROSS


@dataclass(frozen=True, kw_only=True)
class Ends:
    """How trials ended by one rule. both: passed both gates; runs: mean number used."""

    passed: int
    regressed: int
    both: int
    runs: float


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One kind and true loss (in margins), by rule: a number of runs, or "looks"."""

    kind: str
    margins: float
    trials: int
    ends: Mapping[str, Ends]


def p_values(d: Float64[np.ndarray, "trials n"], rng: np.random.Generator) -> Float64[np.ndarray, "2 trials"]:
    """p of "the mean is at most -d" and of "at least -d" of each row: what `bounds` gives, many at once."""
    n = d.shape[1]
    if n < BOOTSTRAP_RUNS:
        off, error = d.mean(axis=1) + MARGIN, d.std(axis=1, ddof=1) / np.sqrt(n)
        t = np.divide(off, error, where=error > 1e-12, out=np.copysign(np.inf, off))
        return np.stack([stdtr(n - 1, -t), stdtr(n - 1, t)])
    beyond = []
    for i in range(0, len(d), AT_ONCE):
        means = candidates(d[i : i + AT_ONCE], draw_counts(n, RESAMPLES, rng))
        beyond.append(np.stack([(means <= -MARGIN).sum(axis=1), (means >= -MARGIN).sum(axis=1)]))
    return (1.0 + np.concatenate(beyond, axis=1)) / (RESAMPLES + 1.0)


def share_passes(d: Float64[np.ndarray, "trials n"], alpha: float) -> Bool[np.ndarray, " trials"]:
    """Whether the second gate's upper bound of the share of gross failures stays within the limit."""
    n = d.shape[1]
    within = np.array([share(failed, n, alpha).high <= SHARE_LIMIT for failed in range(n + 1)])
    return np.asarray(within[(d < -GROSS / 2).sum(axis=1)])


def cell_of(kind: Kind, margins: float, trials: int) -> Cell:
    d = kind.draws(stream(0, "verdict", kind.name, f"{margins:g}"), trials, max(FIXED), margins * MARGIN)
    p = {n: p_values(d[:, :n], stream(0, "bootstrap", kind.name, f"{margins:g}", n)) for n in FIXED}
    ends = {str(n): _ends(d, p, (n,), {n: ALPHA}) for n in FIXED}
    ends["looks"] = _ends(d, p, LOOKS, {look: LEVELS[look] for look in LOOKS})
    return Cell(kind=kind.name, margins=margins, trials=trials, ends=ends)


def _ends(
    d: Float64[np.ndarray, "trials n"], p: Mapping[int, Float64[np.ndarray, "2 trials"]],
    looks: Sequence[int], levels: Mapping[int, float],
) -> Ends:  # fmt: skip
    passed = regressed = both = 0
    going = open_yet = np.ones(len(d), dtype=bool)  # with the mean's gate alone, with both
    used = np.full(len(d), looks[-1])
    for look in looks:
        passes, regresses = (going & (side <= levels[look]) for side in p[look])
        passed += int(passes.sum())
        regressed += int(regresses.sum())
        used[passes | regresses] = look
        going = going & ~(passes | regresses)
        held = (p[look][0] <= levels[look]) & share_passes(d[:, :look], levels[look])
        both += int((open_yet & held).sum())
        open_yet = open_yet & ~held & (p[look][1] > levels[look])
    return Ends(passed=passed, regressed=regressed, both=both, runs=float(used.mean()))


def cells(trials: int, jobs: int) -> tuple[Cell, ...]:
    tasks = [(place, margins, trials) for place in range(len(kinds())) for margins in LOSSES]
    return tuple(each_of(_task, tasks, jobs))


def _task(task: tuple[int, float, int]) -> Cell:
    place, margins, trials = task
    return cell_of(kinds()[place], margins, trials)


def table(found: Sequence[Cell]) -> list[tuple[str, ...]]:
    """A row for each kind and rule."""
    rows: list[tuple[str, ...]] = [
        ("kind", "runs", "loss d: PASS", "loss d: REGRESSION", "loss 0: PASS", "loss 2d: REGRESSION")
    ]
    for kind in dict.fromkeys(cell.kind for cell in found):
        at, none, twice = _of(found, kind)
        for rule in at.ends:
            e, n = [cell.ends[rule] for cell in (at, none, twice)], at.trials
            runs = rule if rule != "looks" else "looks, mean " + ", ".join(f"{ends.runs:.0f}" for ends in e)
            rows.append(
                (kind, runs, shown(e[0].passed, n, ALPHA), shown(e[0].regressed, n, ALPHA),
                 shown(e[1].passed, n), shown(e[2].regressed, n))
            )  # fmt: skip
    return rows


def both_gates(found: Sequence[Cell]) -> list[tuple[str, ...]]:
    """What both gates let through of the kind with gross failures."""
    three = _of(found, found[-1].kind)
    rows: list[tuple[str, ...]] = [("runs", *(f"loss {word}: both pass" for word in ("d", "0", "2d")))]
    for rule in three[0].ends:
        rows.append((rule, *(shown(cell.ends[rule].both, cell.trials) for cell in three)))
    return rows


def _of(found: Sequence[Cell], kind: str) -> list[Cell]:
    return [next(c for c in found if (c.kind, c.margins) == (kind, margins)) for margins in LOSSES]


def shown(hits: int, trials: int, promised: float | None = None) -> str:
    """`0.051 (.045-.057)`, with a `!` where a promise is broken beyond chance."""
    both = share(hits, trials, 0.025)
    broken = " !" if promised is not None and both.low > promised else ""
    return f"{hits / trials:.3f} ({both.low:.3f}-{both.high:.3f}){broken}"


def markdown(rows: Sequence[Sequence[str]]) -> str:
    lines = [" | ".join(row) for row in (rows[0], ["---"] * len(rows[0]), *rows[1:])]
    return "\n".join(f"| {line} |" for line in lines)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="verdict.py", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--trials", type=int, default=5000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--record", type=Path, metavar="RUN", help="keep the per-run values of a simbench run"
    )
    options = parser.parse_args(arguments)
    if options.record:
        record(options.record)
        return 0
    began = time.monotonic()
    found = cells(options.trials, options.jobs)
    for kind in kinds():
        print(f"* {kind.name}: {kind.says}")
    print(f"\n{options.trials} trials each\n\n{markdown(table(found))}")
    print(f"\n{found[-1].kind}, both gates, at most {SHARE_LIMIT:.0%} of runs may fail\n")
    print(markdown(both_gates(found)))
    print(f"\n{time.monotonic() - began:.0f} s")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
