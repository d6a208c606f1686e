"""From linear light to the bytes of a picture: exposure, electrons, noise, sRGB, JPEG.

Noise: a pixel that collects `e` electrons reads e plus Poisson (shot) noise of variance e plus Gaussian read
noise of variance r^2 (Foi et al. 2008, IEEE Trans. Image Processing 17(10)). Both come from one normal
deviate z per pixel and channel,

    x = e + s z + e / (6 s^2) (z^2 - 1),   s^2 = e + r^2,

the Cornish-Fisher expansion: mean and third moment are the sum's, the variance is too large by at most 1/18
electron^2.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float32, UInt8, UInt16
from scipy.special import ndtri

from fusion.geometry import readonly
from scenarios.scenario import CameraSensor
from simbench.sensors import light
from simbench.sensors.compiled import jit_no_alias

CODES = 1 << 14  # steps of linear light in the table of display values: 0.2 of them where it is steepest


@lru_cache(maxsize=1)
def _display() -> UInt8[np.ndarray, " n"]:
    """Display value 0..255 of linear light i / CODES."""
    return readonly(np.rint(255.0 * light.to_srgb(np.arange(CODES + 1) / CODES)), np.uint8)


@lru_cache(maxsize=1)
def _normals() -> Float32[np.ndarray, " n"]:
    """Normal deviate of each 16-bit number: quantiles of 65,536 equal shares, scaled to variance 1."""
    z = ndtri((np.arange(1 << 16) + 0.5) / (1 << 16))
    return readonly(z / z.std(), np.float32)


def develop(
    linear: Float32[np.ndarray, "h w 3"], sensor: CameraSensor, rng: np.random.Generator | None
) -> UInt8[np.ndarray, "h w 3"]:
    """The picture that `sensor` delivers of linear RGB light (1: white at exposure 1).

    Without `rng` there is no noise. Noise is drawn for every pixel whatever it shows, so that one change of
    the scene never moves another pixel's.
    """
    height, width, _ = linear.shape
    channels = 1 if sensor.monochrome else 3
    shot, read2, drawn = 0.0, 0.0, np.zeros((0, 0, channels), dtype=np.uint16)
    if rng is not None and sensor.noise is not None:
        white_e = sensor.noise.full_well_e / sensor.noise.gain
        shot, read2 = 1.0 / white_e, (sensor.noise.read_noise_e / white_e) ** 2
        drawn = _draw(rng, (height, width, channels))
    out = np.empty((height, width, channels), dtype=np.uint8)
    _expose(
        np.ascontiguousarray(linear), np.array(light.LUMA, dtype=np.float32), np.float32(sensor.exposure),
        np.float32(shot), np.float32(read2), drawn, _normals(), _display(), out,
    )  # fmt: skip
    if sensor.jpeg_quality is not None:
        out = jpeg(out, sensor.jpeg_quality)
    return np.repeat(out, 3, axis=2) if channels == 1 else out


def _draw(rng: np.random.Generator, shape: tuple[int, int, int]) -> UInt16[np.ndarray, "h w c"]:
    """Even 16-bit numbers."""
    raw = np.frombuffer(rng.bytes(2 * int(np.prod(shape))), dtype="<u2")
    return raw.astype(np.uint16, copy=False).reshape(shape)


def jpeg(picture: UInt8[np.ndarray, "h w c"], quality: int) -> UInt8[np.ndarray, "h w c"]:
    """What is left of a picture (RGB, or one channel) after JPEG."""
    colour = picture.shape[2] == 3
    done, code = cv2.imencode(
        ".jpg",
        cv2.cvtColor(picture, cv2.COLOR_RGB2BGR) if colour else picture,
        [cv2.IMWRITE_JPEG_QUALITY, quality],
    )
    if not done:
        raise RuntimeError(f"OpenCV could not encode a picture of {picture.shape} as JPEG")
    read = cv2.imdecode(code, cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE)
    if read is None:
        raise RuntimeError("OpenCV could not read its own JPEG")
    return np.asarray(cv2.cvtColor(read, cv2.COLOR_BGR2RGB) if colour else read[..., None], dtype=np.uint8)


def grey(picture: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """A colour picture as a monochrome camera shows it: luminance of its linear light, on all channels."""
    linear = light.to_linear(np.arange(256) / 255.0)[picture].astype(np.float32)
    luminance = (linear @ np.array(light.LUMA, dtype=np.float32))[..., None]
    shown = _display()[np.rint(luminance * CODES).astype(np.int64)]
    return np.repeat(shown, 3, axis=2)


@jit_no_alias
def _expose(linear, luma, exposure, shot, read2, drawn, normals, display, out):  # type: ignore[no-untyped-def]
    """shot: variance of the shot noise of white; read2: of the read noise; both relative to white."""
    noisy, top, sixth = drawn.shape[0] > 0, np.float32(display.shape[0] - 1), np.float32(1.0 / 6.0)
    none, one, half, tiny = np.float32(0.0), np.float32(1.0), np.float32(0.5), np.float32(1e-20)
    channels = out.shape[2]
    width = out.shape[1] * channels
    value, z, code = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.int32)
    for row in range(out.shape[0]):
        light, shown = linear[row].reshape(-1), out[row].reshape(-1)
        if channels == 1:
            for i in range(width):
                grey = none
                for c in range(3):
                    grey += luma[c] * light[3 * i + c]
                value[i] = grey
        else:
            for i in range(width):
                value[i] = light[i]
        for i in range(width):
            value[i] = min(max(value[i] * exposure, none), one)
        if noisy:
            word = drawn[row].reshape(-1)
            for i in range(width):
                z[i] = normals[word[i]]
            for i in range(width):
                spread2 = shot * value[i] + read2 + tiny
                skew = sixth * shot * shot * value[i] / spread2
                noisy_value = value[i] + (np.sqrt(spread2) * z[i] + skew * (z[i] * z[i] - one))
                value[i] = min(max(noisy_value, none), one)
        for i in range(width):
            code[i] = np.int32(value[i] * top + half)
        for i in range(width):
            shown[i] = display[code[i]]
