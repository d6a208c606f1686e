"""A recording for the tests of ROS 2 bags."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from fusion.messages import CameraImage, Detection, Detections, Measurement
from scenarios.faults import CalibrationRotation
from simbench.recording import Recording
from tests.simbench.support import recorded, staged

SIZE_PX = (48, 32)


@lru_cache(maxsize=1)
def drive() -> Recording:
    """0.4 s of the car, told a wrong calibration, with coloured noise as images and boxes anywhere."""
    at = staged(duration_s=0.4, columns=24, size_px=SIZE_PX, specs=(CalibrationRotation(angle_deg=2.0),))
    recording = recorded(at).recording
    rng = np.random.default_rng(0)
    messages: list[Measurement] = []
    for message in recording.messages:
        if isinstance(message, Detections):
            rgb = rng.integers(0, 256, (SIZE_PX[1], SIZE_PX[0], 3), dtype=np.uint8)
            stamps = {name: getattr(message, name) for name in ("sensor", "seq", "stamp_ns", "arrival_ns")}
            messages.append(CameraImage(rgb=rgb, **stamps))
            message = replace(message, boxes=(*message.boxes, *(_box(rng) for _ in range(3))))
        messages.append(message)
    return replace(recording, messages=tuple(messages))


def _box(rng: np.random.Generator) -> Detection:
    x0, y0, width, height = rng.uniform(0.0, 1.0, 4) * [48.0, 32.0, 900.0, 0.01]
    return Detection(
        track_id=int(rng.integers(10**6)), category=str(rng.choice(["car", "rider"])),
        box_px=(float(x0), float(y0), float(x0 + width), float(y0 + height)), confidence=float(rng.random()),
    )  # fmt: skip


def shifted(recording: Recording, by_ns: int) -> Recording:
    """The same messages at other times; the truth stays."""
    return replace(
        recording,
        messages=tuple(
            replace(m, stamp_ns=m.stamp_ns + by_ns, arrival_ns=m.arrival_ns + by_ns)
            for m in recording.messages
        ),
    )
