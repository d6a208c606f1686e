"""Per-run values of real runs, and the kinds of difference that the verdict is tried on.

    python3 dev.py run simbench run overtake-approach --system car --images none --alone --seeds 0-79 \\
        --faults detector.misses_percent=15 --set systems.car.duration_s=2.0 --pipeline robust \\
        --pipeline probabilistic --pipeline tests/benchmarks/ablations.py:no_coast --out out/verdict-runs
    python3 dev.py run python tests/benchmarks/verdict.py --record out/verdict-runs

Recorded kinds keep the shape of real differences: runs are drawn with replacement, moved to the loss that is
wanted and scaled to the spread. In made kinds a few runs carry the loss, so that the shape changes with it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64

from simbench.verdict.differences import Better, Values, differences

DATA = Path(__file__).with_name("data") / "verdict_runs.json"
MADE_BY = [line.strip().rstrip(" \\") for line in (__doc__ or "").splitlines() if line.startswith("    ")]
PIPELINES = {
    "robust": "robust",
    "probabilistic": "probabilistic",
    "no_coast": "tests/benchmarks/ablations.py:no_coast",
}
METRICS: Mapping[str, Better] = {"mae_m.raw": "lower", "coverage.smooth": "higher"}
DIGITS = 5

MARGIN = 0.05
SPREAD = 1.7 * MARGIN
"""SD of recorded kinds: what planning says that 20 runs decide with 80 % power."""

DIFFER, SCATTER = 0.45, MARGIN
GROSS, BEFORE, NOISE = 10.0 * MARGIN, 0.02, 0.5 * MARGIN

Draws: TypeAlias = Callable[[np.random.Generator, int, int, float], Float64[np.ndarray, "trials n"]]
"""From generator, trials, runs and true loss."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of difference: what it is, and how to draw it."""

    name: str
    says: str
    draws: Draws


def record(run: Path, to: Path = DATA) -> None:
    """Keep the per-run values of a `simbench run`, with the commands that made them."""
    rows = json.loads((run / "result.json").read_text(encoding="utf-8"))["rows"]
    text = []
    for metric in METRICS:
        lines = []
        for name, pipeline in PIPELINES.items():
            found = {
                r["seed"]: r["value"] for r in rows if (r["pipeline"], r["metric"]) == (pipeline, metric)
            }
            values = [None if found[seed] is None else round(found[seed], DIGITS) for seed in sorted(found)]
            lines.append(f"      {json.dumps(name)}: {json.dumps(values)}")
        text.append(f"    {json.dumps(metric)}: {{\n" + ",\n".join(lines) + "\n    }")
    made_by = ",\n".join(f"    {json.dumps(line)}" for line in MADE_BY)
    values_by = ",\n".join(text)
    to.write_text(
        f'{{\n  "made_by": [\n{made_by}\n  ],\n  "values": {{\n{values_by}\n  }}\n}}\n', encoding="utf-8"
    )


def recorded(metric: str, old: str, new: str) -> Float64[np.ndarray, " n"]:
    """Differences new - old of the recorded runs, higher is better."""
    values = json.loads(DATA.read_text(encoding="utf-8"))["values"][metric]
    sides: list[Values] = [dict(enumerate(values[name])) for name in (old, new)]
    return differences(sides[0], sides[1], METRICS[metric]).d


def kinds() -> tuple[Kind, ...]:
    """All that the verdict is tried on; the last one has gross failures."""
    return (
        Kind(name="normal", says="raw error of probabilistic against robust", draws=_shaped("mae_m.raw")),
        Kind(
            name="zero-inflated",
            says="coverage of probabilistic against robust: equal in 55 % of runs, losses in the others",
            draws=_shaped("coverage.smooth"),
        ),
        Kind(
            name="rare failure",
            says="coverage of no_coast against robust: equal in 90 % of runs, losses in the others",
            draws=_shaped("coverage.smooth", "no_coast"),
        ),
        Kind(
            name="rare repair",
            says="the same turned round: equal in 90 % of runs, gains in the others",
            draws=_shaped("coverage.smooth", "no_coast", turn=-1),
        ),
        Kind(
            name="zero-inflated, made",
            says=f"equal in {1 - DIFFER:.0%} of runs; the others carry the loss, and scatter by the margin",
            draws=_zero_inflated,
        ),
        Kind(
            name="rare failure, made",
            says=f"noise of half a margin; {BEFORE:.0%} of runs of either version lose ten margins, and as "
            "many more of the new one as make up the loss",
            draws=_rare,
        ),
    )


def _shaped(metric: str, new: str = "probabilistic", turn: int = 1) -> Draws:
    pool = turn * recorded(metric, "robust", new)
    pool = (pool - pool.mean()) / pool.std()

    def draws(rng: np.random.Generator, trials: int, n: int, loss: float) -> Float64[np.ndarray, "trials n"]:
        return np.asarray(SPREAD * pool[rng.integers(0, len(pool), (trials, n))] - loss)

    return draws


def _zero_inflated(
    rng: np.random.Generator, trials: int, n: int, loss: float
) -> Float64[np.ndarray, "trials n"]:
    differ = rng.random((trials, n)) < DIFFER
    return np.where(differ, SCATTER * rng.normal(size=(trials, n)) - loss / DIFFER, 0.0)


def _rare(rng: np.random.Generator, trials: int, n: int, loss: float) -> Float64[np.ndarray, "trials n"]:
    new, old = (rng.random((trials, n)) < chance for chance in (BEFORE + loss / GROSS, BEFORE))
    return np.asarray(NOISE * rng.normal(size=(trials, n)) + GROSS * (old.astype(float) - new))
