"""The objects of a frame: which have a label, where their 3-D boxes stand, and what of them is seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from fusion.messages import BoxPx, LidarScan
from simbench.formats.kitti_write.kinds import kind_of
from simbench.formats.kitti_write.outline import outside_share
from simbench.formats.kitti_write.rectify import straight, straight_box
from simbench.formats.poses import RecordedPoses
from simbench.truth import ImageTruth, ObjectInfo, ScanTruth, Truth

FARTHEST_M = 1000.0  # what is farther away has no label


@dataclass(frozen=True, kw_only=True, eq=False)
class Labelled:
    """One object in one frame. centre_m, yaw_rad: of its 3-D box in the rectified camera (rotation_y).

    box_px: the whole outline in the image, in the bench's pixels, cut at the border; None where it is not in
    the image, which may be because it is `behind` the camera. visible_fraction: as the truth says; 0 where
    nothing is seen. outside: share of the projected 3-D box beyond the image's border. known: whether a
    sensor saw it in this frame.
    """

    object_id: int
    category: str
    size_m: tuple[float, float, float]
    centre_m: Float64[np.ndarray, "3"]
    yaw_rad: float
    box_px: BoxPx | None
    visible_fraction: float
    outside: float
    behind: bool
    known: bool

    @property
    def bottom_m(self) -> Float64[np.ndarray, "3"]:
        """Centre of the box's bottom, as KITTI has it: half a height along the camera's y."""
        return self.centre_m + np.array([0.0, 0.5 * self.size_m[2], 0.0])


def labelled_objects(infos: Sequence[ObjectInfo]) -> tuple[ObjectInfo, ...]:
    """Those of KITTI's kinds."""
    return tuple(info for info in infos if kind_of(info.category) is not None)


def labels_of(
    truth: Truth,
    scan: LidarScan,
    hits: ScanTruth,
    view: ImageTruth,
    instant_ns: int,
    T_camera_lidar: Transform,
    lens: PinholeCamera,
) -> Iterator[Labelled]:
    """Every object of KITTI's kinds, but for what carries the LiDAR. Known is what returned a point of the
    sweep or is in the image; where the truth itself is labels, what was labelled then."""
    camera = straight(lens)
    at = np.array([instant_ns], dtype=np.int64)
    (R_world_lidar,), (lidar_m,) = truth.poses.sensor(scan.sensor, at)
    boxes = {box.object_id: box for box in view.boxes}
    hit = set(np.unique(hits.object_id).tolist())
    for info in labelled_objects(truth.objects):
        number = info.object_id
        known = number in hit or number in boxes
        if isinstance(truth.poses, RecordedPoses):
            known = scan.stamp_ns in truth.poses.labelled_ns(number)
        (R_world_box,), (box_m,) = truth.poses.object_centre(number, at)
        R_lidar_box, centre_lidar_m = R_world_lidar.T @ R_world_box, R_world_lidar.T @ (box_m - lidar_m)
        if _carries(R_lidar_box, centre_lidar_m, info.size_m):
            continue
        centre_m = T_camera_lidar.apply(centre_lidar_m)
        ahead = T_camera_lidar.rotation @ R_lidar_box[:, 0]
        yaw_rad = float(np.arctan2(-ahead[2], ahead[0]))
        box = boxes.get(number)
        seen = box is not None and box.visible_px is not None
        yield Labelled(
            object_id=number,
            category=info.category,
            size_m=info.size_m,
            centre_m=centre_m,
            yaw_rad=yaw_rad,
            box_px=None if box is None else straight_box(box.amodal_px, lens),
            visible_fraction=box.visible_fraction if box is not None and seen else 0.0,
            outside=outside_share(centre_m, yaw_rad, info.size_m, camera),
            behind=bool(centre_m[2] < 0.0),
            known=known and bool(np.abs(centre_m).max() + info.size_m[2] < FARTHEST_M),
        )


def _carries(
    R_lidar_box: Float64[np.ndarray, "3 3"],
    centre_m: Float64[np.ndarray, "3"],
    size_m: tuple[float, float, float],
) -> bool:
    """Whether the LiDAR stands over, in or under a box."""
    lidar_in_box = -R_lidar_box.T @ centre_m
    return bool((np.abs(lidar_in_box[:2]) <= 0.5 * np.array(size_m[:2])).all())
