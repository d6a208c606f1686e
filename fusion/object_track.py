"""One object over a run: what was seen of it scan by scan, where its centre is, and how it moves.

All places are in the odometry frame (`odometry.py`), in which a steady object moves steadily even where the
ego turns. A sighting keeps its points, so that the path can be smoothed, the heading taken from the smooth
path and every centre measured again with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int64

from fusion.association import CandidateSet
from fusion.deskew import against_motion
from fusion.geometry import Transform
from fusion.kalman import Belief, KalmanConfig, correct, predict, smooth_robustly, start
from fusion.messages import CategorySize, Trajectory
from fusion.odometry import Odometry, from_odometry
from fusion.shake import ShakeConfig, yaw_shake_rad
from fusion.surface_to_centre import SurfaceConfig, box_heading, is_figure, to_centre


@dataclass(frozen=True, kw_only=True)
class TrackConfig:
    """How centres are measured and smoothed. `push` False: the mean of the points stands for the centre;
    `backward` False: the trajectory is what the filter said while driving."""

    surface: SurfaceConfig = field(default_factory=SurfaceConfig)
    kalman: KalmanConfig = field(default_factory=KalmanConfig)
    surprises: int = 2  # sightings in a row off the predicted path that start it anew
    push: bool = True
    filter: bool = True  # the output's position is the filter's; False: the scan's own
    backward: bool = True
    heading_speed_mps: float = 2.5  # slower, and the path tells no heading
    heading_sightings: int = 4
    sd_m: float = 0.04  # of a centre, and what few points add to it
    sd_point_m: float = 0.3
    remeasure: int = 2  # rounds of smoothing and measuring again
    memory_s: float = 1.2  # of candidate sets
    gather: bool = True  # take and leave points by the category's size; False: the cluster as it is
    coast_s: float = 0.6  # a track without box is followed for so long, and back before its first box
    coast_gate_m: float = 0.5
    shake: ShakeConfig | None = field(default_factory=ShakeConfig)  # None: the gyro's yaw is the path's


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighting:
    """The points [k] that were seen of an object in one scan, and the centre they tell, at `stamp_ns`."""

    scan_stamp_ns: int
    stamp_ns: int
    points: Int64[np.ndarray, " k"]
    fire_ns: Int64[np.ndarray, " k"]
    xy_odom_m: Float64[np.ndarray, "k 2"]
    sensor_odom_m: Float64[np.ndarray, "2"]
    travel_odom_rad: float  # which way the ego went
    ground_m: float
    centre_odom_m: Float64[np.ndarray, "2"]
    sd_m: float
    support: float


@dataclass(kw_only=True)
class ObjectTrack:
    """State of one track id."""

    track_id: int
    category: str
    size: CategorySize
    sets: list[CandidateSet] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)
    belief: Belief | None = None
    detected_ns: int = 0
    looked_back: bool = False
    surprises: int = 0

    def velocity_mps(self, config: TrackConfig) -> Float64[np.ndarray, "2"]:
        """The velocity that is believed; zero while too little was seen to believe any."""
        if self.belief is None or len(self.sightings) < config.heading_sightings:
            return np.zeros(2)
        return self.belief.velocity_mps

    def expected_mean_m(self, stamp_ns: int, config: TrackConfig) -> Float64[np.ndarray, "2"] | None:
        """Where the mean of its points should be: as far from its centre as in the last sighting.

        None before there is a velocity to say so.
        """
        if self.belief is None or len(self.sightings) < 2:
            return None
        last = self.sightings[-1]
        centre_m = predict(self.belief, stamp_ns, config.kalman).position_m
        return centre_m + last.xy_odom_m.mean(axis=0) - last.centre_odom_m

    def take(self, sighting: Sighting, config: TrackConfig) -> None:
        """File a sighting and move the belief on."""
        self.sightings.append(sighting)
        centre_m, sd_m = sighting.centre_odom_m, sighting.sd_m
        if self.belief is None or sighting.stamp_ns <= self.belief.stamp_ns:
            self.belief = start(sighting.stamp_ns, centre_m, sd_m, config.kalman)
            return
        ahead = predict(self.belief, sighting.stamp_ns, config.kalman)
        spread_m = math.sqrt(float(ahead.covariance[0, 0]) + sd_m**2)
        off = float(np.linalg.norm(centre_m - ahead.position_m)) / spread_m / config.kalman.outlier_sds
        self.surprises = self.surprises + 1 if off > 1.5 else 0
        if self.surprises >= config.surprises:  # the path so far was wrong, not the sightings
            ahead, off = (
                start(
                    self.sightings[-self.surprises].stamp_ns,
                    self.sightings[-self.surprises].centre_odom_m,
                    sd_m,
                    config.kalman,
                ),
                1.0,
            )
            for earlier in self.sightings[1 - self.surprises : -1]:
                ahead = correct(
                    predict(ahead, earlier.stamp_ns, config.kalman), earlier.centre_odom_m, earlier.sd_m
                )
            ahead = predict(ahead, sighting.stamp_ns, config.kalman)
            self.surprises = 0
        self.belief = correct(ahead, centre_m, sd_m * max(off, 1.0))

    def backward(self, config: TrackConfig) -> Belief:
        """The belief at the first sighting, by filtering all sightings from the last to the first."""
        last, *rest = sorted(self.sightings, key=lambda s: -s.stamp_ns)
        belief = start(last.stamp_ns, last.centre_odom_m, last.sd_m, config.kalman)
        for sighting in rest:
            ahead = predict(belief, sighting.stamp_ns, config.kalman)
            belief = correct(ahead, sighting.centre_odom_m, sighting.sd_m)
        return belief


def heading_of(
    xy_m: Float64[np.ndarray, "k 2"],
    velocity_mps: Float64[np.ndarray, "2"],
    travel_odom_rad: float,
    size: CategorySize,
    config: TrackConfig,
) -> float:
    """The heading of an object with points [k]: its way; where it is slow its sides, near the ego's way."""
    if math.hypot(*velocity_mps) > config.heading_speed_mps:
        return math.atan2(velocity_mps[1], velocity_mps[0])
    if is_figure(size, config.surface):
        return travel_odom_rad
    return box_heading(xy_m, travel_odom_rad, size)


