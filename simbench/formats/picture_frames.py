"""A picture as a frame: that of `isolate/told.py` with a PNG in place of its pixels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from fusion.messages import CameraImage
from simbench.formats.png import Picture, decode
from simbench.isolate.fields import Taken
from simbench.isolate.frames import Frame

PICTURE = "camera_png"
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
