"""Runs whose causes are hidden: a loss is a run's own level, plus the dividends of the true causes (which
differ
from run to run), plus what switching anything stirs up in a run without a direction.

Sizes as measured on real runs (`tests/benchmarks/attribution.py`): precision differs by 0.05 to 0.1 from run
to run, an effect by half of itself, and a switch that does nothing on average stirs a run by STIR.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.explain.attribution import attribute

CAUSES = 5
LEVEL_SD = 0.08
STIR = 0.01
SPREAD = 0.4  # SD of an effect over runs, as a share of it


@dataclass(frozen=True)
class Trial:
    """losses [2^k r]; true: the causes that act. kind "null": none does, others: the largest dividend must
    name nothing but true ones."""

    kind: str
    losses: np.ndarray
    true: frozenset[int]


def trials(rng: np.random.Generator, *, runs: int, each: int) -> list[Trial]:
    """As many of each kind: one cause, two, two that act only together, four of which two also do so, one
    that gains, none."""
    drawn = []
    for _ in range(each):
        for kind in ("single", "pair", "interaction", "many", "gain", "null"):
            a, b, c, d = (int(i) for i in rng.permutation(CAUSES)[:4])
            sizes = rng.uniform(0.05, 0.3, 4)
            effects = {
                "single": {1 << a: sizes[0]},
                "pair": {1 << a: sizes[0], 1 << b: sizes[1]},
                "interaction": {1 << a | 1 << b: sizes[0]},
                "many": {1 << a: sizes[0], 1 << b: sizes[1], 1 << c | 1 << d: sizes[2]},
                "gain": {1 << a: -sizes[0]},
                "null": {},
            }[kind]
            drawn.append(Trial(kind, _losses(rng, effects, runs), _acting(effects)))
    return drawn


def judged(trial: Trial, runs: int) -> bool:
    """Whether the answer is right."""
    names = [str(i) for i in range(int(np.log2(len(trial.losses))))]
    found = attribute(trial.losses, names, range(runs))
    if trial.kind == "null":
        return found.verdict == "no cause"
    return bool(found.named) and {int(name) for name in found.named[0].causes} <= trial.true


def _acting(effects: dict[int, float]) -> frozenset[int]:
    return frozenset(i for mask in effects for i in range(CAUSES) if mask >> i & 1)


def _losses(rng: np.random.Generator, effects: dict[int, float], runs: int) -> np.ndarray:
    masks = np.arange(1 << CAUSES)
    losses = rng.normal(0.0, LEVEL_SD, runs) + STIR * rng.normal(size=(len(masks), runs))
    for mask, size in effects.items():
        losses[(masks & mask) == mask] += size * (1.0 + SPREAD * rng.normal(size=runs))
    return losses
