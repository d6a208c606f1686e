"""A picture as a frame: that of `isolate/told.py` with a PNG in place of its pixels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from fusion.messages import CameraImage
from simbench.formats.picture_size import picture_size
from simbench.formats.png import Picture, decode
from simbench.isolate.fields import Taken
from simbench.isolate.frames import Frame, FrameError

PICTURE = "camera_png"
MOST_GROWTH = 100  # times their size, of all pictures together; ours grow to at most 24
FREE_BYTES = 64 * 2**20
AsPng: TypeAlias = Callable[[Picture], bytes]


def picture_frame(image: CameraImage, as_png: AsPng) -> Frame:
    """`camera_png`: stamps and the PNG."""
    fields = {
        "sensor": image.sensor, "seq": int(image.seq), "stamp_ns": int(image.stamp_ns),
        "arrival_ns": int(image.arrival_ns),
    }  # fmt: skip
    return Frame(kind=PICTURE, fields=fields, arrays={"png": np.frombuffer(as_png(image.rgb), np.uint8)})


def read_picture(frame: Frame) -> CameraImage:
    """The image of a frame. FrameError where it is none."""
    taken = Taken(frame)
    sensor, seq = taken.text("sensor"), taken.integer("seq")
    stamp_ns, arrival_ns = taken.integer("stamp_ns"), taken.integer("arrival_ns")
    png = taken.array("png", "u8", ("n",)).tobytes()
    taken.end()
    try:
        rgb = decode(png)
    except ValueError as error:
        raise taken.error(str(error)) from error
    return CameraImage(sensor=sensor, seq=seq, stamp_ns=stamp_ns, arrival_ns=arrival_ns, rgb=rgb)


class Album:
    """Reads the pictures of a recording as long as they do not unpack to more than they honestly can."""

    def __init__(self) -> None:
        self._left = FREE_BYTES

    def read(self, frame: Frame) -> CameraImage:
        """The image of a frame. FrameError: it is none, or it and those before are too large, unpacked."""
        png = frame.arrays.get("png")
        if png is not None:
            try:
                width, height = picture_size(png[:24].tobytes())
            except ValueError as error:
                raise FrameError(f"a '{frame.kind}' is malformed: {error}") from error
            self._left += MOST_GROWTH * png.nbytes - 3 * width * height
        if self._left < 0:
            raise FrameError(f"pictures unpack to more than {MOST_GROWTH} times their size")
        return read_picture(frame)
