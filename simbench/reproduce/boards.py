"""Table I: TPR of a static board by LiDAR-camera pair, the paper's beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbench.paper import TABLE_I
from simbench.reproduce.collect import Board
from simbench.score.statistics import Summary, summarize


@dataclass(frozen=True, kw_only=True)
class PairRow:
    """One LiDAR-camera pair over calibrations: with the calibration that was found, and with the true one."""

    camera: str
    tpr: Summary
    tpr_true: Summary


@dataclass(frozen=True, kw_only=True)
class BoardTable:
    """One rig. printed: the paper's values, in its order of pairs; which camera is which it does not say, so
    only the means are set against each other."""

    system: str
    printed: tuple[float, ...]
    pairs: tuple[PairRow, ...]
    mean: Summary
    mean_true: Summary


def board_tables(boards: Sequence[Board], rng: np.random.Generator) -> tuple[BoardTable, ...]:
    """Table I, a table a rig that was calibrated."""
    return tuple(
        _table(system, [board for board in boards if board.system == system], rng)
        for system in TABLE_I
        if any(board.system == system for board in boards)
    )


def _table(system: str, boards: Sequence[Board], rng: np.random.Generator) -> BoardTable:
    cameras = tuple(dict.fromkeys(board.camera for board in boards))
    return BoardTable(
        system=system,
        printed=TABLE_I[system],
        pairs=tuple(
            PairRow(
                camera=camera,
                tpr=summarize({b.seed: b.tpr for b in boards if b.camera == camera}, rng),
                tpr_true=summarize({b.seed: b.tpr_true for b in boards if b.camera == camera}, rng),
            )
            for camera in cameras
        ),
        mean=summarize(_means(boards, "tpr"), rng),
        mean_true=summarize(_means(boards, "tpr_true"), rng),
    )


def _means(boards: Sequence[Board], what: str) -> dict[int, float | None]:
    """Over the pairs of a calibration, by its seed; None where a pair has no value."""
    found: dict[int, float | None] = {}
    for seed in dict.fromkeys(board.seed for board in boards):
        values = [getattr(board, what) for board in boards if board.seed == seed]
        found[seed] = None if None in values else float(np.mean(values))
    return found
