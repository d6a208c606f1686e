"""Pictures through a lens that is out of focus, or dirty.

camera.defocus_px: each pixel's light falls on a disc; every pixel gets the share of it that lies on it.
camera.dirt_percent: a field of blobs, drawn once a run and camera; where it is above the level that leaves
the share asked for, light is lost, with soft edges. Receipts: `lens_receipts.py`.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from scenarios.faults.camera import Defocus, Dirt
from scenarios.seeding import stream
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, Site
from simbench.faults.pictures import each_picture, linear, pictured, shown
from simbench.faults.struck import struck

STRIPS = 64  # a pixel is cut into, to tell how much of a disc lies on it
BLOBS = 30
BLOB_SHARE = (0.015, 0.045)  # radius of a blob over the picture's width
ROUGH_SHARE = 0.012  # outlines wander by about so much of the width
SOFT_SHARE = 0.006  # from half shade to full shade: dirt sits far out of focus


def disc(radius_px: float) -> Float32[np.ndarray, "k k"]:
    """The share of a disc about the middle of a pixel that lies on this and each pixel around it."""
    reach = int(np.ceil(radius_px - 0.5)) if radius_px > 0.5 else 0
    strip = (np.arange((2 * reach + 1) * STRIPS) + 0.5) / STRIPS - reach - 0.5
    half = np.sqrt(np.maximum(radius_px**2 - strip**2, 0.0))
    row = np.arange(-reach, reach + 1)[:, None]
    chord = np.clip(np.minimum(half, row + 0.5) - np.maximum(-half, row - 0.5), 0.0, None)
    area = chord.reshape(2 * reach + 1, 2 * reach + 1, STRIPS).sum(axis=2)
    return (
        np.asarray(area / area.sum(), dtype=np.float32) if area.sum() > 0.0 else np.ones((1, 1), np.float32)
    )


def defocus(spec: Defocus, delivery: Delivery, site: Site) -> Acted:
    """All of the picture alike; beyond its edge it goes on as its mirror image."""
    kernel = disc(spec.radius_px)

    def change(_: str, seq: int, picture: UInt8[np.ndarray, "h w c"]) -> UInt8[np.ndarray, "h w c"]:
        soft = cv2.filter2D(linear(picture), -1, kernel, borderType=cv2.BORDER_REFLECT_101)
        return shown(np.asarray(soft, dtype=np.float32).reshape(picture.shape))

    same = spec.is_off or len(kernel) == 1
    return Acted(
        delivery=delivery if same else each_picture(spec, delivery, site, change),
        realised={name: spec.radius_px for name in struck(spec, site.rig)},
    )


def shade(spec: Dirt, camera: str, seed: int, size: tuple[int, int]) -> Float64[np.ndarray, "h w"]:
    """How much of each pixel is in the shade of dirt, 0 to 1: half and more of it on `percent` of them."""
    height, width = size
    rng = stream(seed, "fault", spec.name, camera)
    x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / width
    field = np.full((height, width), -np.inf)
    for _ in range(BLOBS):
        at_x, at_y = rng.uniform(0.0, 1.0), rng.uniform(0.0, height / width)
        radius = np.exp(rng.uniform(*np.log(BLOB_SHARE)))
        field = np.maximum(field, radius - np.hypot(x - at_x, (y - at_y)[:, None]))
    for cells, part in ((12, 0.6), (40, 0.4)):
        coarse = rng.standard_normal((cells, cells))
        field += part * ROUGH_SHARE * cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    level = np.quantile(field, 1.0 - 0.01 * spec.percent)
    return np.asarray(np.clip(0.5 + (field - level) / (2.0 * SOFT_SHARE), 0.0, 1.0))


def soil(spec: Dirt, delivery: Delivery, site: Site) -> Acted:
    """The same dirt in every picture of a run."""
    names = struck(spec, site.rig)
    realised = {f"{name} covered": spec.percent for name in names}
    if spec.is_off or not pictured(delivery, names):
        return Acted(delivery=delivery, realised=realised)
    passed: dict[str, Float32[np.ndarray, "h w 1"]] = {}
    for name in names:
        image = next((shot.image for shot in delivery.shots[name] if shot.image is not None), None)
        if image is None:
            continue
        shaded = shade(spec, name, site.seed, image.rgb.shape[:2])
        passed[name] = (1.0 - spec.opacity * shaded).astype(np.float32)[..., None]
        realised[f"{name} covered"] = 100.0 * float(np.mean(shaded >= 0.5))
        realised[f"{name} lost"] = 100.0 * spec.opacity * float(np.mean(shaded))
    after = each_picture(
        spec, delivery, site, lambda camera, _, picture: shown(linear(picture) * passed[camera])
    )
    return Acted(delivery=after, realised=realised)
