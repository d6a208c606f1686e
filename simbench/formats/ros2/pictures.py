"""Images of anybody's driver as RGB. A compressed one says its size first, and is unpacked only if that is
no size that nobody means."""

from __future__ import annotations

import struct

import numpy as np
from jaxtyping import UInt8

from simbench.formats.ros2.cdr import Message, MessageError

MOST_PX = 40_000_000
_CHANNELS = {"rgb8": 3, "bgr8": 3, "mono8": 1, "8UC1": 1, "8UC3": 3, "rgba8": 4, "bgra8": 4}
_PNG = b"\x89PNG\r\n\x1a\n"
_SIZES_OF_JPEG = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # frame headers


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
    width, height = _size(data)
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


def _size(data: bytes) -> tuple[int, int]:
    """Width and height that an image says it has."""
    if data.startswith(_PNG) and data[12:16] == b"IHDR" and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return width, height
    if data.startswith(b"\xff\xd8"):
        return _size_of_jpeg(data)
    raise MessageError("its image is neither PNG nor JPEG")


def _size_of_jpeg(data: bytes) -> tuple[int, int]:
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in _SIZES_OF_JPEG:
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return width, height
        alone = marker == 0xFF or 0xD0 <= marker <= 0xD7  # fill bytes, and marks without a length
        at += (1 if marker == 0xFF else 2) if alone else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    raise MessageError("its image is damaged: a JPEG without a size")