def centre_of(
    xy_m: Float64[np.ndarray, "k 2"],
    sensor_odom_m: Float64[np.ndarray, "2"],
    heading_rad: float,
    size: CategorySize,
    config: TrackConfig,
) -> Float64[np.ndarray, "2"]:
    """The centre of an object with points [k] at one instant."""
    if not config.push:
        mean: np.ndarray = xy_m.mean(axis=0)
        return mean
    return to_centre(xy_m, sensor_odom_m, heading_rad, size, config.surface)


def centre_sd_m(points: int, config: TrackConfig) -> float:
    """Spread of a centre that `points` points tell."""
    return config.sd_m + config.sd_point_m / math.sqrt(points)


def trajectory(
    track: ObjectTrack,
    scans_ns: Sequence[int],
    odometry: Odometry,
    T_ego_work: Transform,
    config: TrackConfig,
) -> Trajectory | None:
    """The smooth path of a track in the ego frame, a sample for every scan from its first sighting to its
    last; None without any. `scans_ns`: stamps of all scans.

    `inlier` is False where the object was not sighted or the sighting was not believed.
    """
    sightings = sorted({s.stamp_ns: s for s in track.sightings}.values(), key=lambda s: s.stamp_ns)
    if not sightings:
        return None
    seen_ns = np.array([s.stamp_ns for s in sightings], dtype=np.int64)
    stamp_ns, index = _stamps(sightings, seen_ns, scans_ns)
    centre_m = np.stack([s.centre_odom_m for s in sightings])
    sd_m = np.full(len(stamp_ns), np.inf)
    sd_m[index] = [s.sd_m for s in sightings]
    position_m = np.zeros((len(stamp_ns), 2))
    position_m[index] = centre_m
    factor = np.ones(len(stamp_ns))
    if config.backward:
        for round_ in range(config.remeasure + 1):
            states, factor = smooth_robustly(stamp_ns, position_m, sd_m, config.kalman)
            if round_ < config.remeasure:
                position_m[index] = [
                    _again(s, state[1], track.size, config)
                    for s, state in zip(sightings, states[index], strict=True)
                ]
        path_m = states[:, 0]
    else:
        path_m = np.column_stack([np.interp(stamp_ns, seen_ns, centre_m[:, axis]) for axis in (0, 1)])
    pose = odometry.pose(stamp_ns)
    if config.shake is not None:
        pose[:, 2] -= yaw_shake_rad(odometry, stamp_ns, config.shake)
    xy_m = from_odometry(path_m, pose)
    ground_m = np.interp(stamp_ns, seen_ns, [s.ground_m for s in sightings])
    z_m = ground_m + 0.5 * track.size.mean_m[2]
    return Trajectory(
        track_id=track.track_id,
        stamp_ns=stamp_ns,
        position_ego_m=T_ego_work.apply(np.column_stack([xy_m, z_m])),
        inlier=np.isfinite(sd_m) & (factor < 2.0),
    )


def _again(
    sighting: Sighting, velocity_mps: Float64[np.ndarray, "2"], size: CategorySize, config: TrackConfig
) -> Float64[np.ndarray, "2"]:
    xy_m = against_motion(sighting.xy_odom_m, sighting.fire_ns, sighting.stamp_ns, velocity_mps)
    heading_rad = heading_of(xy_m, velocity_mps, sighting.travel_odom_rad, size, config)
    return centre_of(xy_m, sighting.sensor_odom_m, heading_rad, size, config)


def _stamps(
    sightings: Sequence[Sighting], seen_ns: Int64[np.ndarray, " n"], scans_ns: Sequence[int]
) -> tuple[Int64[np.ndarray, " m"], Int64[np.ndarray, " n"]]:
    """All instants of the path, ascending, and where the sightings are among them.

    In a scan without sighting: when it would have hit the object, between the scans that did.
    """
    seen_in = np.array([s.scan_stamp_ns for s in sightings], dtype=np.int64)
    order = np.argsort(seen_in, kind="stable")
    known, within = seen_in[order], (seen_ns - seen_in)[order]
    missed = np.array(
        sorted({ns for ns in scans_ns if known[0] < ns < known[-1]} - set(seen_in.tolist())), dtype=np.int64
    )
    offset = np.rint(np.interp(missed - known[0], known - known[0], within)).astype(np.int64)
    stamp_ns = np.unique(np.concatenate([seen_ns, missed + offset]))
    return stamp_ns, np.searchsorted(stamp_ns, seen_ns)
