"""Pictures small enough for a page."""

from __future__ import annotations

import base64

import numpy as np
from jaxtyping import UInt8

from simbench.view.caps import IMAGE_WIDTH_PX, JPEG_QUALITY


def thumbnail(rgb: UInt8[np.ndarray, "h w 3"]) -> str | None:
    """A picture as JPEG in base64, at most IMAGE_WIDTH_PX wide and twice as tall; None: it has no pixel."""
    import cv2

    height, width = rgb.shape[:2]
    if height == 0 or width == 0:
        return None
    scale = min(1.0, IMAGE_WIDTH_PX / width, 2.0 * IMAGE_WIDTH_PX / height)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    return base64.b64encode(jpeg(small, JPEG_QUALITY)).decode("ascii")


def jpeg(rgb: UInt8[np.ndarray, "h w 3"], quality: int) -> bytes:
    """A picture with at least one pixel as JPEG."""
    import cv2

    done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise RuntimeError("OpenCV could not encode a picture")
    return data.tobytes()
