"""What the receipts of pictures share: pictures before and after, and their linear light.

Nothing here knows how an injector works or what it drew.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64, UInt8

from fusion.geometry import readonly
from scenarios.faults import FaultSpec
from simbench.faults.delivery import Shot
from simbench.faults.fault import Site, Step
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.struck import struck

NO_PICTURES = "no pictures are taken: give --images raycast and a pipeline that reads them"
LOOKED_AT = 40_000  # pixels of a picture, on an even grid

Picture = UInt8[np.ndarray, "h w c"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """A picture before and after; one channel of a monochrome camera."""

    before: Picture
    after: Picture

    def thinned(self) -> Pair:
        """Rows and columns in even steps, so that few enough pixels are left."""
        step = max(1, int(np.ceil(np.sqrt(self.before.shape[0] * self.before.shape[1] / LOOKED_AT))))
        return Pair(before=self.before[::step, ::step], after=self.after[::step, ::step])


def pairs(step: Step, site: Site, camera: str, most: int | None = None) -> list[Pair]:
    """All pictures of a camera, or at most so many, spread over the run. Empty where there are none, or where
    they are not of the same exposures."""
    before, after = step.before.shots.get(camera, ()), step.after.shots.get(camera, ())
    if len(before) != len(after):
        return []
    channels = 1 if site.rig.cameras[camera].monochrome else 3
    both = [
        Pair(before=was.image.rgb[..., :channels], after=now.image.rgb[..., :channels])
        for was, now in zip(before, after, strict=True)
        if was.image is not None and now.image is not None and was.image.rgb.shape == now.image.rgb.shape
    ]
    if most is None or len(both) <= most:
        return both
    return [both[i] for i in np.rint(np.linspace(0, len(both) - 1, most)).astype(int)]


def unseen(fault: str, quantity: str, unit: str, strength: float, note: str = NO_PICTURES) -> Receipt:
    """Of a camera that delivers no pictures, or none that show the effect."""
    return judge(
        fault=fault, quantity=quantity, unit=unit, requested=strength, realised=strength, measured=None,
        estimator_sd=0.0, allowed=0.0, note=note,
    )  # fmt: skip


def nothing_else(spec: FaultSpec, step: Step, site: Site) -> tuple[Receipt, ...]:
    """How many exposures changed in anything but the pictures of struck cameras."""
    named, changed = struck(spec, site.rig), 0
    for name, before in step.before.shots.items():
        after = step.after.shots.get(name, ())
        changed += abs(len(before) - len(after))
        grey = site.rig.cameras[name].monochrome
        changed += sum(not _alike(*both, name in named, grey) for both in zip(before, after, strict=False))
    changed += int(step.before.sweeps != step.after.sweeps) + int(step.before.motions != step.after.motions)
    return untouched(
        fault=spec.name, quantity="anything but the struck pictures", unit="exposures",
        found=[(float(changed), 0.1)], note="boxes, times, truth and all other pictures, before and after",
    )  # fmt: skip


def _alike(was: Shot, now: Shot, struck_camera: bool, grey: bool) -> bool:
    if was.detections != now.detections or was.truth is not now.truth:
        return False
    if was.image is None or now.image is None:
        return was.image is now.image
    one, two = was.image, now.image
    if (one.sensor, one.seq, one.rgb.shape) != (two.sensor, two.seq, two.rgb.shape):
        return False
    if (one.stamp_ns, one.arrival_ns) != (two.stamp_ns, two.arrival_ns):
        return False
    if struck_camera:
        return not grey or bool((two.rgb == two.rgb[..., :1]).all())
    return one is two or np.array_equal(one.rgb, two.rgb)


def light_of(picture: Picture) -> Float64[np.ndarray, "h w c"]:
    """Linear light, 1 being white."""
    return np.asarray(levels()[picture])


@lru_cache(maxsize=1)
def levels() -> Float64[np.ndarray, "256"]:
    """Linear light of each display value."""
    return readonly(_light(np.arange(256.0)))


@lru_cache(maxsize=1)
def borders() -> Float64[np.ndarray, "255"]:
    """Linear light halfway between display values: what is brighter shows the next one."""
    return readonly(_light(np.arange(255.0) + 0.5))


def steps() -> Float64[np.ndarray, "256"]:
    """How much linear light one display value spans."""
    return np.asarray(np.diff(np.concatenate([[0.0], borders(), [1.0]])))


def _light(value: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """IEC 61966-2-1, written out once more: linear light of display values 0..255."""
    share = value / 255.0
    bright = ((share + 0.055) / 1.055) ** 2.4
    return np.asarray(np.where(share > 0.04045, bright, share / 12.92))
