"""Why the bootstrap is studentised: how often each kind of bound passes a true loss of exactly the margin.

    python3 dev.py run python tests/benchmarks/verdict_methods.py [--trials 4000]

The kinds of tests/benchmarks/verdict_runs.py, alpha = 0.05. t, sign flip (12 runs only) and BCa are those of
simbench/score/statistics.py.
Exit code 0: measured, whatever came out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

import numpy as np

from scenarios.seeding import stream
from simbench.score.statistics import bca_interval, sign_flip_p, t_interval
from simbench.verdict.decide import ALPHA
from tests.benchmarks.verdict import p_values
from tests.benchmarks.verdict_runs import MARGIN, Kind, kinds

LEVEL = 1.0 - 2.0 * ALPHA  # of two-sided intervals whose ends are one-sided bounds at alpha
RESAMPLES = 1999


def passed(kind: Kind, n: int, trials: int) -> dict[str, float]:
    """Share of trials that pass, by method."""
    d = kind.draws(stream(0, "methods", kind.name, n), trials, n, MARGIN)
    rng = stream(1, "methods", kind.name, n)
    found = {"t": float(np.mean([t_interval(row, LEVEL)[0] > -MARGIN for row in d]))}
    if n == 12:
        found["sign flip"] = float(np.mean([sign_flip_p(row + MARGIN, "greater") <= ALPHA for row in d]))
    else:
        found["BCa"] = float(np.mean([bca_interval(row, rng, LEVEL, RESAMPLES)[0] > -MARGIN for row in d]))
        found["studentised"] = float((p_values(d, rng)[0] <= ALPHA).mean())
    return found


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="verdict_methods.py", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--trials", type=int, default=4000)
    options = parser.parse_args(arguments)
    for n in (12, 20, 40):
        for kind in kinds():
            shares = passed(kind, n, options.trials)
            print(
                f"{n:3d} {kind.name:20s}" + "".join(f"  {m} {share:.3f}" for m, share in shares.items()),
                flush=True,
            )
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
