"""What one scan shows of an object: from a cluster to its points and its centre."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from fusion.deskew import against_motion
from fusion.object_track import ObjectTrack, Sighting, TrackConfig, centre_of, centre_sd_m, heading_of
from fusion.odometry import to_odometry
from fusion.scene import Scene
from fusion.surface_to_centre import is_figure


def sight(
    scene: Scene,
    track: ObjectTrack,
    points: Int64[np.ndarray, " k"],
    velocity_mps: Float64[np.ndarray, "2"],
    support: float,
    config: TrackConfig,
) -> Sighting:
    """The object of which `points` (rows of the scene, k >= 1) are a part: all its points, its centre.

    A figure keeps those of its cluster that fit its size. A box takes what lies in it, whatever cluster that
    is in: at a distance bonnet and roof come apart.
    """
    figure = is_figure(track.size, config.surface)
    heading_rad = None
    for last in (False, True):
        fire_ns = scene.fire_ns[points]
        stamp_ns = middle(fire_ns)
        xy_m = against_motion(scene.xy_odom_m[points], fire_ns, stamp_ns, velocity_mps)
        if heading_rad is None:
            heading_rad = heading_of(xy_m, velocity_mps, scene.travel_odom_rad, track.size, config)
        centre_m = centre_of(xy_m, scene.sensor_odom_m, heading_rad, track.size, config)
        if last or not config.gather:
            break
        around = scene.within(centre_m, heading_rad, track.size, figure, points)
        if len(around) == 0 or np.array_equal(around, points):
            break
        points = around
    return Sighting(
        scan_stamp_ns=scene.stamp_ns,
        stamp_ns=stamp_ns,
        points=np.sort(scene.points[points]),
        fire_ns=scene.fire_ns[points],
        xy_odom_m=scene.xy_odom_m[points],
        sensor_odom_m=scene.sensor_odom_m,
        travel_odom_rad=scene.travel_odom_rad,
        ground_m=float(np.mean(scene.xyz_m[points, 2] - scene.height_m[points])),
        centre_odom_m=centre_m,
        sd_m=centre_sd_m(len(points), config),
        support=support,
    )


def middle(values: Int64[np.ndarray, " k"]) -> int:
    """The value at the middle rank, of two the lower; k >= 1."""
    half = (len(values) - 1) // 2
    return int(np.partition(values, half)[half])


def look_where_expected(
    scene: Scene,
    track: ObjectTrack,
    centre_m: Float64[np.ndarray, "2"],
    velocity_mps: Float64[np.ndarray, "2"],
    beside: Sighting,
    config: TrackConfig,
) -> Sighting | None:
    """The sighting of a track that no box shows, `centre_m` being where its centre should be; None where
    nothing like it stands there. `beside`: its sighting nearest in time, which tells where its points lie.
    """
    clusters = scene.clusters(is_figure(track.size, config.surface))
    if len(clusters.count) == 0:
        return None
    expected_m = centre_m + beside.xy_odom_m.mean(axis=0) - beside.centre_odom_m
    off_m = np.linalg.norm(to_odometry(clusters.mean_m, scene.pose) - expected_m, axis=1)
    nearest = int(np.argmin(off_m))
    # Which of its points a car shows changes more from scan to scan than where its centre is.
    if off_m[nearest] > config.coast_gate_m + 0.25 * track.size.mean_m[0]:
        return None
    found = sight(scene, track, clusters.points(nearest), velocity_mps, 0.0, config)
    moved_m = centre_m + velocity_mps * (found.stamp_ns - scene.expected_ns(beside)) * 1e-9
    near = float(np.linalg.norm(found.centre_odom_m - moved_m)) < config.coast_gate_m
    return found if near else None
