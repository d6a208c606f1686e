"""Runs that no simulation made: their TPR is a formula of what was asked, so that every table, fit and figure
has numbers that are known beforehand."""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np

from simbench.case import ORACLE
from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import BASELINE, GROUND, METHOD, OURS
from simbench.reproduce.collect import Board, FrameValue, PairValue, Run, text_of
from simbench.reproduce.levels import GROUPS, LEVELS
from simbench.reproduce.plan import Ask, BoardAsk, Size, asks, board_asks, fit_points
from simbench.score.metrics import METRICS

SMALL = Size(
    name="full", seeds=6, boards=2, variants=6, scenes=3, groups=6, map=2, strips=2, claims=6, fit_points=32,
)  # fmt: skip
CLEAN = {BASELINE: 0.60, GROUND: 0.70, METHOD: 0.75, OURS: 0.85, ORACLE: 0.95}
LOSS = {BASELINE: 0.50, GROUND: 0.40, METHOD: 0.20, OURS: 0.05, ORACLE: 0.0}
NOISE = 0.01
PAIRS = 12


def damage(ask: Ask) -> float:
    """Share of the loss at all bounds: the mean level, in shares of the bounds."""
    system = ask.cell.split()[0]
    levels = LEVELS[system]
    if ask.part == "tables":
        return {"none": 0.0, "bounds": 1.0, "reached": 0.8}[str(ask.point[0])]
    if ask.part == "groups":
        acting = [group for i, group in enumerate(GROUPS) if int(ask.point[0]) >> i & 1]
        return len(acting) / len(GROUPS)
    if ask.part == "map":
        return 0.5 * float(ask.point[0]) / 150.0
    if ask.part == "strips":
        level = next(one for one in levels if one.name == ask.point[0])
        return 0.1 * float(ask.point[1]) / level.bound
    if ask.part == "fit":
        shares = fit_points(system, SMALL.fit_points)[int(ask.point[0])] / [one.bound for one in levels]
        return float(shares.mean())
    return 0.8


def made_up_row(ask: Ask | BoardAsk) -> str:
    """What `collect.row_of` gives, of a run that was not made."""
    if isinstance(ask, BoardAsk):
        return json.dumps([asdict(board) for board in _boards(ask)])
    rng = np.random.Generator(np.random.PCG64(ask.job.seed))
    return text_of([_run(ask, name, rng) for name in (*ask.job.pipelines, ORACLE)])


def _boards(ask: BoardAsk) -> list[Board]:
    return [
        Board(system=ask.system, camera=f"cam-{i}", seed=ask.seed, tpr=0.9 + 0.01 * i, tpr_true=0.95)
        for i in range(3)
    ]


def made_up(size: Size = SMALL, seed: int = 0) -> Found:
    """All runs of a size."""
    rng = np.random.Generator(np.random.PCG64(seed))
    runs = {ask: tuple(_run(ask, name, rng) for name in (*ask.job.pipelines, ORACLE)) for ask in asks(size)}
    boards = tuple(board for ask in board_asks(size) for board in _boards(ask))
    return Found(size=size, runs=runs, boards=boards, failures=())


def _run(ask: Ask, name: str, rng: np.random.Generator) -> Run:
    kind = METHOD if ":" in name else name
    mean = CLEAN[kind] - LOSS[kind] * damage(ask) + NOISE * rng.standard_normal()
    tpr = np.clip(mean + 0.1 * rng.standard_normal(PAIRS), 0.0, 1.0)
    metrics: dict[str, float | None] = {metric.name: 0.1 for metric in METRICS}
    metrics |= {
        "tpr": float(tpr.mean()),
        "precision": float(tpr.mean()),
        "mae_m.smooth": 1.0 - float(tpr.mean()),
    }
    return Run(
        pipeline=name, seed=ask.job.seed, why=None, metrics=metrics,
        pairs=tuple(
            PairValue(
                scan_seq=i, camera="cam-0", tpr=float(value), tpr_any=float(value), precision=float(value),
                recall=1.0, n_true=9, n_missed=int(value < 0.5) * 9, hit=bool(value > 0.5),
            )
            for i, value in enumerate(tpr if ask.whole else ())
        ),
        frames=tuple(
            FrameValue(scan_seq=i, true_m=(0.1, 0.2), gnss_m=(1.0, 1.2)) for i in range(5 if ask.whole else 0)
        ),
    )  # fmt: skip
