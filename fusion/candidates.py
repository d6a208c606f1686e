"""Which clusters of the scan may be the object in a box, and how well each fits.

A cluster is compared with a box by where it is (`offset_rad`: box minus cluster, as angles) and by what it is
(`likeness`, a logarithm, 0 at best): an object of the category's mean height that stands where the cluster
stands would look so and so high, so the box's height tells the range; the cluster's own width in the image
should be the box's; it should not be taller than the category, nor larger from above, nor have far fewer
points than beams go through the box. Every term is capped:
one bad term (an occluded half, a missing wheel) does not outweigh all others.

A box that the left or right border of the image cuts shows a part of its object, maybe a wheel only: what it
says of place and height counts less. Its object may stand beside the image as the LiDAR saw it, the farther
the nearer it is: `adrift_m` is how far something may have gone between the sweep and the image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from fusion.camera import PinholeCamera
from fusion.footprint import Clusters
from fusion.geometry import Transform
from fusion.messages import BoxPx, CategorySize


@dataclass(frozen=True, kw_only=True)
class CandidateConfig:
    """Spreads (1 SD) of the terms and where they are capped (in half-squares of SDs)."""

    reach_rad: float = 0.09  # how far beside the box a cluster may be: 5 degrees of miscalibration
    range_prior: bool = True
    count_prior: bool = True
    height_sd: float = 0.15  # of the box's height against the expected one, as a logarithm
    width_sd: float = 0.5
    top_sd: float = 0.25  # of the cluster's height against the category's, relative
    oversize_sd: float = 0.25
    count_sd: float = 1.0  # of the number of points against half of the beams that the box spans, logarithm
    cap: float = 4.5
    weak_cap: float = 2.0  # of width and height: both fail where only a part is seen
    adrift_m: float = 0.5
    border_px: float = 1.0  # a box this near to the border is cut by it
    beam_rad: float = 0.006  # what a cluster's outline lacks in the image, a beam's spacing


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxFit:
    """The candidates [m] of one box: numbers of clusters, offsets (right, down), log-likeness (at most 0)."""

    cluster: Int64[np.ndarray, " m"]
    offset_rad: Float64[np.ndarray, "m 2"]
    likeness: Float64[np.ndarray, " m"]


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """Clusters as one camera sees them: their numbers [m], outlines [m 4] in the image or a bit beside it,
    their feet on the ground, in the camera frame [m 3] and the image [m 2]. `up`: the vertical there.
    """

    cluster: Int64[np.ndarray, " m"]
    outline_px: Float64[np.ndarray, "m 4"]
    foot_m: Float64[np.ndarray, "m 3"]
    foot_px: Float64[np.ndarray, "m 2"]
    up: Float64[np.ndarray, "3"]
    camera: PinholeCamera


def view_clusters(
    clusters: Clusters,
    xyz_m: Float64[np.ndarray, "n 3"],
    T_camera_points: Transform,
    camera: PinholeCamera,
    boxes_px: list[BoxPx],
    largest_m: float,
    config: CandidateConfig,
) -> View:
    """The clusters that may belong to one of the boxes, projected.

    Clusters that reach over more than `largest_m` (walls, hedges) are nobody's.
    """
    foot_m = T_camera_points.apply(np.column_stack([clusters.mean_m, clusters.ground_m]))
    up = T_camera_points.rotation[:, 2]
    # A cheap choice by bearing: the middle of the cluster against the boxes, with room for its own width.
    centre = foot_m + 0.5 * clusters.top_m[:, None] * up
    half_m = 0.5 * np.hypot(*(clusters.high_m - clusters.low_m).T)
    depth = np.maximum(centre[:, 2], 0.5)
    bearing = centre[:, 0] / depth
    room = (half_m + config.adrift_m) / depth + config.reach_rad
    near = np.zeros(len(bearing), dtype=bool)
    for x0, _, x1, _ in boxes_px:
        left, right = (x0 - camera.cx_px) / camera.fx_px, (x1 - camera.cx_px) / camera.fx_px
        near |= (bearing + room > left) & (bearing - room < right)
    chosen = np.flatnonzero(near & (centre[:, 2] + half_m > 0.5) & (half_m < 0.5 * largest_m))
    if len(chosen) == 0:
        none = np.zeros((0, 4))
        return View(
            cluster=chosen, outline_px=none, foot_m=none[:, :3], foot_px=none[:, :2], up=up, camera=camera
        )
    points = np.concatenate([clusters.points(int(c)) for c in chosen])
    start = np.concatenate([[0], np.cumsum(clusters.count[chosen])[:-1]])
    xyz_camera_m = T_camera_points.apply(xyz_m[points])
    uv_px = camera.project(xyz_camera_m)
    uv_px = np.ascontiguousarray(uv_px.T)
    # What lies just beside the image may belong to a box at its border.
    beside_px = camera.fx_px * (config.reach_rad + config.adrift_m / np.maximum(xyz_camera_m[:, 2], 0.5))
    inside = (uv_px[0] >= -beside_px) & (uv_px[0] <= camera.width_px + beside_px)  # False for NaN
    inside &= (uv_px[1] >= 0.0) & (uv_px[1] <= camera.height_px)
    low = np.minimum.reduceat(np.where(inside, uv_px, np.inf), start, axis=1)
    high = np.maximum.reduceat(np.where(inside, uv_px, -np.inf), start, axis=1)
    seen = np.add.reduceat(inside.astype(np.int64), start) > 0
    return View(
        cluster=chosen[seen],
        outline_px=np.concatenate([low, high]).T[seen],
        foot_m=foot_m[chosen[seen]],
        foot_px=camera.project(foot_m[chosen[seen]]),
        up=up,
        camera=camera,
    )


def fit_boxes(
    view: View,
    clusters: Clusters,
    boxes_px: list[BoxPx],
    sizes: list[CategorySize],
    moved_m: Float64[np.ndarray, "b 3"],
    beams_per_sr: float | None,
    config: CandidateConfig,
) -> list[BoxFit]:
    """The candidates of every box [b], given the size of what it shows: the clusters within reach of it.

    moved_m: by how much each object moved from the LiDAR's instant to the image's, camera frame.
    beams_per_sr: density of the LiDAR's beams; None: clusters of few points are as good as others.
    """
    camera = view.camera
    length_m, width_m, height_m = np.array([size.mean_m for size in sizes]).T[:, :, None]
    boxes = np.array(boxes_px, dtype=np.float64).reshape(-1, 4, 1)
    x0, y0, x1, y1 = boxes[:, 0], boxes[:, 1], boxes[:, 2], boxes[:, 3]
    is_cut = cut(boxes, camera, config)
    top_m = view.foot_m + height_m[:, :, None] * view.up
    top_px = camera.project(top_m.reshape(-1, 3)).reshape((*top_m.shape[:2], 2))
    # How far the motion moves the foot in the image, without the lens's distortion: [b m].
    depth_m = np.maximum(view.foot_m[:, 2], 0.5)
    ahead_m = np.maximum(depth_m + moved_m[:, 2:], 0.5)
    right_px = camera.fx_px * ((view.foot_m[:, 0] + moved_m[:, :1]) / ahead_m - view.foot_m[:, 0] / depth_m)
    down_px = camera.fy_px * ((view.foot_m[:, 1] + moved_m[:, 1:2]) / ahead_m - view.foot_m[:, 1] / depth_m)
    left = np.clip(view.outline_px[:, 0] + right_px, 0.0, camera.width_px)
    right = np.clip(view.outline_px[:, 2] + right_px, 0.0, camera.width_px)
    upper = np.clip(top_px[:, :, 1] + down_px, 0.0, camera.height_px)
    lower = np.clip(view.foot_px[:, 1] + down_px, 0.0, camera.height_px)
    beside = (0.5 * (x0 + x1) - 0.5 * (left + right)) / camera.fx_px
    below = (0.5 * (y0 + y1) - 0.5 * (upper + lower)) / camera.fy_px
    extent_m = clusters.high_m[view.cluster] - clusters.low_m[view.cluster]
    tall = clusters.top_m[view.cluster] / height_m
    long = extent_m.max(axis=1) / np.hypot(length_m, width_m)
    own = (
        _cost((tall - 1.0) / config.top_sd, config.weak_cap)
        + _cost(np.maximum(tall - 1.25, 0.0) / 0.1, config.cap)
        + _cost(np.maximum(long - 1.1, 0.0) / config.oversize_sd, config.cap)
    )
    seen_px = np.maximum(right - left, 0.0) + config.beam_rad * camera.fx_px
    likeness = -own - _cost(np.log(seen_px / (x1 - x0)) / config.width_sd, config.weak_cap)
    if config.range_prior:
        expected_px = np.maximum(lower - upper, 1.0)
        cap = np.where(is_cut, config.weak_cap, config.cap)
        likeness -= _cost(np.log((y1 - y0) / expected_px) / config.height_sd, cap)
    if config.count_prior and beams_per_sr is not None:
        beams = beams_per_sr * (x1 - x0) * (y1 - y0) / (camera.fx_px * camera.fy_px)
        share = clusters.count[view.cluster] / np.maximum(0.5 * beams, 1.0)
        likeness -= _cost(np.minimum(np.log(share), 0.0) / config.count_sd, config.cap)
    reach = config.reach_rad + 0.5 * (x1 - x0) / camera.fx_px
    upright = np.where(is_cut, config.reach_rad + (y1 - y0) / camera.fy_px, reach)
    near = (np.abs(beside) < reach) & (np.abs(below) < upright)  # False for NaN
    fits = []
    for box in range(len(boxes)):
        picked = np.flatnonzero(near[box])
        offset_rad = np.column_stack([beside[box, picked], below[box, picked]])
        fits.append(
            BoxFit(cluster=view.cluster[picked], offset_rad=offset_rad, likeness=likeness[box, picked])
        )
    return fits


def cut(
    boxes_px: Float64[np.ndarray, "b 4 1"], camera: PinholeCamera, config: CandidateConfig
) -> Bool[np.ndarray, "b 1"]:
    """Which boxes the left or right border of the image cuts."""
    at_border: np.ndarray = (boxes_px[:, 0] <= config.border_px) | (
        boxes_px[:, 2] >= camera.width_px - config.border_px
    )
    return at_border


def placed(
    fit: BoxFit,
    shift_rad: Float64[np.ndarray, "2"],
    sd_rad: tuple[float, float],
    cap: float,
) -> Float64[np.ndarray, " m"]:
    """Log-score [m] of the candidates: likeness, and how near they are once the picture's shift is known."""
    off = (fit.offset_rad - shift_rad) / np.array(sd_rad)
    score: np.ndarray = fit.likeness - _cost(off[:, 0], cap) - _cost(off[:, 1], cap)
    return score


def _cost(
    sds: Float64[np.ndarray, "*b m"], cap: float | Float64[np.ndarray, "*b 1"]
) -> Float64[np.ndarray, "*b m"]:
    cost: np.ndarray = np.minimum(0.5 * sds**2, cap)
    return cost
