"""Samples of all cameras become one trajectory per track; sweeps that missed it are filled in."""

from __future__ import annotations

import numpy as np

from fusion.messages import LocalizedObject
from fusion.smooth import SmootherConfig
from fusion.tracks import Tracks
from tests.fusion.make import lidar_scan

MS = 1_000_000


def found(track_id: int, stamp_ns: int, x: float, camera: str = "front") -> LocalizedObject:
    return LocalizedObject(
        track_id=track_id,
        category="car",
        sensor=camera,
        stamp_ns=stamp_ns,
        points=np.zeros(0, dtype=np.int64),
        position_ego_m=np.array([x, 0.0, 0.0]),
        distance_m=x,
        azimuth_rad=0.0,
        confidence=1.0,
    )


def test_cameras_share_a_trajectory_and_tracks_do_not() -> None:
    tracks = Tracks()
    for seq in range(6):
        at = seq * 100 * MS
        seen = (found(9, at + 10, 5.0), found(9, at + 40, 5.0, "rear"), found(2, at + 10, 8.0))
        tracks.add(lidar_scan(seq=seq, stamp_ns=at), seen)
    two, nine = tracks.trajectories(SmootherConfig())
    assert (two.track_id, len(two.stamp_ns)) == (2, 6)
    assert (nine.track_id, len(nine.stamp_ns)) == (9, 12)


def test_a_missed_sweep_is_filled_in_at_the_time_it_would_have_hit_the_object() -> None:
    tracks = Tracks()
    for seq in range(8):
        at = seq * 100 * MS
        hit = () if seq in (0, 3, 7) else (found(1, at + (20 + seq) * MS, 2.0 * seq),)
        tracks.add(lidar_scan(seq=seq, stamp_ns=at), hit)
    (track,) = tracks.trajectories(SmootherConfig())
    assert (track.stamp_ns // MS).tolist() == [121, 222, 323, 424, 525, 626]  # 0 and 7: no extrapolation
    assert track.inlier.tolist() == [True, True, False, True, True, True]
    np.testing.assert_allclose(track.position_ego_m[:, 0], [2, 4, 6, 8, 10, 12], atol=1e-9)


def test_no_scans_make_no_trajectories() -> None:
    assert Tracks().trajectories(SmootherConfig()) == ()
