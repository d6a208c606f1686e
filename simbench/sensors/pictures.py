"""Who takes the images of a run: rays, or OpenGL.

By rays an image is all that the sensor file says: rolling shutter, lens, exposure, noise, JPEG. OpenGL draws
the scene of one instant through a straight lens; of the sensor file it knows the size, the field of view and
whether the camera is monochrome.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import UInt8

from scenarios.errors import BadInput
from scenarios.seeding import stream
from simbench.motion import Motion, at
from simbench.sensors.camera import take
from simbench.sensors.develop import grey
from simbench.sensors.render import Renderer
from simbench.sensors.rig import SensorRig
from simbench.sensors.rows import line_delay_ns

# Motion, camera, count of the image, true time of its mid-exposure -> the picture.
TakePicture = Callable[[Motion, str, int, int], UInt8[np.ndarray, "h w 3"]]


def by_rays(rig: SensorRig, seed: int) -> TakePicture:
    """Every image as its sensor delivers it; noise from a stream of each camera and count."""

    def picture(motion: Motion, camera: str, seq: int, mid_ns: int) -> UInt8[np.ndarray, "h w 3"]:
        sensor = rig.cameras[camera]
        rng = stream(seed, "camera", camera, "noise", str(seq))
        return take(motion, camera, sensor, rig.pinholes[camera], mid_ns, line_delay_ns(sensor), rng).rgb

    return picture


def by_gl(rig: SensorRig, renderer: Renderer) -> TakePicture:
    """Every image as OpenGL draws it. Raises BadInput for a lens with distortion."""
    for name, pinhole in rig.pinholes.items():
        if any(pinhole.distortion):
            raise BadInput(
                f"OpenGL draws straight lenses only, and {name} has a distortion; take --images raycast"
            )

    def picture(motion: Motion, camera: str, _: int, mid_ns: int) -> UInt8[np.ndarray, "h w 3"]:
        pose = at(motion.sensor(camera, np.array([mid_ns], dtype=np.int64)))
        drawn = renderer.rgb(motion, mid_ns, pose, rig.pinholes[camera])
        return grey(drawn) if rig.cameras[camera].monochrome else drawn

    return picture
