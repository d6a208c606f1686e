"""KITTI's images are rectified: pictures and boxes of a lens with distortion are straightened.

The straight camera has the lens's own focal lengths and centre, so what the lens drew in from beyond the
straight image's border is lost (a barrel lens) or the border stays black (a pincushion one). A straightened
box is the rectangle around the straightened border of the old one: never smaller than the object.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx

STRAIGHT = (0.0, 0.0, 0.0, 0.0, 0.0)
SAMPLES = 32  # along an edge of a box


def straight(lens: PinholeCamera) -> PinholeCamera:
    """The same camera without distortion."""
    return replace(lens, distortion=STRAIGHT)


def straight_image(rgb: UInt8[np.ndarray, "h w 3"], lens: PinholeCamera) -> UInt8[np.ndarray, "h w 3"]:
    """The picture [h w 3] as a camera without distortion would have taken it; the same where there is
    none."""
    if not any(lens.distortion):
        return rgb
    import cv2

    matrix = lens.matrix
    matrix[:2, 2] -= 0.5  # OpenCV counts from the centre of the first pixel
    size = (lens.width_px, lens.height_px)
    maps = cv2.initUndistortRectifyMap(
        matrix, np.array(lens.distortion), np.eye(3), matrix, size, cv2.CV_32FC1
    )
    return np.asarray(cv2.remap(rgb, *maps, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def straight_box(box_px: BoxPx, lens: PinholeCamera) -> BoxPx | None:
    """The box about what was in a box, cut at the straight image's border; None: nothing of it is left."""
    if not any(lens.distortion):
        return box_px
    x0, y0, x1, y1 = box_px
    s = np.linspace(0.0, 1.0, SAMPLES)
    x, y = x0 + s * (x1 - x0), y0 + s * (y1 - y0)
    rim = np.concatenate(
        [np.stack(np.broadcast_arrays(*edge), axis=1) for edge in ((x, y0), (x, y1), (x0, y), (x1, y))]
    )
    at = lens.unproject(rim)
    at = at[np.isfinite(at).all(axis=1)]
    if len(at) == 0:
        return None
    u = np.clip(lens.fx_px * at[:, 0] + lens.cx_px, 0.0, lens.width_px)
    v = np.clip(lens.fy_px * at[:, 1] + lens.cy_px, 0.0, lens.height_px)
    found = (float(u.min()), float(v.min()), float(u.max()), float(v.max()))
    return found if found[0] < found[2] and found[1] < found[3] else None
