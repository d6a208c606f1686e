"""Does the largest dividend name a true cause? Hidden-cause trials drawn from real runs.

    python3 dev.py run python tests/benchmarks/attribution.py [--table FILE] [--each 30] [--runs 10]

The table (`attribution_table.py`) holds the losses of ten real runs with every set of five causes. A trial
draws its runs from these ten, with replacement, and hides which of the five listed causes are real. The
others are placebos: in truth they do nothing, but switching one stirs every run by what range noise, the
weakest of the real ones, was measured to stir it by, with its mean taken off and a random sign, anew for
every set of causes.

single        one real cause that acts (its dividend counts in the whole table)
pair          two of them
interaction   two listed causes that act only together: then as one real cause does
all five      the table as it is
null          placebos only

Right: the first name is that of a true cause (every member of the set that is named), or of nulls "no cause".
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

import numpy as np

from scenarios.seeding import stream
from simbench.explain.attribution import attribute

TABLE = Path(__file__).with_name("attribution.json")
STIRS = "lidar.range_noise_cm"
STUDIED = (
    ("static_projection", "precision"),
    ("static_projection", "mae_m.raw"),
    ("probabilistic", "precision"),
    ("probabilistic", "mae_m.raw"),
)
KINDS = ("single", "pair", "interaction", "all five", "null")


@dataclass(frozen=True, kw_only=True)
class Real:
    """Losses [32 runs] of one pipeline and metric; acting: the causes whose single dividend counts there."""

    causes: tuple[str, ...]
    losses: np.ndarray
    acting: tuple[int, ...]
    stir: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Found:
    """Trials of one kind: how many named a true cause first, a false one, none."""

    kind: str
    right: int
    wrong: int
    none: int

    @property
    def count(self) -> int:
        return self.right + self.wrong + self.none


def read(path: Path, pipeline: str, metric: str) -> Real:
    """One part of the table."""
    content = json.loads(path.read_text(encoding="utf-8"))
    causes = tuple(content["causes"])
    losses = np.array(content["losses"][pipeline][metric], dtype=np.float64)
    whole = attribute(losses, causes, content["seeds"], pipeline=pipeline, metric=metric)
    single = [e.causes[0] for e in whole.dividends if len(e.causes) == 1 and e.counts]
    stirred = losses[1 << causes.index(STIRS)] - losses[0]
    return Real(
        causes=causes,
        losses=losses,
        acting=tuple(causes.index(name) for name in single),
        stir=stirred - stirred.mean(),
    )


def trial(real: Real, kind: str, runs: int, rng: np.random.Generator) -> tuple[np.ndarray, frozenset[int]]:
    """Losses [32 runs], and the true causes."""
    k = len(real.causes)
    masks = np.arange(1 << k)
    a, *rest = (int(i) for i in rng.permutation(real.acting))
    shown = {
        "single": masks & 1 << a,
        "pair": masks & (1 << a | 1 << (rest[0] if rest else a)),
        "all five": masks,
        "null": masks & 0,
    }
    if kind == "interaction":
        x, y = (int(i) for i in rng.permutation(k)[:2])
        both = 1 << x | 1 << y
        rows, true = np.where(masks & both == both, 1 << a, 0), frozenset({x, y})
        real_bits = both
    else:
        rows, real_bits = shown[kind], int(shown[kind][-1])
        true = frozenset(i for i in range(k) if real_bits >> i & 1)
    losses = real.losses[np.ix_(rows, rng.integers(0, real.losses.shape[1], runs))]
    placebo = masks & ~real_bits != 0
    stir = rng.choice(real.stir, size=losses.shape) * rng.choice([-1.0, 1.0], size=losses.shape)
    return np.where(placebo[:, None], losses + stir, losses), true


def judge(real: Real, kind: str, each: int, runs: int, rng: np.random.Generator) -> Found:
    """As many trials of a kind."""
    right = wrong = none = 0
    for _ in range(each):
        losses, true = trial(real, kind, runs, rng)
        found = attribute(losses, [str(i) for i in range(len(real.causes))], range(runs))
        if not found.named:
            none += 1
        elif {int(name) for name in found.named[0].causes} <= true:
            right += 1
        else:
            wrong += 1
    return Found(kind=kind, right=right, wrong=wrong, none=none)


def study(path: Path, each: int, runs: int) -> Iterator[tuple[str, str, Real, Sequence[Found]]]:
    """Every part of the table in which something acts."""
    for pipeline, metric in STUDIED:
        real = read(path, pipeline, metric)
        if not real.acting:
            continue
        rng = stream(0, "attribution", pipeline, metric, str(runs))
        yield pipeline, metric, real, [judge(real, kind, each, runs, rng) for kind in KINDS]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=TABLE)
    parser.add_argument("--each", type=int, default=30)
    parser.add_argument("--runs", type=int, default=10)
    asked = parser.parse_args()
    total = {kind: [0, 0] for kind in KINDS}
    for pipeline, metric, real, found in study(asked.table, asked.each, asked.runs):
        print(f"{pipeline}, {metric}: {', '.join(real.causes[i] for i in real.acting)} act")
        for one in found:
            good = one.none if one.kind == "null" else one.right
            total[one.kind][0] += good
            total[one.kind][1] += one.count
            words = f"right {one.right:3d}  wrong {one.wrong:3d}  none {one.none:3d}"
            print(f"  {one.kind:12s} {words}", flush=True)
    for kind, (good, count) in total.items():
        print(f"{kind:14s} {good} of {count} right: {good / max(count, 1):.1%}")


if __name__ == "__main__":
    main()
