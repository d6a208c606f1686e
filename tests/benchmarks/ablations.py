"""`robust` with one ingredient switched off, each a pipeline for `simbench run`:

    python3 dev.py run simbench run overtake-approach --pipeline robust \\
        --pipeline tests/benchmarks/ablations.py:no_deskew --out out/ablation
    python3 dev.py run python tests/benchmarks/fusion_table.py out/ablation
"""

from __future__ import annotations

from dataclasses import replace

from fusion.box_matching import MatchingConfig
from fusion.candidates import CandidateConfig
from fusion.object_track import TrackConfig
from fusion.pipelines.robust import Robust, RobustConfig
from fusion.scene import SceneConfig


def no_motion() -> Robust:
    """As if no ego motion were measured: nothing is deskewed, the odometry frame stands still."""
    return Robust(RobustConfig(use_motion=False))


def no_deskew() -> Robust:
    """Points stay where the moving sensor saw them."""
    return Robust(RobustConfig(scene=SceneConfig(deskew=False)))


def one_ground_plane() -> Robust:
    """The paper's plane by RANSAC in place of the ground by sector."""
    return Robust(RobustConfig(scene=SceneConfig(local=False)))


def no_range_prior() -> Robust:
    """A box's height tells no range."""
    return _matching(CandidateConfig(range_prior=False))


def no_count_prior() -> Robust:
    """Clusters of few points are as good as others."""
    return _matching(CandidateConfig(count_prior=False))


def no_shift() -> Robust:
    """Pictures never shift."""
    return Robust(RobustConfig(shift=None))


def scan_by_scan() -> Robust:
    """The best candidate of each scan, whatever its motion over time."""
    return Robust(RobustConfig(association=None))


def no_push() -> Robust:
    """The mean of the surface stands for the centre."""
    return _track(TrackConfig(push=False))


def no_gather() -> Robust:
    """The cluster as it is, whatever the category's size."""
    return _track(TrackConfig(gather=False))


def no_coast() -> Robust:
    """Without a box there is no sighting, and none before the first."""
    return Robust(RobustConfig(look_back=0, track=TrackConfig(coast_s=0.0)))


def forward_only() -> Robust:
    """The trajectory is what the filter said while driving."""
    return _track(TrackConfig(backward=False))


def no_remeasuring() -> Robust:
    """Centres stay as they were measured while driving."""
    return _track(TrackConfig(remeasure=0))


def shake_unknown() -> Robust:
    """The gyro's yaw is the path's."""
    return _track(TrackConfig(shake=None))


def _matching(candidates: CandidateConfig) -> Robust:
    return Robust(RobustConfig(matching=replace(MatchingConfig(), candidates=candidates)))


def _track(track: TrackConfig) -> Robust:
    return Robust(RobustConfig(track=track))
