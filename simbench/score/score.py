"""Scores of one pipeline on one recording: rows, and the pairs, frames and error budget that they came
from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fusion.messages import FusionOutput, Trajectory
from simbench.recording import Recording
from simbench.score.budget import Budget, budget_estimates, error_budget
from simbench.score.contract import ContractError, check_output, check_trajectories
from simbench.score.identity import NO_TRACKS, identify, owners, tracks_of
from simbench.score.localization import FrameScore, localization_estimates, score_frames
from simbench.score.mapping import PairScore, mapping_estimates, score_pairs
from simbench.score.metrics import METRICS, Metric, Row, rows_of
from simbench.score.pairs import frames_and_pairs


@dataclass(frozen=True, kw_only=True)
class ObjectScore:
    """One object of a recording, over all of its eligible pairs and frames.

    distance_m: the box centre's smallest planar distance from the LiDAR while it was in an image. points: its
    most points in one sweep. planar_m: mean planar error of the positions, None where there is none. why: why
    it is not scored, None where it is.
    """

    name: str
    category: str
    distance_m: float | None
    points: int
    visible_fraction: float
    pairs: int
    hits: int
    tpr: float | None
    positions: int
    planar_m: float | None
    why: str | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Scores:
    """`rows`: one per metric of `METRICS`, in its order. `budget` is None without target or GNSS
    reference. `objects`: where several objects are scored (`objects.py`), each of them.
    """

    rows: tuple[Row, ...]
    pairs: tuple[PairScore, ...]
    frames: tuple[FrameScore, ...]
    budget: Budget | None
    objects: tuple[ObjectScore, ...] = ()

    def __getitem__(self, metric: str) -> Row:
        """The row of a metric; KeyError with the known names."""
        for row in self.rows:
            if row.metric == metric:
                return row
        raise KeyError(f"no metric {metric!r}; known: {', '.join(r.metric for r in self.rows)}")


def score(
    recording: Recording,
    outputs: Sequence[FusionOutput],
    trajectories: Sequence[Trajectory],
    *,
    known_tracks: Mapping[int, int] = NO_TRACKS,
) -> Scores:
    """Score a pipeline's outputs (any order, at most one per delivered scan) and its trajectories.

    `known_tracks` (track id -> object id) is for the oracle (`oracle.py`), and for results without 2-D boxes
    (`elsewhere/positions.py`). Raises `ContractError` for
    an output that breaks the contract, ValueError for a recording whose truth does not fit its messages.
    """
    truth = recording.truth
    frames, eligible = frames_and_pairs(recording)
    scans = {frame.key: frame.scan for frame in frames}
    answers: dict[tuple[str, int], FusionOutput] = {}
    for output in outputs:
        key = (output.scan_sensor, output.scan_seq)
        if key not in scans:
            raise ContractError(f"There is an output for scan {key}, which was never delivered.")
        check_output(scans[key], output, period_ns=truth.period_ns, answered=answers)
        answers[key] = output
    check_trajectories(trajectories)
    identified = [identify(frame, answers.get(frame.key), known_tracks) for frame in frames]
    pair_scores = score_pairs(recording, frames, eligible, identified)
    target_tracks = (
        ()
        if truth.target_id is None
        else tracks_of(trajectories, truth.target_id, owners(recording, known_tracks))
    )
    frame_scores = score_frames(recording, frames, eligible, identified, target_tracks)
    budget = error_budget(recording, frames, eligible, frame_scores)
    return Scores(
        rows=rows_of(
            {
                **mapping_estimates(pair_scores, identified, truth.target_id is not None),
                **localization_estimates(truth, frame_scores),
                **budget_estimates(budget, truth.target_id is not None),
            }
        ),
        pairs=pair_scores,
        frames=frame_scores,
        budget=budget,
    )


__all__ = ["METRICS", "Metric", "Row", "Scores", "score"]
