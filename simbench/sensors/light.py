"""The light of a clear afternoon, in linear values of which 1 is the brightest that a camera shows.

Sun and sky are tuned by eye so that pictures look like OpenGL's (`render.py`), without its limits; the sun
stands where OpenGL's stands. Judgement, all of it: no measured radiance is claimed.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float32, Float64

from fusion.geometry import readonly
from scenarios.seeding import stream

SUN_RGB = (1.62, 1.46, 1.20)  # on a face that looks at the sun
SKY_RGB = (0.26, 0.31, 0.41)  # from above, on what the sun does not reach
BOUNCE_RGB = (0.13, 0.13, 0.12)  # from the ground, on what looks down
ZENITH_RGB, HORIZON_RGB = (0.10, 0.25, 0.62), (0.68, 0.81, 0.95)
HAZE_M = 2000.0  # range at which haze has taken all but 1/e of an object's colour
SKY_LEVELS = 4096
TILE = 256  # texels along a side of the tile that ground textures are made of

# Rec. 709 (BT.709-6, item 3.2): luminance of linear red, green, blue.
LUMA = (0.2126, 0.7152, 0.0722)


def to_linear(srgb: Float[np.ndarray, "*any"]) -> Float64[np.ndarray, "*any"]:
    """IEC 61966-2-1: display values 0..1 to linear light."""
    value = np.asarray(srgb, dtype=np.float64)
    light: np.ndarray = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return light


def to_srgb(linear: Float[np.ndarray, "*any"]) -> Float64[np.ndarray, "*any"]:
    """The inverse of `to_linear`, clipped to 0..1."""
    light = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    shown: np.ndarray = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
    return shown


@lru_cache(maxsize=1)
def sky_table() -> Float32[np.ndarray, "n 3"]:
    """Colour of the sky by the sine of the elevation, 0 to 1 in even steps."""
    up = np.linspace(0.0, 1.0, SKY_LEVELS + 1)[:, None]
    share = (1.0 - up) ** 6.0 * 0.80 + (1.0 - up) * 0.20
    return readonly(share * np.array(HORIZON_RGB) + (1.0 - share) * np.array(ZENITH_RGB), np.float32)


@lru_cache(maxsize=1)
def grain_tile() -> Float32[np.ndarray, "n n"]:
    """Grain of mean 0 and SD 1 that repeats without a seam; always the same."""
    noise = stream(0, "ground", "grain").standard_normal((TILE, TILE))
    soft = 0.25 * (noise + np.roll(noise, 1, 0) + np.roll(noise, 1, 1) + np.roll(noise, (1, 1), (0, 1)))
    mixed = 0.6 * noise / noise.std() + 0.4 * soft / soft.std()
    return readonly((mixed - mixed.mean()) / mixed.std(), np.float32)


@lru_cache(maxsize=1)
def patch_tile() -> Float32[np.ndarray, "n n"]:
    """Broad patches of mean 0 and SD 1 that repeat without a seam: noise with a power falling as 1/f^3."""
    noise = stream(0, "ground", "patch").standard_normal((TILE, TILE))
    fx, fy = np.meshgrid(np.fft.fftfreq(TILE), np.fft.rfftfreq(TILE), indexing="ij")
    frequency = np.hypot(fx, fy)
    frequency[0, 0] = np.inf
    smooth = np.fft.irfft2(np.fft.rfft2(noise) * np.maximum(frequency, 3.0 / TILE) ** -1.5, (TILE, TILE))
    return readonly((smooth - smooth.mean()) / smooth.std(), np.float32)
