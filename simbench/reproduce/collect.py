"""What is kept of a run: its metrics, and where it is wanted a value for every pair and frame; as a row of a
ledger."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass
from typing import Any

from simbench.campaign.job_key import job_key
from simbench.campaign.key import task_key
from simbench.case import Case
from simbench.reproduce.plan import Ask, BoardAsk
from simbench.run import run_job
from simbench.score.localization import Fix


@dataclass(frozen=True, kw_only=True)
class PairValue:
    """A frame in a camera: its place in the drive, the paper's TPR, the highest that any reference
    distance gives, and the exact precision and recall."""

    scan_seq: int
    camera: str
    tpr: float
    tpr_any: float
    precision: float
    recall: float
    n_true: int
    n_missed: int
    hit: bool


@dataclass(frozen=True, kw_only=True)
class FrameValue:
    """A frame's smoothed position minus the exact centre, and minus the GNSS fix that holds [m, x y]; None:
    there is no position, or no fix yet."""

    scan_seq: int
    true_m: tuple[float, float] | None
    gnss_m: tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class Run:
    """One pipeline on one drive. metrics: its rows by name. why: None where all went well. pairs, frames:
    empty where they are not kept."""

    pipeline: str
    seed: int
    why: str | None
    metrics: dict[str, float | None]
    pairs: tuple[PairValue, ...] = ()
    frames: tuple[FrameValue, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Board:
    """TPR of a static board in the calibrated zone of one LiDAR-camera pair, with the found calibration and
    with the true one [0..1]; None: no calibration comes about."""

    system: str
    camera: str
    seed: int
    tpr: float | None
    tpr_true: float | None


def key_of(ask: Ask | BoardAsk) -> str:
    """The key of a row, wherever it is made."""
    if isinstance(ask, BoardAsk):
        return task_key(case={"what": "reproduce", **asdict(ask)}, config={})
    return job_key(ask.job, what="reproduce", whole=ask.whole)


def row_of(ask: Ask | BoardAsk) -> str:
    """Do what is asked; what is kept of it, as JSON text."""
    if isinstance(ask, BoardAsk):
        return json.dumps([asdict(board) for board in boards_of(ask)], allow_nan=False)
    return text_of([run_of(case, ask.job.seed, ask.whole) for case in run_job(ask.job).cases])


def text_of(runs: Sequence[Run]) -> str:
    """Runs as the JSON text of a row."""
    return json.dumps([_plain(run) for run in runs], allow_nan=False)


def boards_read(text: str) -> tuple[Board, ...]:
    """What `row_of` wrote of a calibration."""
    return tuple(Board(**one) for one in json.loads(text))


def runs_read(text: str) -> tuple[Run, ...]:
    """What `row_of` wrote of a run."""
    return tuple(
        Run(
            pipeline=one["pipeline"],
            seed=one["seed"],
            why=one["why"],
            metrics=one["metrics"],
            pairs=tuple(PairValue(**dict(zip(_PAIR, pair, strict=True))) for pair in one["pairs"]),
            frames=tuple(
                FrameValue(scan_seq=frame[0], true_m=_pair(frame[1]), gnss_m=_pair(frame[2]))
                for frame in one["frames"]
            ),
        )
        for one in json.loads(text)
    )


_PAIR = tuple(PairValue.__dataclass_fields__)


def _plain(run: Run) -> dict[str, Any]:
    """Pairs and frames as rows without names, or a ledger would hold little else than names."""
    return {
        "pipeline": run.pipeline, "seed": run.seed, "why": run.why, "metrics": run.metrics,
        "pairs": [astuple(pair) for pair in run.pairs], "frames": [astuple(frame) for frame in run.frames],
    }  # fmt: skip


def run_of(case: Case, seed: int, whole: bool = True) -> Run:
    """What is kept of a case."""
    scores = case.scores if whole else None
    return Run(
        pipeline=case.pipeline,
        seed=seed,
        why=None if case.status == "ok" else f"{case.status}: {case.why}",
        metrics={row.metric: row.value for row in case.rows},
        pairs=()
        if scores is None
        else tuple(
            PairValue(
                scan_seq=pair.scan_seq, camera=pair.camera, tpr=pair.tpr, tpr_any=pair.tpr_any,
                precision=pair.precision, recall=pair.recall, n_true=pair.n_true,
                n_missed=pair.n_missed, hit=pair.hit,
            )
            for pair in scores.pairs
        ),
        frames=()
        if scores is None
        else tuple(
            FrameValue(
                scan_seq=frame.scan_seq, true_m=_error(frame.smooth, ""), gnss_m=_error(frame.smooth, ".gnss")
            )
            for frame in scores.frames
        ),
    )  # fmt: skip


def boards_of(ask: BoardAsk) -> tuple[Board, ...]:
    """Calibrate a rig as the paper does, with errors of hand (`calibration/study.py`)."""
    from simbench.calibration.study import Settings, calibrate_rig
    from simbench.calibration.text import calibrated, mean_of

    study = calibrate_rig(Settings(rig=ask.rig, seed=ask.seed), lambda _: None)
    found = [(pair.camera, mean_of(calibrated(pair))) for pair in study.pairs]
    return tuple(
        Board(
            system=ask.system, camera=camera, seed=ask.seed, tpr=mean.get("tpr"),
            tpr_true=mean.get("tpr_true"),
        )
        for camera, mean in found
    )  # fmt: skip


def values_of(runs: Sequence[Run], metric: str) -> dict[int, float | None]:
    """A metric by seed."""
    return {run.seed: run.metrics.get(metric) for run in runs}


def mean_over(runs: Sequence[Run], metric: str) -> float | None:
    """Of the runs that have a value; None: none has."""
    values = [value for run in runs if (value := run.metrics.get(metric)) is not None]
    return sum(values) / len(values) if values else None


def _error(fix: Fix | None, reference: str) -> tuple[float, float] | None:
    error = None if fix is None else fix.error_m(reference)
    return None if error is None else (float(error[0]), float(error[1]))


def _pair(value: Sequence[float] | None) -> tuple[float, float] | None:
    return None if value is None else (value[0], value[1])
