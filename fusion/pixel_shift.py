"""By how much a camera's picture is shifted against the LiDAR: a vote of all boxes.

A turned camera, a shaken one or a late one moves all boxes of a picture alike. Every candidate of every box
proposes the shift that would put it into its box; the shift that most boxes can live with wins. It is used
only if boxes of at least `min_boxes` different tracks agree, and clearly better than on no shift at all: one
or two boxes can always be explained by a wrong cluster and a wrong shift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64


@dataclass(frozen=True, kw_only=True)
class PixelShiftConfig:
    """`kernel_rad`: two proposals this close agree. `frames`: how long votes of a camera are remembered."""

    min_boxes: int = 3
    kernel_rad: float = 0.006
    likely_rad: float = 0.06  # larger shifts are less likely: a Gaussian of this SD
    gain: float = 1.1  # by what factor the winner must beat no shift
    frames: int = 10


@dataclass(frozen=True, kw_only=True, eq=False)
class Vote:
    """One box's proposals [m 2] (right, down) with weights [m] of 0 to 1."""

    track_id: int
    offset_rad: Float64[np.ndarray, "m 2"]
    weight: Float64[np.ndarray, " m"]


def vote_shift(votes: Sequence[Vote], config: PixelShiftConfig) -> Float64[np.ndarray, "2"] | None:
    """The shift that the boxes agree on; None where too few do, or no better than on no shift."""
    votes = [vote for vote in votes if len(vote.weight)]
    if len({vote.track_id for vote in votes}) < config.min_boxes:
        return None
    offset = np.concatenate([vote.offset_rad for vote in votes])
    weight = np.concatenate([vote.weight for vote in votes])
    start = np.concatenate([[0], np.cumsum([len(vote.weight) for vote in votes])[:-1]])
    proposals = np.concatenate([np.zeros((1, 2)), offset[weight > 0.2]])
    near = _near(proposals, offset, config) * weight  # [proposals, all candidates]
    support = np.maximum.reduceat(near, start, axis=1).sum(axis=1)
    support *= np.exp(-0.5 * np.sum(proposals**2, axis=1) / config.likely_rad**2)
    best = int(np.argmax(support))
    if best == 0 or support[best] < config.gain * support[0]:
        return None
    shift = proposals[best]
    for _ in range(3):
        pull = _near(shift[None], offset, config)[0] * weight
        shift = pull @ offset / pull.sum()
    agree = np.maximum.reduceat(_near(shift[None], offset, config)[0] * weight, start) > 0.25
    tracks = {vote.track_id for vote, agrees in zip(votes, agree, strict=True) if agrees}
    return shift if len(tracks) >= config.min_boxes else None


def _near(
    shift: Float64[np.ndarray, "p 2"], offset: Float64[np.ndarray, "m 2"], config: PixelShiftConfig
) -> Float64[np.ndarray, "p m"]:
    square = (shift[:, :1] - offset[:, 0]) ** 2 + (shift[:, 1:] - offset[:, 1]) ** 2
    near: np.ndarray = np.exp(-0.5 * square / config.kernel_rad**2)
    return near
