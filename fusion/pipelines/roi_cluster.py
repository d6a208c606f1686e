"""Rival: the cluster whose rectangle fits the box best, as in Autoware's `roi_cluster_fusion`.

The whole sweep without ground is clustered first, seen from above, by the recipe of Autoware's
`voxel_grid_based_euclidean_cluster`: points fall into columns of side `cell_m`, columns whose centroids are
within `tolerance_m` share a cluster, clusters of fewer than `min_points` are dropped. Then each cluster is
projected: its rectangle bounds those of its points that lie in the image. The cluster with the highest IoU
(intersection over union) of rectangle and box is the object, with all its points, if that IoU is above
`min_iou`.

The threshold is the first that Autoware published (`roi_cluster_fusion.launch.xml`, 2022). Its present one,
`RoiClusterConfig.strict()`, also wants the rectangle within the box enlarged by a tenth; in our drives it
finds less than half as much, because a rectangle without the ground is lower than its box.

Not taken over: the upper limit of 3000 points (clouds are thinned there, here they are not). And there a box
gives a cluster its label, here a cluster gives a box its points, so that two boxes may share one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64

from fusion.aoi import AoiConfig, enlarge, map_into_boxes
from fusion.camera import PinholeCamera
from fusion.euclidean import euclidean_clusters, voxels
from fusion.geometry import Transform
from fusion.iou import bounding_boxes, iou, within
from fusion.localize import localize
from fusion.messages import BoxPx, Calibration, Detections, LidarScan, LocalizedObject
from fusion.pipelines.base import ScanPipeline, areas
from fusion.pipelines.within_box import RivalConfig, without_ground
from fusion.timing import StepClock


@dataclass(frozen=True, kw_only=True)
class RoiClusterConfig(RivalConfig):
    """How the sweep is clustered, and how well a cluster must fit. `box_scale` None: it may stick out."""

    cell_m: float = 0.3  # Autoware: voxel_leaf_size
    tolerance_m: float = 0.7  # Autoware: tolerance
    min_points: int = 10  # Autoware: min_cluster_size
    min_iou: float = 0.35  # Autoware, 2022: iou_threshold
    box_scale: float | None = None

    @staticmethod
    def strict() -> RoiClusterConfig:
        """As Autoware sets it now: iou_threshold of every known class; only_allow_inside_cluster."""
        return RoiClusterConfig(min_iou=0.65, box_scale=1.1)


class RoiCluster(ScanPipeline):
    """The best-fitting cluster of the whole sweep; none where no cluster fits well enough."""

    steps = ("ground", "cluster", "aoi", "select", "localize")

    def __init__(self, config: RoiClusterConfig | None = None) -> None:
        self.config = RoiClusterConfig() if config is None else config
        super().__init__(self.config.smoother)

    def map_scan(
        self, scan: LidarScan, paired: tuple[Detections, ...], calibration: Calibration, clock: StepClock
    ) -> tuple[LocalizedObject, ...]:
        T_ego_lidar = calibration.T_ego_sensor[scan.sensor]
        with clock("ground"):
            kept = without_ground(scan.xyz_m, T_ego_lidar, self.config.ground)
        with clock("cluster"):
            clustered, label = cluster_columns(scan.xyz_m[kept], self.config)
            points = kept[clustered]
            xyz_m = np.ascontiguousarray(scan.xyz_m[points].T)
        objects = []
        for detections in paired:
            camera = calibration.cameras[detections.sensor]
            with clock("aoi"):
                boxes = areas(detections, camera, AoiConfig(widen=0.0))
                T_camera_lidar = calibration.T_camera_lidar(detections.sensor, scan.sensor)
                rectangles_px = _rectangles(xyz_m, label, T_camera_lidar, camera)
            for detection, box_px in boxes:
                with clock("select"):
                    best = best_fit(rectangles_px, box_px, self.config)
                if best is None:
                    continue
                with clock("localize"):
                    objects.append(
                        localize(
                            scan,
                            points[label == best],
                            detection=detection,
                            camera=detections.sensor,
                            T_ego_lidar=T_ego_lidar,
                            confidence=min(max(detection.confidence, 0.0), 1.0),
                            config=self.config.localize,
                        )
                    )
        return tuple(objects)


def cluster_columns(
    xyz_m: Float32[np.ndarray, "n 3"], config: RoiClusterConfig
) -> tuple[Int64[np.ndarray, " k"], Int64[np.ndarray, " k"]]:
    """Ascending indices [k] of the points that belong to a cluster, and for each its number 0, 1, ..."""
    columns = voxels(xyz_m[:, :2], config.cell_m)
    label = euclidean_clusters(columns.centroid_m, config.tolerance_m)[columns.cell_of_point]
    large = np.bincount(label) >= config.min_points
    clustered = np.flatnonzero(large[label])
    return clustered, (np.cumsum(large) - 1)[label[clustered]]


def best_fit(
    rectangles_px: Float64[np.ndarray, "n 4"], box_px: BoxPx, config: RoiClusterConfig
) -> int | None:
    """The cluster whose rectangle fits the box best; None where none fits well enough."""
    if len(rectangles_px) == 0:
        return None
    fit = iou(rectangles_px, box_px)
    if config.box_scale is not None:
        grown = config.box_scale - 1.0
        fit[~within(rectangles_px, enlarge(box_px, AoiConfig(widen=grown, heighten=grown)))] = 0.0
    best = int(np.argmax(fit))
    return best if fit[best] > config.min_iou else None


def _rectangles(
    xyz_m: Float32[np.ndarray, "3 n"],
    label: Int64[np.ndarray, " n"],
    T_camera_lidar: Transform,
    camera: PinholeCamera,
) -> Float64[np.ndarray, "c 4"]:
    """The rectangle of every cluster's points in the image; NaN for a cluster without any."""
    image_px = (0.0, 0.0, float(camera.width_px), float(camera.height_px))
    (seen,) = map_into_boxes(xyz_m, T_camera_lidar, camera, [image_px])
    return bounding_boxes(seen.uv_px, label[seen.points], int(label.max(initial=-1)) + 1)
