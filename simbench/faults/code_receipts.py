"""Receipt of a coarse JPEG: the steps of its cosine transform, read off the decoded picture.

Coefficients of luminance lie on multiples of their step, but for the rounding of pixels. For every quality
the likelihood of what is seen is summed up (after Fan and de Queiroz 2003, IEEE Trans. Image Processing
12(2)).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.fft import dctn

from scenarios.faults.camera import JpegLoss
from simbench.faults.fault import Site, Step
from simbench.faults.receipt import Receipt, judge
from simbench.faults.seen import Pair, nothing_else, pairs, unseen
from simbench.faults.struck import struck

PICTURES = 3
BLOCKS = 1500  # of a picture, spread evenly
FEWEST = 50
ROUNDING_SD = 0.35  # of a coefficient: 1 / sqrt(12) of the decoder's luminance and about as much of its RGB
ASTRAY = 0.02  # of the coefficients lie anywhere
LEAST = 1.5  # a coefficient smaller than that may be nothing
QUALITY_SD = 0.1
LUMA = np.array([0.299, 0.587, 0.114])  # of JFIF
ANNEX_K = np.array(
    [
        [16, 11, 10, 16, 24, 40, 51, 61],
        [12, 12, 14, 19, 26, 58, 60, 55],
        [14, 13, 16, 24, 40, 57, 69, 56],
        [14, 17, 22, 29, 51, 87, 80, 62],
        [18, 22, 37, 56, 68, 109, 103, 77],
        [24, 35, 55, 64, 81, 104, 113, 92],
        [49, 64, 78, 87, 103, 121, 120, 101],
        [72, 92, 95, 98, 112, 100, 103, 99],
    ]
)  # luminance steps at quality 50 (ITU-T T.81, table K.1)


def jpeg_receipts(spec: JpegLoss, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Of every struck camera."""
    result = []
    for name in struck(spec, site.rig):
        quantity, both = f"{name} quality lost", pairs(step, site, name, PICTURES)
        if not both:
            result.append(unseen(spec.name, quantity, spec.unit, float(spec.loss)))
            continue
        found = _quality(both)
        result.append(
            judge(
                fault=spec.name, quantity=quantity, unit=spec.unit, requested=float(spec.loss),
                realised=step.realised[name], measured=None if found is None else 100.0 - found[0],
                systematic=0.0 if found is None else 5.0 * found[1], allowed=0.0,
                note="multiples of the steps of the cosine transform"
                if found is not None else "the pictures are too plain",
            )
        )  # fmt: skip
    return (*result, *nothing_else(spec, step, site))


def _tables() -> Float64[np.ndarray, "100 64"]:
    """Steps at quality 1 to 100, by libjpeg's rule."""
    quality = np.arange(1, 101)
    scale = np.where(quality < 50, 5000 // quality, 200 - 2 * quality)
    return np.clip((ANNEX_K.ravel() * scale[:, None] + 50) // 100, 1, 255).astype(np.float64)


def _quality(both: list[Pair]) -> tuple[float, float] | None:
    """Mean and SD of the quality that the coefficients speak for."""
    blocks = np.concatenate([_coefficients(pair) for pair in both])
    seen = np.abs(blocks) > LEAST
    seen[:, 0] = False  # the mean of a block lies on a coarse grid of its own
    if seen.sum() < FEWEST:
        return None
    value, where = blocks[seen], np.nonzero(seen)[1]
    speaks = np.empty(100)
    for i, table in enumerate(_tables()):
        step = table[where]
        rest = value - step * np.rint(value / step)
        near = step * np.exp(-0.5 * (rest / ROUNDING_SD) ** 2) / (ROUNDING_SD * np.sqrt(2.0 * np.pi))
        speaks[i] = np.log((1.0 - ASTRAY) * near + ASTRAY).sum()
    chance = np.exp(speaks - speaks.max())
    chance /= chance.sum()
    quality = np.arange(1, 101)
    mean = float(chance @ quality)
    return mean, max(float(np.sqrt(chance @ (quality - mean) ** 2)), QUALITY_SD)


def _coefficients(pair: Pair) -> Float64[np.ndarray, "b 64"]:
    """Of whole blocks in which no pixel is black or white."""
    picture = pair.after.astype(np.float64)
    luma = picture[..., 0] if picture.shape[2] == 1 else picture @ LUMA
    rows, cols = luma.shape[0] // 8, luma.shape[1] // 8

    def cut(of: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "b 8 8"]:
        whole = of[: 8 * rows, : 8 * cols].reshape(rows, 8, cols, 8).swapaxes(1, 2)
        return np.asarray(whole.reshape(-1, 8, 8))

    clipped = ((picture == 0.0) | (picture == 255.0)).any(axis=2).astype(np.float64)
    free = np.nonzero(~cut(clipped).any(axis=(1, 2)))[0]
    free = free[:: max(1, len(free) // BLOCKS)]
    return np.asarray(dctn(cut(luma)[free] - 128.0, axes=(1, 2), norm="ortho").reshape(-1, 64))
