"""Which candidate is the object, by its motion over many scans: constant-velocity RANSAC over candidate sets.

Per scan a track has a set of candidates, each with a place in the odometry frame and a weight. A candidate of
the newest set and one of an earlier set make a hypothesis of constant velocity. Its support is what the sets
of the window give it: per set the best candidate near the predicted place, by weight and nearness. All pairs
are tried (a few hundred), so nothing is drawn at random. Candidates near the track's own prediction get a
bonus. In spirit Fischler and Bolles (1981) on a window that moves with time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.optimize import linear_sum_assignment


@dataclass(frozen=True, kw_only=True)
class AssociationConfig:
    """The window, and what counts as near."""

    window_s: float = 0.85
    gate_m: float = 0.8
    shortest_s: float = 0.15  # between two candidates that make a velocity
    fastest_mps: float = 45.0
    prediction_bonus: float = 1.0
    prediction_gate_m: float = 0.8
    contested: float = 4.0  # what a candidate loses in log-score that fits another track better; 0: nothing


@dataclass(frozen=True, kw_only=True, eq=False)
class CandidateSet:
    """Candidates [m] of one track in one scan: when, where (odometry frame), how good (0..1)."""

    stamp_ns: int
    xy_m: Float64[np.ndarray, "m 2"]
    weight: Float64[np.ndarray, " m"]


def associate(
    sets: Sequence[CandidateSet],
    predicted_m: Float64[np.ndarray, "2"] | None,
    config: AssociationConfig,
) -> tuple[int, float]:
    """The newest set's candidate with the best-supported motion, and its support as a share of the sets.

    The newest set must not be empty. With no earlier set in the window its best weight wins.
    """
    newest = sets[-1]
    sets = [s for s in sets if (newest.stamp_ns - s.stamp_ns) * 1e-9 <= config.window_s and len(s.weight)]
    own = newest.weight.copy()
    if predicted_m is not None:
        off = np.linalg.norm(newest.xy_m - predicted_m, axis=1) / config.prediction_gate_m
        own += config.prediction_bonus * np.exp(-0.5 * off**2)
    earlier = sets[:-1]
    if not earlier:
        best = int(np.argmax(own))
        return best, float(newest.weight[best])
    count = [len(s.weight) for s in earlier]
    age_s = np.repeat([(s.stamp_ns - newest.stamp_ns) * 1e-9 for s in earlier], count)
    xy_m = np.concatenate([s.xy_m for s in earlier])
    weight = np.concatenate([s.weight for s in earlier])
    start = np.cumsum([0, *count[:-1]])
    far = np.flatnonzero(age_s <= -config.shortest_s)
    if len(far) == 0:
        best = int(np.argmax(own))
        return best, float(newest.weight[best])
    square = np.zeros((len(own), len(far), len(age_s)))  # [here, there, candidate]
    fast = np.zeros((len(own), len(far)))
    for axis in (0, 1):
        here, there = newest.xy_m[:, axis, None], xy_m[far, axis]
        speed = (there - here) / age_s[far]
        fast += speed**2
        square += (speed[:, :, None] * age_s + (here[:, :, None] - xy_m[:, axis])) ** 2
    near = np.maximum(1.0 - square / config.gate_m**2, 0.0) * weight
    support = np.maximum.reduceat(near, start, axis=2).sum(axis=2)
    support[fast > config.fastest_mps**2] = 0.0
    best = int(np.argmax(np.max(support, axis=1) + own))
    return best, float((support[best].max() + newest.weight[best]) / len(sets))


def contested(
    numbers: Sequence[Int64[np.ndarray, " _"]], score: Sequence[Float64[np.ndarray, " _"]], missing: float
) -> list[Bool[np.ndarray, " _"]]:
    """For every track's candidates (cluster numbers and log-scores) which of them are another track's.

    Two objects are not one cluster: the tracks get different clusters so that the sum of their scores is the
    largest (`missing`: of a track without); a candidate that went to another track is that track's.
    """
    clusters, place = np.unique(np.concatenate([*numbers, np.zeros(0, np.int64)]), return_inverse=True)
    columns = np.split(place, np.cumsum([len(n) for n in numbers])[:-1])
    table = np.full((len(numbers), len(clusters) + len(numbers)), missing)  # a column more each: none
    for row, (at, values) in enumerate(zip(columns, score, strict=True)):
        table[row, at] = np.maximum(values, missing)
    owner = np.full(table.shape[1], -1)
    rows, taken = linear_sum_assignment(table, maximize=True)
    owner[taken] = rows
    return [(owner[at] >= 0) & (owner[at] != row) for row, at in enumerate(columns)]
