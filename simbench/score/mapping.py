"""Mapping: which LiDAR points a pipeline gave to the target, pair by pair (definitions: `metrics.py`).

tpr asks for distance only, as the paper does: |d - reference| <= 15 % of the category's longest horizontal
side. Precision and recall ask for the exact label of each point. A pair without an output object has 0
points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusion.messages import LocalizedObject
from simbench.recording import Recording
from simbench.score.frames import Frame
from simbench.score.identity import FALSE, Identified, best
from simbench.score.metrics import (
    HIT_MARGIN_M,
    T1_PERCENT,
    T1_POINTS,
    WINDOW_SHARE,
    Estimate,
    mean_of,
    null,
    ratio_of,
)
from simbench.score.pairs import (
    EligiblePair,
    lidar_to_world,
    median_point,
    planar_range_m,
    poses_at,
    to_child,
)

PAIRS = "eligible pairs"


@dataclass(frozen=True, kw_only=True)
class PairScore:
    """One eligible pair's counts. `track_id` is None where the pipeline gave no object for it.

    n_window*: mapped points within the window around the surface, centre and GNSS distance (GNSS: None before
    its first fix), and around the distance with most of them, which no annotated distance can exceed.
    n_correct: mapped points that hit the target. n_true: the target's true points in this image; n_found:
    those that were mapped. hit: the representative lies in the target's grown box. target: which of several
    targets, by its place among them.
    """

    frame: int
    scan_sensor: str
    scan_seq: int
    scan_stamp_ns: int
    camera: str
    track_id: int | None
    visible_fraction: float
    surface_distance_m: float
    n_mapped: int
    n_window: int
    n_window_centre: int
    n_window_gnss: int | None
    n_window_any: int
    n_correct: int
    n_true: int
    n_found: int
    hit: bool
    target: int = 0

    def _share(self, count: int) -> float:
        return count / self.n_mapped if self.n_mapped else 0.0

    @property
    def tpr(self) -> float:
        return self._share(self.n_window)

    @property
    def tpr_centre(self) -> float:
        return self._share(self.n_window_centre)

    @property
    def tpr_gnss(self) -> float | None:
        return None if self.n_window_gnss is None else self._share(self.n_window_gnss)

    @property
    def tpr_any(self) -> float:
        return self._share(self.n_window_any)

    @property
    def precision(self) -> float:
        return self._share(self.n_correct)

    @property
    def recall(self) -> float:
        return self.n_found / self.n_true

    @property
    def n_missed(self) -> int:
        return self.n_true - self.n_found


def window_m(recording: Recording) -> float:
    """Half the width of the paper's +-15 % window: 0.15 x the longest horizontal side of the target's
    category.
    """
    truth = recording.truth
    target = next(o for o in truth.objects if o.object_id == truth.target_id)
    if target.category not in recording.categories:
        raise ValueError(f"the recording names no size for category {target.category!r}")
    length_m, width_m, _ = recording.categories[target.category].mean_m
    return WINDOW_SHARE * max(length_m, width_m)


def most_within(distance_m: np.ndarray, width_m: float) -> int:
    """The most distances that an interval of some width can hold, its ends included."""
    ordered = np.sort(distance_m)
    held = np.searchsorted(ordered, ordered + width_m, side="right") - np.arange(len(ordered))
    return int(held.max(initial=0))


def is_hit(recording: Recording, frame: Frame, found: LocalizedObject) -> bool:
    """Whether the object's representative point was inside the target's box, grown by 0.2 m, when it was
    fired at.
    """
    truth = recording.truth
    if len(found.points) == 0 or truth.target_id is None:
        return False
    target_id = truth.target_id
    point = found.points[[median_point(frame.scan.xyz_m[found.points])]]
    fire_ns = frame.truth.fire_ns[point]
    world = lidar_to_world(truth, frame.scan.sensor, fire_ns, frame.scan.xyz_m[point].astype(np.float64))
    in_box = to_child(poses_at(lambda t: truth.poses.object_centre(target_id, t), fire_ns), world)[0]
    size_m = next(o.size_m for o in truth.objects if o.object_id == target_id)
    return bool((np.abs(in_box) <= np.asarray(size_m) / 2 + HIT_MARGIN_M).all())


def score_pairs(
    recording: Recording,
    frames: Sequence[Frame],
    pairs: Sequence[EligiblePair],
    identified: Sequence[Sequence[Identified]],
) -> tuple[PairScore, ...]:
    """One `PairScore` per eligible pair; identified[i] are the output objects of frames[i]."""
    if not pairs:
        return ()
    half_m = window_m(recording)
    target = recording.truth.target_id
    scores = []
    for pair in pairs:
        frame = frames[pair.frame]
        chosen = best(
            [
                known
                for known in identified[pair.frame]
                if known.object_id == target and known.found.sensor == pair.camera
            ],
            recording,
        )
        points = np.empty(0, dtype=np.int64) if chosen is None else chosen.found.points
        distance_m = planar_range_m(frame.scan.xyz_m[points].astype(np.float64))

        def near(reference_m: float, distance_m: np.ndarray = distance_m) -> int:
            return int(np.count_nonzero(np.abs(distance_m - reference_m) <= half_m))

        scores.append(
            PairScore(
                frame=pair.frame,
                scan_sensor=frame.scan.sensor,
                scan_seq=frame.scan.seq,
                scan_stamp_ns=frame.scan.stamp_ns,
                camera=pair.camera,
                track_id=None if chosen is None else chosen.found.track_id,
                visible_fraction=pair.visible_fraction,
                surface_distance_m=pair.surface_distance_m,
                n_mapped=len(points),
                n_window=near(pair.surface_distance_m),
                n_window_centre=near(pair.centre_distance_m),
                n_window_gnss=None if pair.gnss_distance_m is None else near(pair.gnss_distance_m),
                n_window_any=most_within(distance_m, 2.0 * half_m),
                n_correct=int(np.count_nonzero(frame.truth.object_id[points] == target)),
                n_true=len(pair.points),
                n_found=int(np.isin(pair.points, points).sum()),
                hit=chosen is not None and is_hit(recording, frame, chosen.found),
            )
        )
    return tuple(scores)


def mapping_estimates(
    pairs: Sequence[PairScore], identified: Sequence[Sequence[Identified]], has_target: bool
) -> Mapping[str, Estimate]:
    """Every metric of `metrics.MAPPING` by name; identified[i] are the output objects of frame i."""
    mapped = sum(p.n_mapped for p in pairs)
    covered = {
        f"coverage@{T1_POINTS}points": [p.n_missed < T1_POINTS for p in pairs],
        f"coverage@{T1_PERCENT:g}percent": [100.0 * p.n_missed < T1_PERCENT * p.n_true for p in pairs],
    }
    gnss = [p.tpr_gnss for p in pairs if p.tpr_gnss is not None]
    trusted = [p.hit for p in pairs if p.tpr > 0.5]
    estimates = {
        "tpr": mean_of([p.tpr for p in pairs], of=PAIRS),
        "tpr.centre": mean_of([p.tpr_centre for p in pairs], of=PAIRS),
        "tpr.gnss": mean_of(gnss, of="eligible pairs with a GNSS fix"),
        "tpr.nonempty": mean_of(
            [p.tpr for p in pairs if p.n_mapped], of="eligible pairs with a mapped point"
        ),
        "tpr.pooled": ratio_of(sum(p.n_window for p in pairs), mapped, of="mapped points"),
        "precision": mean_of([p.precision for p in pairs], of=PAIRS),
        "precision.pooled": ratio_of(sum(p.n_correct for p in pairs), mapped, of="mapped points"),
        "recall": mean_of([p.recall for p in pairs], of=PAIRS),
        "recall.pooled": ratio_of(sum(p.n_found for p in pairs), sum(p.n_true for p in pairs), of=PAIRS),
        **{name: mean_of(hits, of=PAIRS, spread=False) for name, hits in covered.items()},
        "hit_rate": mean_of([p.hit for p in pairs], of=PAIRS, spread=False),
        "hit_rate.given_tpr": mean_of(trusted, of="eligible pairs with tpr > 0.5", spread=False),
    }
    if not has_target:
        estimates = {name: null("the scenario has no target") for name in estimates}
    false = [sum(known.object_id == FALSE for known in objects) for objects in identified]
    return {**estimates, "false_objects_per_frame": mean_of(false, of="frames")}
