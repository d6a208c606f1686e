"""Rectangles in the image: overlap, containment, and the bounding rectangles of clusters."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int64

from fusion.messages import BoxPx


def iou(boxes_px: Float64[np.ndarray, "n 4"], box_px: BoxPx) -> Float64[np.ndarray, " n"]:
    """Intersection over union of each box [n 4] (x0, y0, x1, y1) with one that has an area; 0 for NaN."""
    x0, y0, x1, y1 = boxes_px.T
    width = np.minimum(x1, box_px[2]) - np.maximum(x0, box_px[0])
    height = np.minimum(y1, box_px[3]) - np.maximum(y0, box_px[1])
    overlap = np.maximum(width, 0.0) * np.maximum(height, 0.0)
    union = (x1 - x0) * (y1 - y0) + (box_px[2] - box_px[0]) * (box_px[3] - box_px[1]) - overlap
    return np.where(overlap > 0.0, overlap / union, 0.0)  # NaN is not above 0


def within(boxes_px: Float64[np.ndarray, "n 4"], outer_px: BoxPx) -> Bool[np.ndarray, " n"]:
    """Which boxes [n 4] lie in the closed outer box; NaN never does."""
    x0, y0, x1, y1 = boxes_px.T
    inside: np.ndarray = (x0 >= outer_px[0]) & (y0 >= outer_px[1]) & (x1 <= outer_px[2]) & (y1 <= outer_px[3])
    return inside


def bounding_boxes(
    uv_px: Float64[np.ndarray, "k 2"], label: Int64[np.ndarray, " k"], count: int
) -> Float64[np.ndarray, "n 4"]:
    """The smallest box around the pixels [k 2] of each label 0 .. count - 1; NaN for a label without any."""
    boxes = np.full((count, 4), np.inf)
    boxes[:, 2:] = -np.inf
    for axis in (0, 1):
        np.minimum.at(boxes[:, axis], label, uv_px[:, axis])
        np.maximum.at(boxes[:, axis + 2], label, uv_px[:, axis])
    boxes[~np.isfinite(boxes).all(axis=1)] = np.nan
    return boxes
