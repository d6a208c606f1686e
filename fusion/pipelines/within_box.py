"""What the rivals share that choose among the points of a box: `select` is the method, all else is as in
`StaticProjectionGround`: step 1, the box as it was detected, steps 5 and 6. So any difference between them
comes from the mapping only.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from fusion.aoi import AoiConfig, map_into_boxes
from fusion.geometry import Transform
from fusion.ground import GroundConfig, remove_ground
from fusion.localize import LocalizeConfig, localize
from fusion.messages import BoxPx, Calibration, Detections, LidarScan, LocalizedObject
from fusion.pipelines.base import ScanPipeline, areas
from fusion.smooth import SmootherConfig
from fusion.timing import StepClock


@dataclass(frozen=True, kw_only=True)
class RivalConfig:
    """What every rival shares with the baseline. `ground` None: every finite point, ground included."""

    ground: GroundConfig | None = field(default_factory=GroundConfig)
    localize: LocalizeConfig = field(default_factory=LocalizeConfig)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxPoints:
    """The points that map into a box (the part of it that lies in the image), and where the camera sits.

    xyz_lidar_m [k 3] and uv_px [k 2]: k may be 0. camera_lidar_m [3]: the camera's origin, LiDAR frame.
    """

    xyz_lidar_m: Float32[np.ndarray, "k 3"]
    uv_px: Float64[np.ndarray, "k 2"]
    box_px: BoxPx
    camera_lidar_m: Float64[np.ndarray, "3"]


class WithinBox(ScanPipeline):
    """Ground off, the points in each box, `select` among them; no object where it selects none."""

    steps = ("ground", "aoi", "select", "localize")

    def __init__(self, shared: RivalConfig) -> None:
        self._shared = shared
        super().__init__(shared.smoother)

    @abstractmethod
    def select(self, inside: BoxPoints) -> Bool[np.ndarray, " k"]:
        """Which of the points of a box belong to its object."""

    def map_scan(
        self, scan: LidarScan, paired: tuple[Detections, ...], calibration: Calibration, clock: StepClock
    ) -> tuple[LocalizedObject, ...]:
        T_ego_lidar = calibration.T_ego_sensor[scan.sensor]
        with clock("ground"):
            kept = without_ground(scan.xyz_m, T_ego_lidar, self._shared.ground)
            xyz_m = scan.xyz_m.T.take(kept, axis=1)
        objects = []
        for detections in paired:
            camera = calibration.cameras[detections.sensor]
            T_camera_lidar = calibration.T_camera_lidar(detections.sensor, scan.sensor)
            camera_lidar_m = T_camera_lidar.inverse().translation_m
            with clock("aoi"):
                boxes = areas(detections, camera, AoiConfig(widen=0.0))
                mapped = map_into_boxes(xyz_m, T_camera_lidar, camera, [box_px for _, box_px in boxes])
            for (detection, box_px), inside in zip(boxes, mapped, strict=True):
                points = kept[inside.points]
                with clock("select"):
                    chosen = points[
                        self.select(
                            BoxPoints(
                                xyz_lidar_m=scan.xyz_m[points],
                                uv_px=inside.uv_px,
                                box_px=box_px,
                                camera_lidar_m=camera_lidar_m,
                            )
                        )
                    ]
                if len(chosen) == 0:
                    continue
                with clock("localize"):
                    objects.append(
                        localize(
                            scan,
                            chosen,
                            detection=detection,
                            camera=detections.sensor,
                            T_ego_lidar=T_ego_lidar,
                            confidence=min(max(detection.confidence, 0.0), 1.0),
                            config=self._shared.localize,
                        )
                    )
        return tuple(objects)


def without_ground(
    xyz_m: Float32[np.ndarray, "n 3"], T_ego_lidar: Transform, config: GroundConfig | None
) -> Int64[np.ndarray, " k"]:
    """Ascending indices of the points [n 3] that step 1 keeps; with None of all that are finite."""
    if config is None:
        return np.flatnonzero(np.isfinite(xyz_m).all(axis=1))
    return np.flatnonzero(remove_ground(xyz_m, T_ego_lidar, config).keep)
