"""How long a picture was exposed, by the streaks in it.

Sharp pictures of many instants about its middle are mixed evenly over a trial exposure, and the exposure is
sought whose mixture lies nearest to the delivered picture, in display values of the pixels that change most.
What noise and JPEG do to that search is found by the same search in a picture that was mixed on purpose, and
taken off. Where nothing moves there is nothing to measure. How long the sensor says that it exposes, and of
how many instants, is not looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

from fusion.camera import PinholeCamera
from scenarios.scenario import CameraSensor
from scenarios.seeding import stream
from simbench.faults.delivery import Shot
from simbench.motion import Motion
from simbench.sensors import light
from simbench.sensors.camera import light_in, look
from simbench.sensors.develop import develop
from simbench.sensors.rows import exposure_at, line_delay_ns, row_times_ns
from simbench.sensors.shade import Palette

NODES = 33  # sharp pictures over twice the exposure that is asked for: steps of 1/16 of it
PIXELS = 20_000  # those that change most
LEAST_CHANGE = 2.0 / 255.0  # of a display value over all nodes: less is no streak
TRIALS = 41  # exposures up to twice the one that is asked for
# Of the exposure, at most (SD 0.03, measured): textures finer than a pixel twinkle from instant to instant.
MODEL_SHARE = 0.15

Node = Callable[[float], Float32[np.ndarray, "h w c"]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Mixtures:
    """Linear light of some pixels at every node: what they show when it is mixed over an exposure."""

    at_ms: Float64[np.ndarray, " k"]
    linear: Float32[np.ndarray, "k n"]
    gain: float

    def shown(self, exposure_ms: float) -> Float64[np.ndarray, " n"]:
        """Display values 0..255."""
        mixed = weights(self.at_ms, exposure_ms) @ self.linear
        return np.asarray(255.0 * light.to_srgb(self.gain * mixed))

    def nearest_ms(self, seen: Float64[np.ndarray, " n"]) -> tuple[float, float] | None:
        """The exposure that shows best what is seen, and its SD by what is left over; None where it shows
        the same for any."""
        trials = np.linspace(0.0, float(self.at_ms[-1]) * 2.0, TRIALS)
        misfit = [np.sum((self.shown(float(t)) - seen) ** 2) for t in trials]
        best, step_ms = float(trials[int(np.argmin(misfit))]), float(trials[1])
        less_ms, more_ms = max(best - 0.5 * step_ms, 0.0), best + 0.5 * step_ms
        slope = (self.shown(more_ms) - self.shown(less_ms)) / (more_ms - less_ms)
        power = float(slope @ slope)
        if power == 0.0:
            return None
        rest = seen - self.shown(best)
        change = float(np.clip(slope @ rest / power, -step_ms, step_ms))
        return best + change, float(np.sqrt(np.mean(rest**2) / power))


def streak_ms(
    shots: Sequence[Shot], sensor: CameraSensor, camera: PinholeCamera, motion: Motion, about_ms: float
) -> tuple[float, float, float] | None:
    """The exposure of the picture in the middle of a run, sought up to twice `about_ms`, its SD by chance and
    what it may err by besides; None where nothing moves or there is no picture."""
    pictures = [(shot, shot.image.rgb) for shot in shots if shot.image is not None]
    if not pictures:
        return None
    shot, rgb = pictures[len(pictures) // 2]
    node = _node(shot, sensor, camera, motion)
    at_ms = np.linspace(-about_ms, about_ms, NODES)
    picked = _streaked(sensor, [node(float(ms)) for ms in at_ms[[0, NODES // 2, -1]]])
    if not picked.any():
        return None
    linear = np.stack([node(float(ms))[picked].ravel() for ms in at_ms])
    mixtures = Mixtures(at_ms=at_ms, linear=linear, gain=sensor.exposure)
    channels = 1 if sensor.monochrome else 3

    def fit(picture: UInt8[np.ndarray, "h w 3"]) -> tuple[float, float] | None:
        return mixtures.nearest_ms(picture[..., :channels][picked].astype(np.float64).ravel())

    first = fit(rgb)
    if first is None:
        return None
    share = weights(at_ms, first[0])
    mixed = sum(w * node(float(ms)) for w, ms in zip(share, at_ms, strict=True) if w > 0.0)
    known = np.broadcast_to(np.asarray(mixed, dtype=np.float32), rgb.shape)
    again = fit(develop(known, sensor, stream(0, "streak", shot.truth.sensor)))
    if again is None:
        return None
    return 2.0 * first[0] - again[0], hypot(first[1], again[1]), MODEL_SHARE * about_ms


def weights(at_ms: Float64[np.ndarray, " k"], exposure_ms: float) -> Float64[np.ndarray, " k"]:
    """Of every node in the mean over the exposure; between nodes light changes evenly."""
    instant_ms = exposure_ms * ((np.arange(256) + 0.5) / 256 - 0.5)
    place = np.interp(instant_ms, at_ms, np.arange(len(at_ms)))
    left = np.minimum(place.astype(np.int64), len(at_ms) - 2)
    beyond = place - left
    weight = np.bincount(left, 1.0 - beyond, len(at_ms)) + np.bincount(left + 1, beyond, len(at_ms))
    return np.asarray(weight / len(instant_ms))


def _node(shot: Shot, sensor: CameraSensor, camera: PinholeCamera, motion: Motion) -> Node:
    """Linear light of a sharp picture so many milliseconds from the middle of the exposure."""
    t_ns = row_times_ns(shot.truth.capture_ns, line_delay_ns(sensor), camera.height_px)
    palette = Palette(looks=motion.world.looks)

    def node(offset_ms: float) -> Float32[np.ndarray, "h w c"]:
        exposure = exposure_at(motion, shot.truth.sensor, t_ns + round(offset_ms * 1e6))
        linear = light_in(camera, exposure, palette, look(camera, exposure))
        if sensor.monochrome:
            linear = linear @ np.array(light.LUMA, dtype=np.float32)[:, None]
        return np.asarray(linear, dtype=np.float32)

    return node


def _streaked(sensor: CameraSensor, few: Sequence[Float32[np.ndarray, "h w c"]]) -> Bool[np.ndarray, "h w"]:
    """The pixels that change most between some nodes."""
    shown = np.stack([light.to_srgb(sensor.exposure * linear) for linear in few])
    change = np.ptp(shown, axis=0).max(axis=-1)
    least = LEAST_CHANGE
    if change.size > PIXELS:
        least = max(least, float(np.partition(change.ravel(), -PIXELS)[-PIXELS]))
    return np.asarray(change >= least)
