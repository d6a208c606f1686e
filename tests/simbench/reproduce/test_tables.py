"""What is kept of runs is what was scored, and tables of it are those that one works out by hand."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from simbench.case import ORACLE
from simbench.paper import MAE, TABLE_II
from simbench.reproduce.cells import BASELINE, CELLS, METHOD
from simbench.reproduce.collect import FrameValue, PairValue, Run, row_of, run_of, runs_read
from simbench.reproduce.plan import Ask
from simbench.reproduce.tables import frames_of, mae_table, missed_few, premise, tpr_table
from simbench.run import run_job

PRINTED = TABLE_II["overtake-approach", "car"]


def rng() -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(4))


def pair(seq: int, tpr: float, missed: int = 0, hit: bool = True) -> PairValue:
    return PairValue(
        scan_seq=seq,
        camera="a",
        tpr=tpr,
        tpr_any=tpr,
        precision=tpr,
        recall=1.0,
        n_true=9,
        n_missed=missed,
        hit=hit,
    )


def run(seed: int, tprs: list[float], errors_m: list[tuple[float, float]] | None = None) -> Run:
    return Run(
        pipeline="p", seed=seed, why=None,
        metrics={"tpr": float(np.mean(tprs)), "mae_m.smooth": 0.1 * seed, "mae_m.smooth.gnss": None},
        pairs=tuple(pair(i, tpr) for i, tpr in enumerate(tprs)),
        frames=tuple(FrameValue(scan_seq=i, true_m=e, gnss_m=e) for i, e in enumerate(errors_m or [])),
    )  # fmt: skip


def test_a_run_keeps_what_was_scored() -> None:
    job = CELLS[0].job(3, ("paper-car",), (BASELINE, METHOD))
    job = replace(job, changes=("systems.car.duration_s=0.8",))
    result = run_job(job)
    runs = runs_read(row_of(Ask(part="tables", cell=CELLS[0].name, point=("reached",), job=job)))
    assert [r.pipeline for r in runs] == [BASELINE, METHOD, ORACLE]
    for case, kept in zip(result.cases, runs, strict=True):
        assert run_of(case, 3) == kept and json.dumps(asdict(kept))
        assert np.mean([p.tpr for p in kept.pairs]) == pytest.approx(kept.metrics["tpr"])
        errors = [np.abs(f.true_m).mean() for f in kept.frames if f.true_m is not None]
        if len(errors) >= 5:
            assert np.mean(errors) == pytest.approx(kept.metrics["mae_m.smooth"])


def test_pairs_are_matched_by_seed_sweep_and_camera() -> None:
    before = [run(1, [0.1, 0.2, 0.3]), run(2, [0.4])]
    after = [run(2, [0.9]), run(1, [0.5, 0.6])]
    found = frames_of(before, after)
    assert found.before.tolist() == [0.1, 0.2, 0.4]
    assert found.after.tolist() == [0.5, 0.6, 0.9]
    assert found.run.tolist() == [1, 1, 2]


def test_runs_weigh_the_same_however_many_frames_they_have() -> None:
    before = [run(i, [0.2] * n) for i, n in enumerate((2, 4, 6, 8, 2, 30))]
    after = [run(i, [0.2 + 0.1 * i] * n) for i, n in enumerate((2, 4, 6, 8, 2, 30))]
    table = tpr_table(PRINTED, before, after, rng())
    assert (table.pairs, table.runs) == (52, 6)
    assert table.before.mean == pytest.approx(0.2)
    assert table.after.mean == pytest.approx(0.45)
    assert table.gain.difference.mean == pytest.approx(0.25)
    assert table.dependence.icc == pytest.approx(1.0)
    assert table.drawn["after"].n == 1000 and table.drawn["after"].median > 0.45  # frames of the long run


def test_without_a_pair_there_is_no_row() -> None:
    with pytest.raises(ValueError, match="no pair"):
        tpr_table(PRINTED, [run(1, [0.1])], [run(2, [0.1])], rng())


def test_the_mae_of_a_frame_is_the_mean_of_both_axes() -> None:
    runs = [run(seed, [0.5], [(1.0, -3.0)] * 40) for seed in range(8)]
    table = mae_table(MAE["car"], runs, rng())
    assert table.frames == 320 and table.drawn is not None
    assert table.drawn.median == table.drawn.low == table.drawn.high == pytest.approx(2.0)
    assert table.exact.mean == pytest.approx(0.35) and table.exact.n == 8
    assert table.gnss.mean is None and table.gnss.missing == 8
    assert mae_table(MAE["car"], [run(1, [0.5])], rng()).drawn is None


def test_few_points_missed_and_the_premise_count_pairs() -> None:
    pairs = (pair(0, 0.9, 0), pair(1, 0.6, 4, hit=False), pair(2, 0.4, 5), pair(3, 0.2, 9, hit=False))
    runs = [replace(run(1, [0.5]), pairs=pairs)]
    assert missed_few(runs, 5) == 0.5 and missed_few(runs, 1) == 0.25
    assert premise(runs) == (0.5, 2)
    assert missed_few([replace(runs[0], pairs=())], 5) is None
    assert premise([replace(runs[0], pairs=())]) == (None, 0)
