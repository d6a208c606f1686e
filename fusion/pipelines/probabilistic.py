"""The paper's probabilistic fusion (Shen et al., arXiv 2311.04410): six steps, one file each.

1 `ground.py`      drop what is far from the ego and what lies on the ground plane (RANSAC)
2 `aoi.py`         map the rest into the enlarged boxes
3 `clustering.py`  candidate clusters: the modes of the distance in each box
4 `shape.py`       the candidate whose shape is most like the category's
5 `localize.py`    distance and angle of its median point
6 `smooth.py`      the track over the run, outliers removed

What they are for (eqs. 1 to 5): the mapping M puts a LiDAR point on a pixel, with errors (e_l, e_w). Of the
points p_k of object k, G(M^-1(c_k)) shall miss fewer than t1 with probability t2 or more, c_k being its box.
The paper gives t1 and t2 no value and never measures them; what it reports is the share of selected points
at the object's distance.

`ProbabilisticConfig()` is the method with our readings where the text leaves a gap or fails as printed
(pipeline `probabilistic`); `ProbabilisticConfig.paper()` follows the print (`probabilistic_paper`). Where a
value comes from stands beside it, in the config of its step ("paper", or "ours" where the paper names none).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fusion.aoi import AoiConfig, map_into_boxes
from fusion.clustering import ClusteringConfig
from fusion.explain import AoiExplanation, explain_aoi
from fusion.ground import GroundConfig, remove_ground
from fusion.localize import LocalizeConfig, localize, planar_distance_m
from fusion.messages import Calibration, CategorySize, Detections, LidarScan, LocalizedObject
from fusion.pipelines.base import ScanPipeline, areas
from fusion.shape import BenchmarkShapes, ShapeConfig, load_benchmark_shapes
from fusion.smooth import SmootherConfig
from fusion.timing import StepClock

_STEPS = ("ground", "aoi", "clustering", "shape", "localize")


@dataclass(frozen=True, kw_only=True)
class CategoryConfig:
    """What steps 3 and 4 need to know of a category."""

    name: str
    granularity_m: float  # bin width; the paper: "hyper-parameter based on the class", no number
    min_points: int  # of a peak; the paper names the parameter, not its value


# Ours (reading of the paper): pedestrian 0.5-1 m, rider 0.6-1 m, car 2 m, truck 4-8 m; 4-6 points. The bin
# width drives the paper's TPR: a thin slice of an object scores higher than all of its true points.
CATEGORIES = (
    CategoryConfig(name="pedestrian", granularity_m=0.6, min_points=4),
    CategoryConfig(name="rider", granularity_m=0.8, min_points=4),
    CategoryConfig(name="car", granularity_m=2.0, min_points=6),
    CategoryConfig(name="truck", granularity_m=6.0, min_points=6),
)


@dataclass(frozen=True, kw_only=True)
class ProbabilisticConfig:
    """Every hyper-parameter of the six steps, by step."""

    ground: GroundConfig = field(default_factory=GroundConfig)
    aoi: AoiConfig = field(default_factory=AoiConfig)
    clustering: ClusteringConfig = field(default_factory=ClusteringConfig)
    categories: tuple[CategoryConfig, ...] = CATEGORIES
    shape: ShapeConfig = field(default_factory=ShapeConfig)
    localize: LocalizeConfig = field(default_factory=LocalizeConfig)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)

    @staticmethod
    def paper() -> ProbabilisticConfig:
        """As printed, but for the argmax of KL, which picks the least similar cluster (`least_similar`)."""
        return ProbabilisticConfig(
            ground=GroundConfig.paper(),
            clustering=ClusteringConfig.paper(),
            smoother=SmootherConfig.paper(),
        )

    def of(self, category: str, sizes: Mapping[str, CategorySize]) -> CategoryConfig:
        """The category's entry. One that is not listed gets bins of half its mean length, 0.5 m to 8 m."""
        for entry in self.categories:
            if entry.name == category:
                return entry
        if category not in sizes:
            known = sorted({entry.name for entry in self.categories} | set(sizes))
            raise ValueError(f"category {category!r} has no size; known: {', '.join(known)}")
        return CategoryConfig(
            name=category,
            granularity_m=min(max(0.5 * sizes[category].mean_m[0], 0.5), 8.0),
            min_points=5,
        )


