"""A camera by rays: picture, object ids and depth, every row of the image at its own time.

Row r of h is exposed about mid + (r - (h - 1) / 2) * line delay, by rays from where the camera is then at
bodies where they are then; a global shutter is a line delay of 0. Motion blur is the mean of linear light
over instants spread evenly over the exposure; ids and depth are those of its middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int32, UInt8

from fusion.camera import PinholeCamera
from scenarios.scenario import CameraSensor
from simbench.motion import Motion
from simbench.sensors import rays
from simbench.sensors.compiled import jit
from simbench.sensors.develop import develop
from simbench.sensors.lens import direction_planes, row_fans
from simbench.sensors.rows import Exposure, exposure_at, row_times_ns
from simbench.sensors.shade import Palette, shade, toward_sun
from simbench.world import GROUND


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One image. object_id: -1 for ground and sky. depth_m: along the optical axis, inf for the sky."""

    rgb: UInt8[np.ndarray, "h w 3"]
    object_id: Int32[np.ndarray, "h w"]
    depth_m: Float32[np.ndarray, "h w"]


def look(camera: PinholeCamera, exposure: Exposure) -> rays.Hits:
    """What the rays through the centres of all pixels [h w] hit."""
    hits = rays.empty_hits((camera.height_px, camera.width_px))
    rays.cast_fans(
        exposure.placed, exposure.key, exposure.weight, exposure.R_world_camera, exposure.origin_m,
        row_fans(camera), hits,
    )  # fmt: skip
    return hits


def light_in(
    camera: PinholeCamera, exposure: Exposure, palette: Palette, seen: rays.Hits
) -> Float32[np.ndarray, "h w 3"]:
    """Linear light of all pixels."""
    direction = direction_planes(camera)
    lit = rays.sunlit(
        exposure.placed, exposure.key, exposure.weight, exposure.R_world_camera, exposure.origin_m,
        row_fans(camera), seen, toward_sun(),
    )  # fmt: skip
    return shade(exposure, palette, direction, 1.0 / camera.fx_px, seen.range_m, seen.geom, lit)


def take(
    motion: Motion,
    name: str,
    sensor: CameraSensor,
    camera: PinholeCamera,
    mid_ns: int,
    line_delay_ns: float,
    rng: np.random.Generator | None,
) -> Frame:
    """The image that camera `name` takes about true time `mid_ns`, the middle of its middle row's exposure.

    `rng` draws the noise; None: none. Raises BadInput for a lens that folds the picture.
    """
    world, palette = motion.world, Palette(looks=motion.world.looks)
    t_ns = row_times_ns(mid_ns, line_delay_ns, camera.height_px)
    middle = exposure_at(motion, name, t_ns)
    seen = look(camera, middle)
    linear = light_in(camera, middle, palette, seen)
    samples = sensor.motion_blur_samples
    if samples > 1:
        total = linear.astype(np.float64)  # sums of a few float32 are exact in float64, in any order
        for i in range(samples):
            if 2 * i + 1 == samples:
                continue
            offset_ns = round(((i + 0.5) / samples - 0.5) * sensor.exposure_ms * 1e6)
            sooner = exposure_at(motion, name, t_ns + offset_ns)
            total += light_in(camera, sooner, palette, look(camera, sooner))
        linear = (total / samples).astype(np.float32)
    object_id, depth_m = np.empty(seen.geom.shape, np.int32), np.empty(seen.geom.shape, np.float32)
    _truth(world.geom_object, seen.range_m, seen.geom, direction_planes(camera), GROUND, object_id, depth_m)
    return Frame(rgb=develop(linear, sensor, rng), object_id=object_id, depth_m=depth_m)


@jit
def _truth(owner, range_m, geom, direction, ground, object_id, depth_m):  # type: ignore[no-untyped-def]
    for row in range(geom.shape[0]):
        ahead = direction[row, 2]
        for col in range(geom.shape[1]):
            g = geom[row, col]
            object_id[row, col] = owner[g] if g >= 0 else ground
        for col in range(geom.shape[1]):
            depth_m[row, col] = range_m[row, col] * ahead[col]
