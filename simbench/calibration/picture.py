"""The picture of a held board as its camera delivers it.

A pixel gathers light over its whole area; one ray through its centre would make a square's edge a staircase
and shift its corners by up to a third of a pixel. So where the board is, a pixel is the mean of 4 x 4 rays.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from fusion.camera import PinholeCamera
from scenarios.scenario import CameraSensor
from simbench.motion import Motion
from simbench.sensors.camera import light_in, look
from simbench.sensors.develop import develop
from simbench.sensors.rows import exposure_at
from simbench.sensors.shade import Palette

RAYS = 4  # along either side of a pixel
AROUND_PX = 6


def take_still(
    held: Motion,
    name: str,
    sensor: CameraSensor,
    camera: PinholeCamera,
    outline_px: Float64[np.ndarray, "n 2"],
    rng: np.random.Generator | None,
) -> UInt8[np.ndarray, "h w"]:
    """The grey picture that camera `name` takes while nothing moves; finer where the outline is.

    `rng` draws the noise; None: none."""
    palette = Palette(looks=held.world.looks)
    low = np.floor(outline_px.min(axis=0)).astype(int) - AROUND_PX
    high = np.ceil(outline_px.max(axis=0)).astype(int) + AROUND_PX
    x0, y0 = np.maximum(low, 0).tolist()
    x1, y1 = np.minimum(high, [camera.width_px, camera.height_px]).tolist()
    linear = _light(held, name, camera, palette)
    fine = _light(held, name, window(camera, x0, y0, x1, y1, RAYS), palette)
    linear[y0:y1, x0:x1] = fine.reshape(y1 - y0, RAYS, x1 - x0, RAYS, 3).mean(axis=(1, 3))
    return np.asarray(cv2.cvtColor(develop(linear, sensor, rng), cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def window(camera: PinholeCamera, x0: int, y0: int, x1: int, y1: int, finer: int) -> PinholeCamera:
    """A camera that sees only pixels x0 to x1, y0 to y1 of another one, each as `finer` x `finer`."""
    return replace(
        camera,
        fx_px=camera.fx_px * finer,
        fy_px=camera.fy_px * finer,
        cx_px=(camera.cx_px - x0) * finer,
        cy_px=(camera.cy_px - y0) * finer,
        width_px=(x1 - x0) * finer,
        height_px=(y1 - y0) * finer,
    )


def _light(held: Motion, name: str, camera: PinholeCamera, palette: Palette) -> np.ndarray:
    exposure = exposure_at(held, name, np.zeros(camera.height_px, dtype=np.int64))
    return light_in(camera, exposure, palette, look(camera, exposure))