class Probabilistic(ScanPipeline):
    """All six steps, scan by scan."""

    steps = _STEPS

    def __init__(
        self, config: ProbabilisticConfig | None = None, shapes: BenchmarkShapes | None = None
    ) -> None:
        self.config = ProbabilisticConfig() if config is None else config
        self.shapes = load_benchmark_shapes() if shapes is None else shapes
        super().__init__(self.config.smoother)

    def map_scan(
        self, scan: LidarScan, paired: tuple[Detections, ...], calibration: Calibration, clock: StepClock
    ) -> tuple[LocalizedObject, ...]:
        explained = explain_scan(
            scan, paired, calibration, self._categories, self.config, self.shapes, clock=clock
        )
        with clock("localize"):
            return tuple(
                localize(
                    scan,
                    aoi.candidates[aoi.chosen].points,
                    detection=aoi.detection,
                    camera=aoi.camera,
                    T_ego_lidar=calibration.T_ego_sensor[scan.sensor],
                    confidence=_confidence(aoi, aoi.chosen),
                    config=self.config.localize,
                )
                for aoi in explained
                if aoi.chosen is not None
            )


class ProbabilisticPaper(Probabilistic):
    """All six steps with `ProbabilisticConfig.paper()`; by name: `probabilistic_paper`."""

    def __init__(self) -> None:
        super().__init__(ProbabilisticConfig.paper())


def explain_scan(
    scan: LidarScan,
    paired: tuple[Detections, ...],
    calibration: Calibration,
    categories: Mapping[str, CategorySize],
    config: ProbabilisticConfig,
    shapes: BenchmarkShapes,
    *,
    clock: StepClock | None = None,
) -> tuple[AoiExplanation, ...]:
    """Steps 1 to 4 for a scan and the detections that are paired with it: one explanation per usable box."""
    clock = StepClock(_STEPS) if clock is None else clock
    with clock("ground"):
        kept = np.flatnonzero(
            remove_ground(scan.xyz_m, calibration.T_ego_sensor[scan.sensor], config.ground).keep
        )
        xyz_m = scan.xyz_m.T.take(kept, axis=1)
        distance_m = planar_distance_m(xyz_m.T)
    explained = []
    for detections in paired:
        camera = calibration.cameras[detections.sensor]
        with clock("aoi"):
            boxes = areas(detections, camera, config.aoi)
            T_camera_lidar = calibration.T_camera_lidar(detections.sensor, scan.sensor)
            mapped = map_into_boxes(xyz_m, T_camera_lidar, camera, [aoi_px for _, aoi_px in boxes])
        for (detection, aoi_px), inside in zip(boxes, mapped, strict=True):
            category = config.of(detection.category, categories)
            points = kept[inside.points]
            explained.append(
                explain_aoi(
                    camera=detections.sensor,
                    detection=detection,
                    aoi_px=aoi_px,
                    points=points,
                    uv_px=inside.uv_px,
                    distance_m=distance_m[inside.points],
                    granularity_m=category.granularity_m,
                    min_points=category.min_points,
                    benchmark=shapes.of(detection.category),
                    clustering=config.clustering,
                    shape=config.shape,
                    clock=clock,
                )
            )
    return tuple(explained)


def _confidence(aoi: AoiExplanation, chosen: int) -> float:
    """The detection's confidence (cut to 0..1) times the chosen cluster's similarity to its category."""
    return min(max(aoi.detection.confidence, 0.0), 1.0) * aoi.candidates[chosen].similarity
