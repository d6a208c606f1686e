"""What is kept of a run: a value for every pair and frame of every pipeline, small enough for a ledger."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from simbench.campaign.job_key import job_key
from simbench.case import Case, Job
from simbench.run import run_job
from simbench.score.localization import Fix


@dataclass(frozen=True, kw_only=True)
class PairValue:
    """A frame in a camera: its place in the drive, the paper's TPR and the exact precision and recall."""

    scan_seq: int
    camera: str
    tpr: float
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
    """One pipeline on one drive. metrics: its rows by name. why: None where all went well."""

    pipeline: str
    seed: int
    why: str | None
    metrics: dict[str, float | None]
    pairs: tuple[PairValue, ...]
    frames: tuple[FrameValue, ...]


def key_of(job: Job) -> str:
    """The key of a run, wherever it is made."""
    return job_key(job, what="reproduce")


def row_of(job: Job) -> str:
    """Run a job; all its pipelines, and the oracle, as JSON text."""
    return json.dumps([asdict(run_of(case, job.seed)) for case in run_job(job).cases], allow_nan=False)


def runs_of(text: str) -> tuple[Run, ...]:
    """What `row_of` wrote."""
    return tuple(
        Run(
            **{
                **one,
                "pairs": tuple(PairValue(**pair) for pair in one["pairs"]),
                "frames": tuple(
                    FrameValue(
                        scan_seq=frame["scan_seq"],
                        true_m=_pair(frame["true_m"]),
                        gnss_m=_pair(frame["gnss_m"]),
                    )
                    for frame in one["frames"]
                ),
            }
        )
        for one in json.loads(text)
    )


def run_of(case: Case, seed: int) -> Run:
    """What is kept of a case."""
    scores = case.scores
    return Run(
        pipeline=case.pipeline,
        seed=seed,
        why=None if case.status == "ok" else f"{case.status}: {case.why}",
        metrics={row.metric: row.value for row in case.rows},
        pairs=()
        if scores is None
        else tuple(
            PairValue(
                scan_seq=pair.scan_seq, camera=pair.camera, tpr=pair.tpr, precision=pair.precision,
                recall=pair.recall, n_true=pair.n_true, n_missed=pair.n_missed, hit=pair.hit,
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


def _error(fix: Fix | None, reference: str) -> tuple[float, float] | None:
    error = None if fix is None else fix.error_m(reference)
    return None if error is None else (float(error[0]), float(error[1]))


def _pair(value: list[float] | None) -> tuple[float, float] | None:
    return None if value is None else (value[0], value[1])
