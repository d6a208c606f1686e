"""Where true objects are at a true time, in the ego frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.messages import LidarScan
from simbench.recording import Recording


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Centres and axes of boxes in the ego frame; NaN where a pose is no number."""

    centre_m: Float64[np.ndarray, "objects 3"]
    rotation: Float64[np.ndarray, "objects 3 3"]


def placed(recording: Recording, object_ids: Sequence[int], t_ns: int) -> Placed | None:
    """Boxes of objects at one true time; None: the poses do not reach so far."""
    try:
        at = np.array([t_ns], dtype=np.int64)
        with np.errstate(invalid="ignore", over="ignore"):
            found = [recording.truth.box_in_ego(i, at) for i in object_ids]
    except (ValueError, KeyError, OverflowError):
        return None
    return Placed(
        centre_m=np.array([p for _, p in found]).reshape(-1, 3),
        rotation=np.array([r for r, _ in found]).reshape(-1, 3, 3),
    )


def middle_ns(scan: LidarScan, fire_ns: Int64[np.ndarray, " n"], period_ns: int) -> int:
    """The middle of a sweep: between its first and last true firing; of an empty one half a period after its
    stamp."""
    if not len(fire_ns):
        return int(scan.stamp_ns) + period_ns // 2
    return (int(fire_ns.min()) + int(fire_ns.max())) // 2
