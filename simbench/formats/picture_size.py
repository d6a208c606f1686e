"""The size that a PNG or a JPEG says it has, before anything of it is unpacked."""

from __future__ import annotations

import struct

_PNG = b"\x89PNG\r\n\x1a\n"
_SIZES_OF_JPEG = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # frame headers


def picture_size(data: bytes) -> tuple[int, int]:
    """Width and height. ValueError: it is neither, or has none."""
    if data.startswith(_PNG) and data[12:16] == b"IHDR" and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return width, height
    if data.startswith(b"\xff\xd8"):
        return _size_of_jpeg(data)
    raise ValueError("its image is neither PNG nor JPEG")


def _size_of_jpeg(data: bytes) -> tuple[int, int]:
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in _SIZES_OF_JPEG:
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return width, height
        alone = marker == 0xFF or 0xD0 <= marker <= 0xD7  # fill bytes, and marks without a length
        at += (1 if marker == 0xFF else 2) if alone else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    raise ValueError("its image is damaged: a JPEG without a size")
