"""How likely an object's points are its own: a logistic function of what is known when it is given.

    p = 1 / (1 + exp(-(bias + a score + b min(support, 1) + c ln points + d ln min(sightings, 10))))

The weights are fitted (maximum likelihood) so that of the objects given p a share of p is right, an object
being right if half of its points or more belong to what its box shows. The detector's own confidence is not
used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ConfidenceConfig:
    """The weights, fitted on 21 776 objects of 40 drives by `tests/benchmarks/reliability.py --fit --seeds
    100-101` of the project."""

    bias: float = 0.02
    score: float = 0.53  # log-score of the cluster in its boxes, at most 0
    support: float = 1.69  # share of the last scans that its motion explains
    points: float = 0.98
    sightings: float = 1.09  # of its track so far


def confidence(score: float, support: float, points: int, sightings: int, config: ConfidenceConfig) -> float:
    """The chance (0..1) that the points are the object's."""
    x = (
        config.bias
        + config.score * score
        + config.support * min(support, 1.0)
        + config.points * math.log(max(points, 1))
        + config.sightings * math.log(min(sightings, 10))
    )
    return 1.0 / (1.0 + math.exp(-min(max(x, -30.0), 30.0)))
