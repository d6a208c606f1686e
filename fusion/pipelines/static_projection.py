"""The paper's baseline: eq. 6 with the static calibration, and the points that fall into the box.

The paper does not say whether ground points were removed before the baseline was counted, so there are both:
`StaticProjection` takes the raw box, `StaticProjectionGround` the box after step 1. Distance and angle
(step 5) and the smoother (step 6) are the same as in `Probabilistic`, so that localization can be compared
and any difference comes from steps 2 to 4.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fusion.aoi import AoiConfig, map_into_boxes
from fusion.ground import GroundConfig, remove_ground
from fusion.localize import LocalizeConfig, localize
from fusion.messages import Calibration, Detections, LidarScan, LocalizedObject
from fusion.pipelines.base import ScanPipeline, areas
from fusion.smooth import SmootherConfig
from fusion.timing import StepClock


@dataclass(frozen=True, kw_only=True)
class StaticProjectionConfig:
    """`ground` is None for the raw box."""

    ground: GroundConfig | None = None
    localize: LocalizeConfig = field(default_factory=LocalizeConfig)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)


class StaticProjection(ScanPipeline):
    """Every point that eq. 6 maps into the box belongs to the object."""

    steps = ("ground", "aoi", "localize")

    def __init__(self, config: StaticProjectionConfig | None = None) -> None:
        self.config = StaticProjectionConfig() if config is None else config
        super().__init__(self.config.smoother)

    def map_scan(
        self, scan: LidarScan, paired: tuple[Detections, ...], calibration: Calibration, clock: StepClock
    ) -> tuple[LocalizedObject, ...]:
        T_ego_lidar = calibration.T_ego_sensor[scan.sensor]
        with clock("ground"):
            if self.config.ground is None:
                kept = np.arange(len(scan.xyz_m))
            else:
                kept = np.flatnonzero(remove_ground(scan.xyz_m, T_ego_lidar, self.config.ground).keep)
            xyz_m = scan.xyz_m.T.take(kept, axis=1)
        objects = []
        for detections in paired:
            camera = calibration.cameras[detections.sensor]
            with clock("aoi"):
                boxes = areas(detections, camera, AoiConfig(widen=0.0))
                T_camera_lidar = calibration.T_camera_lidar(detections.sensor, scan.sensor)
                mapped = map_into_boxes(xyz_m, T_camera_lidar, camera, [box for _, box in boxes])
            with clock("localize"):
                objects += [
                    localize(
                        scan,
                        kept[inside.points],
                        detection=detection,
                        camera=detections.sensor,
                        T_ego_lidar=T_ego_lidar,
                        confidence=min(max(detection.confidence, 0.0), 1.0),
                        config=self.config.localize,
                    )
                    for (detection, _), inside in zip(boxes, mapped, strict=True)
                    if len(inside.points) > 0
                ]
        return tuple(objects)


class StaticProjectionGround(StaticProjection):
    """The same after step 1: points outside the region and on the ground plane are not mapped."""

    def __init__(self) -> None:
        super().__init__(StaticProjectionConfig(ground=GroundConfig()))
