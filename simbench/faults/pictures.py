"""What injectors of pictures share: all pictures of the struck cameras, the way to linear light and back.

They act on what the camera delivers, 8 bits of sRGB (IEC 61966-2-1), turned into linear light (1: white) and
back. So what was clipped to white stays as bright as white, and what was rounded stays rounded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float32, UInt8

from fusion.geometry import readonly
from scenarios.faults import FaultSpec
from scenarios.scenario import CameraSensor, ImageNoise
from simbench.faults.delivery import Delivery, Shot
from simbench.faults.fault import Site
from simbench.faults.struck import struck
from simbench.sensors import light

CODES = 1 << 16  # steps of linear light in the table of display values: a twentieth of the finest one
WHITE = 255
USUAL = ImageNoise(full_well_e=10_000, read_noise_e=3, gain=1)  # of a sensor whose file says nothing of noise

# Camera, count of the picture, the picture (one channel of a monochrome camera) -> another.
Change = Callable[[str, int, UInt8[np.ndarray, "h w c"]], UInt8[np.ndarray, "h w c"]]


def each_picture(spec: FaultSpec, delivery: Delivery, site: Site, change: Change) -> Delivery:
    """Every picture of the struck cameras changed; boxes and truth stay."""

    def changed(shot: Shot) -> Shot:
        if shot.image is None:
            return shot
        name, rgb = shot.image.sensor, shot.image.rgb
        grey = site.rig.cameras[name].monochrome
        after = change(name, shot.image.seq, rgb[..., :1] if grey else rgb)
        return replace(shot, image=replace(shot.image, rgb=np.repeat(after, 3, axis=2) if grey else after))

    names = [name for name in struck(spec, site.rig) if name in delivery.shots]
    return delivery.with_shots(names, changed)


def pictured(delivery: Delivery, names: Sequence[str]) -> bool:
    """Whether any of these cameras delivers a picture."""
    return any(shot.image is not None for name in names for shot in delivery.shots.get(name, ()))


def noise_of(sensor: CameraSensor) -> tuple[float, float]:
    """Electrons of white and of read noise (1 SD)."""
    noise = sensor.noise or USUAL
    return noise.full_well_e / noise.gain, float(noise.read_noise_e)


def linear(picture: UInt8[np.ndarray, "*any"]) -> Float32[np.ndarray, "*any"]:
    """Linear light of display values."""
    return np.asarray(_linear()[picture])


def shown(light_of: Float32[np.ndarray, "*any"]) -> UInt8[np.ndarray, "*any"]:
    """Display values of linear light, clipped."""
    code = np.rint(np.clip(light_of, 0.0, 1.0) * np.float32(CODES)).astype(np.int32)
    return np.asarray(_display()[code])


@lru_cache(maxsize=1)
def _linear() -> Float32[np.ndarray, "256"]:
    return readonly(light.to_linear(np.arange(256) / 255.0), np.float32)


@lru_cache(maxsize=1)
def _display() -> UInt8[np.ndarray, " n"]:
    return readonly(np.rint(255.0 * light.to_srgb(np.arange(CODES + 1) / CODES)), np.uint8)
