"""The samples of every track over a run, and their smoothed trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from fusion.messages import LidarScan, LocalizedObject, Trajectory
from fusion.smooth import SmootherConfig, smooth_track


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sample:
    scan: tuple[str, int]
    scan_stamp_ns: int
    stamp_ns: int
    position_ego_m: Float64[np.ndarray, "3"]


class Tracks:
    """Collects a sample per localized object; the samples of all cameras make one trajectory per track id."""

    def __init__(self) -> None:
        self._samples: dict[int, list[_Sample]] = {}
        self._scans: dict[tuple[str, int], int] = {}

    def add(self, scan: LidarScan, objects: Sequence[LocalizedObject]) -> None:
        """Note a scan and what was found in it."""
        key = (scan.sensor, scan.seq)
        self._scans[key] = scan.stamp_ns
        for found in objects:
            sample = _Sample(
                scan=key,
                scan_stamp_ns=scan.stamp_ns,
                stamp_ns=found.stamp_ns,
                position_ego_m=found.position_ego_m,
            )
            self._samples.setdefault(found.track_id, []).append(sample)

    def trajectories(self, config: SmootherConfig) -> tuple[Trajectory, ...]:
        """Step 6 for every track, in the order of the ids; a track without any inlier has no trajectory."""
        smoothed = (
            smooth_track(
                track_id=track_id,
                stamp_ns=np.array([s.stamp_ns for s in samples], dtype=np.int64),
                position_ego_m=np.stack([s.position_ego_m for s in samples]),
                missing_ns=self._missing_ns(samples),
                config=config,
            )
            for track_id, samples in sorted(self._samples.items())
        )
        return tuple(t for t in smoothed if len(t.stamp_ns) > 0)

    def _missing_ns(self, samples: Sequence[_Sample]) -> Int64[np.ndarray, " m"]:
        """When the sweeps in which the track was missed would have hit the object.

        The time within the sweep is interpolated between the sweeps before and after that did hit it.
        """
        hit = {s.scan for s in samples}
        known = sorted((s.scan_stamp_ns, s.stamp_ns - s.scan_stamp_ns) for s in samples)
        at_ns, offset_ns = np.array(known, dtype=np.int64).T
        first_ns, last_ns = known[0][0], known[-1][0]
        missed = [ns for scan, ns in self._scans.items() if scan not in hit and first_ns < ns < last_ns]
        missed_ns = np.array(missed, dtype=np.int64)
        within_ns = np.interp(missed_ns - first_ns, at_ns - first_ns, offset_ns)
        hit_ns: np.ndarray = missed_ns + np.rint(within_ns).astype(np.int64)
        return hit_ns
