"""A scan as what stands on the ground: cropped, ground taken off, brought to one instant, clustered.

Everything is in the working frame (`working_frame.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32, Float64, Int64

from fusion.deskew import poses_at
from fusion.footprint import Clusters, FootprintConfig, cluster_from_above
from fusion.geometry import Transform
from fusion.ground import GroundConfig, remove_ground
from fusion.local_ground import LocalGroundConfig, fit_local_ground
from fusion.messages import CategorySize, LidarScan
from fusion.object_track import Sighting
from fusion.odometry import from_odometry, to_odometry
from fusion.surface_to_centre import heading_axes
from fusion.working_frame import WorkingFrame


@dataclass(frozen=True, kw_only=True)
class SceneConfig:
    """What of a scan is looked at, and how it falls into clusters."""

    max_range_m: float = 70.0
    clearance_m: float = 0.1  # this far above ground, and more with range: no ground any more
    clearance_per_m: float = 0.002
    ceiling_m: float = 4.0
    footprint: FootprintConfig = field(default_factory=FootprintConfig)
    deskew: bool = True
    local: bool = True  # False: one plane by RANSAC
    local_ground: LocalGroundConfig = field(default_factory=LocalGroundConfig)
    plane: GroundConfig = field(
        default_factory=lambda: GroundConfig(length_m=140.0, width_m=140.0, distance_m=0.12)
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """The points above ground [k]: which of the scan, when, where (at `at_ns`, working frame; odometry
    frame), how high above ground; their clusters for small and large objects. `pose`, `sensor_odom_m` and
    `travel_odom_rad`: where frame and LiDAR are at `at_ns` and which way the ego goes, odometry frame.
    """

    stamp_ns: int
    at_ns: int
    pose: Float64[np.ndarray, "1 3"]
    sensor_odom_m: Float64[np.ndarray, "2"]
    travel_odom_rad: float
    points: Int64[np.ndarray, " k"]
    fire_ns: Int64[np.ndarray, " k"]
    xyz_m: Float64[np.ndarray, "k 3"]
    xy_odom_m: Float64[np.ndarray, "k 2"]
    height_m: Float64[np.ndarray, " k"]
    fine: Clusters
    coarse: Clusters
    beams_per_sr: float | None

    def clusters(self, figure: bool) -> Clusters:
        """Those in which to look for upright figures, or for all that is larger."""
        return self.fine if figure else self.coarse

    def expected_ns(self, sighting: Sighting) -> int:
        """When this sweep hits what another one saw: as long after its start."""
        return self.stamp_ns + (sighting.stamp_ns - sighting.scan_stamp_ns)

    def place_of(self, clusters: Clusters) -> tuple[Float64[np.ndarray, "c 2"], Float64[np.ndarray, " c"]]:
        """Each cluster's mean place, odometry frame, and mean firing time after the sweep's start [ns]."""
        if len(clusters.count) == 0:
            return np.zeros((0, 2)), np.zeros(0)
        after_ns = (self.fire_ns[clusters.order] - self.stamp_ns).astype(np.float64)
        mean_ns = np.add.reduceat(after_ns, clusters.start[:-1]) / clusters.count
        return to_odometry(clusters.mean_m, self.pose), mean_ns

    def within(
        self,
        centre_odom_m: Float64[np.ndarray, "2"],
        heading_rad: float,
        size: CategorySize,
        figure: bool,
        points: Int64[np.ndarray, " k"],
    ) -> Int64[np.ndarray, " m"]:
        """Of a figure those of `points` that the category's size allows, with some room. Of a box also what
        else lies in it, but for clusters that reach out of it: those are neighbours.
        """
        length_m, width_m, height_m = size.mean_m
        if figure:
            off = self.xy_odom_m[points] - centre_odom_m
            near = np.hypot(off[:, 0], off[:, 1]) < 0.5 * length_m * (1.0 + 3.0 * size.spread) + 0.2
            return points[near & (self.height_m[points] < 1.3 * height_m)]
        along, across = heading_axes(heading_rad) @ (self.xy_odom_m - centre_odom_m).T
        near = np.abs(along) < 0.5 * length_m * (1.0 + 2.0 * size.spread) + 0.15
        near &= np.abs(across) < 0.5 * width_m * (1.0 + 2.0 * size.spread) + 0.15
        rows = np.flatnonzero(near & (self.height_m < 1.3 * height_m))
        label = self.fine.label[rows]
        inside = np.bincount(label + 1, minlength=len(self.fine.count) + 1)[1:]
        whole = inside >= 0.8 * self.fine.count
        whole[self.fine.label[points][self.fine.label[points] >= 0]] = True
        return rows[np.where(label >= 0, np.append(whole, False)[label], True)]


def build_scene(scan: LidarScan, frame: WorkingFrame, config: SceneConfig) -> Scene:
    """The scene of a scan. Points that are not finite or beyond the range are left out."""
    T_work_lidar, odometry = frame.T_work_sensor[scan.sensor], frame.odometry
    xyz = np.ascontiguousarray(scan.xyz_m.T, dtype=np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        xyz = T_work_lidar.rotation.astype(np.float32) @ xyz
        xyz += T_work_lidar.translation_m.astype(np.float32)[:, None]
        inside = xyz[0] ** 2 + xyz[1] ** 2 <= config.max_range_m**2
        inside &= np.abs(xyz[2]) < 0.5 * config.max_range_m
    kept = np.flatnonzero(inside)
    xyz = xyz[:, kept]
    range_m = np.sqrt(xyz[0] ** 2 + xyz[1] ** 2)
    height = _height_m(scan, kept, xyz, range_m, T_work_lidar, config)
    standing = height > config.clearance_m + config.clearance_per_m * range_m
    above = np.flatnonzero(standing & (height < config.ceiling_m))
    points = kept[above]
    fire_ns = scan.stamp_ns + scan.offset_ns[points].astype(np.int64)
    xy_m = xyz[:2, above].T.astype(np.float64)
    at_ns = scan.stamp_ns + (int(scan.offset_ns.max()) // 2 if len(scan.offset_ns) else 0)
    pose = odometry.pose(np.array([at_ns]))
    if config.deskew:
        xy_odom_m = to_odometry(xy_m, poses_at(odometry, fire_ns))
        xy_m = from_odometry(xy_odom_m, pose)
    else:
        xy_odom_m = to_odometry(xy_m, pose)
    heights = height[above].astype(np.float64)
    xyz_m = np.column_stack([xy_m, xyz[2, above].astype(np.float64)])
    return Scene(
        stamp_ns=scan.stamp_ns,
        at_ns=at_ns,
        pose=pose,
        sensor_odom_m=to_odometry(T_work_lidar.translation_m[None, :2], pose)[0],
        travel_odom_rad=float(pose[0, 2]) + frame.travel_rad(),
        points=points,
        fire_ns=fire_ns,
        xyz_m=xyz_m,
        xy_odom_m=xy_odom_m,
        height_m=heights,
        fine=cluster_from_above(xyz_m, heights, config.footprint.fine_cell_m, config.footprint),
        beams_per_sr=frame.beams_per_sr(scan),
        coarse=cluster_from_above(xyz_m, heights, config.footprint.coarse_cell_m, config.footprint),
    )


def _height_m(
    scan: LidarScan,
    kept: Int64[np.ndarray, " k"],
    xyz_m: Float32[np.ndarray, "3 k"],
    range_m: Float32[np.ndarray, " k"],
    T_work_lidar: Transform,
    config: SceneConfig,
) -> Float32[np.ndarray, " k"]:
    """Height above ground of the kept points."""
    if config.local:
        azimuth_rad = np.arctan2(xyz_m[1], xyz_m[0])
        ground = fit_local_ground(range_m, azimuth_rad, xyz_m[2], config.local_ground)
        return np.asarray(xyz_m[2] - ground.at(range_m, azimuth_rad))
    plane = remove_ground(scan.xyz_m[kept], T_work_lidar, config.plane).plane
    if plane is None:
        return xyz_m[2]
    distance = scan.xyz_m[kept].astype(np.float64) @ plane.normal_lidar + plane.offset_m
    return np.asarray(distance, dtype=np.float32)
