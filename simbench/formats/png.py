"""Pictures as PNG: lossless, and encoded beside whatever makes them.

Encoding releases the interpreter, so a thread does it while rays are cast for the next picture. A finished
picture is found by the hash of its pixels: what a fault changed after it was taken is encoded again.
"""

from __future__ import annotations

import hashlib
import os
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8

from simbench.formats.picture_size import picture_size

if TYPE_CHECKING:
    from simbench.motion import Motion
    from simbench.sensors.pictures import TakePicture

MOST_PIXELS = 100_000_000
SIGNATURE = b"\x89PNG\r\n\x1a\n"
Picture = UInt8[np.ndarray, "h w 3"]


def encode(rgb: Picture) -> bytes:
    """As PNG; one channel where all three are equal."""
    import cv2

    grey = bool((rgb[..., 0] == rgb[..., 1]).all() and (rgb[..., 0] == rgb[..., 2]).all())
    ok, data = cv2.imencode(
        ".png",
        rgb[..., 0] if grey else cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR),
        [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY],  # noise does not repeat itself
    )
    if not ok:
        raise RuntimeError(f"OpenCV could not encode a picture of {rgb.shape} as PNG")
    return data.tobytes()


def decode(png: bytes) -> Picture:
    """The picture of a PNG. ValueError: it is none, or too large to be opened."""
    import cv2

    if not png.startswith(SIGNATURE):
        raise ValueError("no PNG")
    width, height = picture_size(png)
    if width * height > MOST_PIXELS:
        raise ValueError(f"a picture of {width} x {height} pixels; {MOST_PIXELS} are allowed")
    try:
        bgr = cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise ValueError("a PNG that cannot be decoded") from error
    if bgr is None or bgr.shape != (height, width, 3):
        raise ValueError("a PNG that cannot be decoded")
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)


class Pictures:
    """Encodes pictures on threads of its own; a context manager."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=max(1, min(4, os.cpu_count() or 1)))
        self._ready: dict[bytes, Future[bytes]] = {}

    def __enter__(self) -> Pictures:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def beside(self, take: TakePicture) -> TakePicture:
        """The same pictures; each is being encoded when the next is taken."""

        def picture(motion: Motion, camera: str, seq: int, mid_ns: int) -> Picture:
            rgb = take(motion, camera, seq, mid_ns)
            self._begin(rgb)
            return rgb

        return picture

    def png(self, rgb: Picture) -> bytes:
        """A picture as PNG, which may be ready; it is not kept."""
        return (self._ready.pop(_key(rgb), None) or self._pool.submit(encode, rgb)).result()

    def _begin(self, rgb: Picture) -> None:
        self._ready[_key(rgb)] = self._pool.submit(encode, rgb)


def _key(rgb: Picture) -> bytes:
    return hashlib.sha256(np.ascontiguousarray(rgb).data).digest()
