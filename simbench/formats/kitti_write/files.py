"""Sweeps and pictures, the same in all layouts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Int64

from fusion.camera import PinholeCamera
from fusion.messages import LidarScan
from simbench.files import write_bytes
from simbench.formats.kitti_write.drive import WrittenFrame
from simbench.formats.kitti_write.rectify import straight_image


def write_sweep(scan: LidarScan, path: Path) -> None:
    """x, y, z [m] and reflectance as four float32, in KITTI's order."""
    values = np.concatenate([scan.xyz_m, scan.intensity[:, None]], axis=1)
    write_bytes(path, values[kitti_order(scan)].astype("<f4").tobytes())


def kitti_order(scan: LidarScan) -> Int64[np.ndarray, " n"]:
    """Ring by ring from the uppermost down, each once around counter-clockwise from straight ahead, as
    KITTI's sweeps lie (`formats/rings.py`). Points that lie ring by ring, or have no ring, stay."""
    ring = scan.ring.astype(np.int64)
    if len(ring) == 0 or ring.min() < 0 or not (np.diff(ring) < 0).any():
        return np.arange(len(ring))
    x, y, z = scan.xyz_m.astype(np.float64).T
    count = np.maximum(np.bincount(ring), 1)
    elevation = np.bincount(ring, weights=np.arctan2(z, np.hypot(x, y))) / count
    from_above = np.argsort(np.argsort(-elevation, kind="stable"), kind="stable")
    return np.lexsort((np.arctan2(y, x) % (2.0 * np.pi), from_above[ring]))


def write_picture(frame: WrittenFrame, lens: PinholeCamera, path: Path) -> None:
    """The straightened picture as PNG; a black one of its size where the recording has none: every layout has
    an image for every frame, and readers take the size from it."""
    import cv2

    rgb = np.zeros((lens.height_px, lens.width_px, 3), dtype=np.uint8)
    if frame.picture is not None:
        rgb = straight_image(frame.picture.rgb, lens)
    _, png = cv2.imencode(".png", rgb[..., ::-1])
    write_bytes(path, png.tobytes())
