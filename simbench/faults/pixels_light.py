"""Pictures with another amount of light: exposed wrongly, taken in little light, or noisy.

camera.exposure_ev: light * 2^ev, clipped. camera.low_light_stops: of a pixel's electrons each is kept with
chance 2^-stops, read noise added, the rest made up by gain. camera.noise_e: more read noise. What is white
already may have been any brighter: low light and noise leave it white. Receipts: `pixel_receipts.py`.
"""

from __future__ import annotations

from math import log2, sqrt

import numpy as np
from jaxtyping import UInt8

from scenarios.faults.camera import ExtraNoise, LowLight, WrongExposure
from scenarios.seeding import stream
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, Site
from simbench.faults.pictures import WHITE, each_picture, linear, noise_of, pictured, shown
from simbench.faults.struck import struck


def expose(spec: WrongExposure, delivery: Delivery, site: Site) -> Acted:
    """Every display value has its new one."""
    table = shown(linear(np.arange(256, dtype=np.uint8)) * np.float32(2.0**spec.stops))
    after = each_picture(spec, delivery, site, lambda _, seq, picture: table[picture])
    return Acted(
        delivery=delivery if spec.is_off else after,
        realised={name: spec.stops for name in struck(spec, site.rig)},
    )


def darken(spec: LowLight, delivery: Delivery, site: Site) -> Acted:
    """Electrons thinned out, each by its own chance, and multiplied by gain."""
    names = struck(spec, site.rig)
    realised = {name: spec.stops for name in names}
    if spec.is_off or not pictured(delivery, names):
        return Acted(delivery=delivery, realised=realised)
    kept = 2.0**-spec.stops
    if kept <= 0.0:
        raise ValueError(f"{spec.stops:g} stops leave no light to draw from")
    counted: dict[str, list[tuple[float, float]]] = {name: [] for name in names}

    def change(camera: str, seq: int, picture: UInt8[np.ndarray, "h w c"]) -> UInt8[np.ndarray, "h w c"]:
        rng = stream(site.seed, "fault", spec.name, camera, str(seq))
        white_e, read_e = noise_of(site.rig.cameras[camera])
        before = linear(picture)
        electrons = np.rint(before * white_e).astype(np.int64)
        left = rng.binomial(electrons, kept)
        counted[camera].append((float(left.sum()), float(electrons.sum())))
        read = read_e * sqrt(1.0 - kept**2) * rng.standard_normal(picture.shape, dtype=np.float32)
        after = shown((before + (left - kept * electrons + read) / (kept * white_e)).astype(np.float32))
        return np.where(picture == WHITE, picture, after)

    after = each_picture(spec, delivery, site, change)
    for name, pairs in counted.items():
        left_e, all_e = (sum(column) for column in zip(*pairs, strict=True)) if pairs else (0.0, 0.0)
        if left_e > 0.0:
            realised[name] = -log2(left_e / all_e)
    return Acted(delivery=after, realised=realised)


def add_noise(spec: ExtraNoise, delivery: Delivery, site: Site) -> Acted:
    """Independent of the sensor's own noise, and from picture to picture."""
    names = struck(spec, site.rig)
    realised = {name: spec.read_e for name in names}
    if spec.is_off or not pictured(delivery, names):
        return Acted(delivery=delivery, realised=realised)
    power: dict[str, list[float]] = {name: [] for name in names}

    def change(camera: str, seq: int, picture: UInt8[np.ndarray, "h w c"]) -> UInt8[np.ndarray, "h w c"]:
        rng = stream(site.seed, "fault", spec.name, camera, str(seq))
        white_e, _ = noise_of(site.rig.cameras[camera])
        drawn = rng.standard_normal(picture.shape, dtype=np.float32)
        power[camera].append(float(np.mean(drawn.astype(np.float64) ** 2)))
        after = shown(linear(picture) + drawn * np.float32(spec.read_e / white_e))
        return np.where(picture == WHITE, picture, after)

    after = each_picture(spec, delivery, site, change)
    for name, values in power.items():
        if values:
            realised[name] = spec.read_e * sqrt(float(np.mean(values)))
    return Acted(delivery=after, realised=realised)
