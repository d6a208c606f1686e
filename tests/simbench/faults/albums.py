"""Pictures made by hand for the faults of pictures: textures, gradients, edges, and some of it clipped."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from fusion.messages import CameraImage
from scenarios.seeding import stream
from simbench.faults.delivery import Delivery, Shot
from simbench.faults.fault import Site
from tests.simbench.faults import laws

FRAMES, HEIGHT, WIDTH = 4, 120, 160


@cache
def site(seed: int = 0, system: str = "car") -> Site:
    """The rig of `laws`; the wearable's cameras are colourful, the car's are not."""
    return replace(laws.site(0, system), seed=seed)


@cache
def album(system: str = "car") -> Delivery:
    """Every camera's first exposures with pictures."""
    clean, rig = laws.clean(system), site(0, system).rig
    shots = {
        name: tuple(_with_picture(shot, rig.cameras[name].monochrome) for shot in taken[:FRAMES])
        for name, taken in clean.shots.items()
    }
    return replace(clean, shots=shots)


def _with_picture(shot: Shot, grey: bool) -> Shot:
    d = shot.detections
    image = CameraImage(
        sensor=d.sensor, seq=d.seq, stamp_ns=d.stamp_ns, arrival_ns=d.arrival_ns,
        rgb=picture(d.sensor, d.seq, grey),
    )  # fmt: skip
    return replace(shot, image=image)


def picture(camera: str, seq: int, grey: bool) -> np.ndarray:
    """A sky that is white at the top, a ground with grain, boxes with sharp edges, and the odd black hole."""
    rng = stream(1, "album", camera, str(seq))
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    value = np.repeat((280.0 - 2.2 * y + 0.2 * x)[..., None], 3, axis=2)
    value += rng.normal(0.0, 6.0, (HEIGHT, WIDTH, 1))
    for _ in range(14):
        top, left = int(rng.integers(10, HEIGHT - 30)), int(rng.integers(0, WIDTH - 30))
        high, wide = (int(n) for n in rng.integers(5, 30, 2))
        value[top : top + high, left : left + wide] = rng.uniform(8.0, 245.0, 3)
        value[top : top + high, left : left + wide] += rng.normal(0.0, 4.0, (high, wide, 1))[: HEIGHT - top]
    hole_y, hole_x = int(rng.integers(0, HEIGHT - 12)), int(rng.integers(0, WIDTH - 12))
    value[hole_y : hole_y + 10, hole_x : hole_x + 10] = 0.0
    if grey:
        value = np.repeat(value.mean(axis=2, keepdims=True), 3, axis=2)
    return np.clip(np.rint(value), 0, 255).astype(np.uint8)
