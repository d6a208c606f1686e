"""Images of anybody's driver as RGB. A compressed one says its size first, and is unpacked only if that is
no size that nobody means."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from simbench.formats.picture_size import picture_size
from simbench.formats.ros2.cdr import Message, MessageError

MOST_PX = 40_000_000
_CHANNELS = {"rgb8": 3, "bgr8": 3, "mono8": 1, "8UC1": 1, "8UC3": 3, "rgba8": 4, "bgra8": 4}


def raw_image(message: Message) -> UInt8[np.ndarray, "h w 3"]:
    """The pixels of a sensor_msgs/Image. MessageError: an encoding that is not known, or sizes that do not
    fit."""
    encoding, data = message["encoding"], message["data"]
    channels = _CHANNELS.get(encoding)
    if channels is None:
        raise MessageError(f"its encoding is '{encoding[:40]}', not one of {', '.join(_CHANNELS)}")
    height, width, step = message["height"], message["width"], message["step"]
    _check(width, height)
    if step < width * channels or height * step != len(data):
        raise MessageError(f"{width}x{height} pixels of {encoding} do not fit {len(data)} bytes")
    rows = np.frombuffer(data, dtype=np.uint8).reshape(height, step)[:, : width * channels]
    pixels = rows.reshape(height, width, channels)
    if channels == 1:
        return np.repeat(pixels, 3, axis=2)
    colours = pixels[..., :3]
    return np.ascontiguousarray(colours if encoding.startswith("rgb") else colours[..., ::-1])


def compressed_image(message: Message) -> UInt8[np.ndarray, "h w 3"]:
    """The pixels of a sensor_msgs/CompressedImage, PNG or JPEG. MessageError: it is neither, or damaged."""
    import cv2

    data = message["data"]
    if "compressedDepth" in message["format"]:
        raise MessageError("it is a depth image, no picture")
    try:
        width, height = picture_size(data)
    except ValueError as error:
        raise MessageError(str(error)) from None
    _check(width, height)
    try:
        flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
        found = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error:
        found = None
    if found is None or found.shape[:2] != (height, width):
        raise MessageError("its image is damaged")
    return np.ascontiguousarray(found[..., ::-1])


def _check(width: int, height: int) -> None:
    if width * height == 0 or width * height > MOST_PX:
        raise MessageError(f"{width}x{height} pixels are not between 1 and {MOST_PX}")
