"""Receipts of defocus and dirt: pictures before and after.

Defocus: patches before are blurred in the Fourier domain by the transfer function of a disc, and the radius
is sought that gives the patch after. Dirt: ratio of the light of each pixel, summed over the run.
"""

from __future__ import annotations

from functools import lru_cache
from math import hypot, sqrt

import numpy as np
from jaxtyping import Complex128, Float64
from scipy.special import j1

from scenarios.faults.camera import Defocus, Dirt
from simbench.faults.fault import Site, Step
from simbench.faults.receipt import Receipt, judge
from simbench.faults.seen import Pair, light_of, nothing_else, pairs, steps, unseen
from simbench.faults.struck import struck

PICTURES = 3  # of a camera, spread over the run
PATCH_PX = 128
SMALLEST_PX = 0.5
ALIASES = 3  # what lies beyond the pixel grid's own frequencies, as often as that
NEAR_PX = np.array([-0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2])  # trial radii about the one that is asked for
RADIUS_SD_PX, RADIUS_SD = 0.005, 0.002  # beside what rounding leaves: aliases beyond; and of the radius
DARKEST = 0.003  # linear light (a display value of 10) under which a ratio says little
MOST_PICTURES = 12


# -- camera.defocus_px ------------------------------------------------------------------------------------


def defocus_receipts(spec: Defocus, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Of every struck camera."""
    result = []
    for name in struck(spec, site.rig):
        quantity, both = f"{name} radius of the blur", pairs(step, site, name, PICTURES)
        if not both:
            result.append(unseen(spec.name, quantity, spec.unit, spec.radius_px))
            continue
        if spec.radius_px <= SMALLEST_PX:
            same = all(np.array_equal(pair.before, pair.after) for pair in both)
            note = "a disc within a pixel changes nothing" if same else "pictures changed"
            result.append(
                judge(
                    fault=spec.name, quantity=quantity, unit=spec.unit, requested=spec.radius_px,
                    realised=step.realised[name], measured=None if same else float("nan"), estimator_sd=0.0,
                    allowed=1e-9, note=note,
                )
            )  # fmt: skip
            continue
        found = [f for f in (_radius_px(pair, spec.radius_px) for pair in both) if f is not None]
        weight = np.array([sd**-2.0 for _, sd in found])
        measured = float(weight @ np.array([r for r, _ in found]) / weight.sum()) if found else None
        result.append(
            judge(
                fault=spec.name, quantity=quantity, unit=spec.unit, requested=spec.radius_px,
                realised=step.realised[name], measured=measured,
                systematic=5.0 * float(weight.sum() ** -0.5) if found else 0.0, allowed=1e-9,
                note="transfer function of a disc between patches before and after"
                if found else "nothing in the pictures is sharp enough, or they are too small",
            )
        )  # fmt: skip
    return (*result, *nothing_else(spec, step, site))


def _radius_px(pair: Pair, about_px: float) -> tuple[float, float] | None:
    """And its SD, by what the best blur leaves over."""
    most_px = 2.0 * about_px + 1.0
    margin = int(np.ceil(most_px)) + 2
    before, after = _patches(pair, PATCH_PX + 2 * margin)
    inside = (slice(margin, before.shape[0] - margin), slice(margin, before.shape[1] - margin))
    if min(before[inside].shape) < 16:
        return None
    spectrum, target = np.fft.rfft2(before), after[inside]

    def blurred(radius_px: float) -> Float64[np.ndarray, "h w"]:
        wide = np.fft.irfft2(spectrum * _transfer(before.shape, radius_px), before.shape)
        return np.asarray(wide[inside])

    def misfit(radius_px: float) -> float:
        return float(np.sum((blurred(radius_px) - target) ** 2))

    trials = np.unique(np.concatenate([np.linspace(0.0, most_px, 17), about_px + NEAR_PX]))
    trials = trials[trials >= 0.0]
    best = float(trials[np.argmin([misfit(float(r)) for r in trials])])
    less_px, more_px = max(best - NEAR_PX[-1], 0.0), best + NEAR_PX[-1]
    slope = (blurred(more_px) - blurred(less_px)) / (more_px - less_px)
    power = float(np.sum(slope**2))
    if power <= 0.0:
        return None
    change = float(np.sum(slope * (target - blurred(best)))) / power
    sd = sqrt(misfit(best) / target.size / power)
    limit = float(trials[-1]) / 16.0  # a step of the trials
    return best + float(np.clip(change, -limit, limit)), hypot(sd, RADIUS_SD_PX + RADIUS_SD * about_px)


def _patches(pair: Pair, size: int) -> tuple[Float64[np.ndarray, "h w"], Float64[np.ndarray, "h w"]]:
    """The square, before and after, whose light changes most from pixel to pixel."""
    before, after = (light_of(p).mean(axis=2) for p in (pair.before, pair.after))
    detail = np.zeros_like(before)
    detail[1:, 1:] = np.abs(np.diff(before, axis=0))[:, 1:] + np.abs(np.diff(before, axis=1))[1:]
    height, width = min(size, before.shape[0]), min(size, before.shape[1])
    total = np.pad(detail, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    inside = (
        total[height:, width:] - total[:-height, width:] - total[height:, :-width] + total[:-height, :-width]
    )
    row, col = np.unravel_index(int(np.argmax(inside)), inside.shape)
    patch = (slice(row, row + height), slice(col, col + width))
    return before[patch], after[patch]


@lru_cache(maxsize=128)
def _transfer(shape: tuple[int, int], radius_px: float) -> Complex128[np.ndarray, "h k"]:
    """Of a disc's light, gathered by square pixels and sampled in their middles: 2 J1(x) / x times the sincs
    of a pixel, with its aliases."""
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :]
    total = np.zeros((shape[0], shape[1] // 2 + 1))
    for m in range(-ALIASES, ALIASES + 1):
        for n in range(-ALIASES, ALIASES + 1):
            x = 2.0 * np.pi * radius_px * np.hypot(fy + m, fx + n)
            disc = np.where(x > 1e-9, 2.0 * j1(x) / np.where(x > 1e-9, x, 1.0), 1.0)
            total += disc * np.sinc(fy + m) * np.sinc(fx + n)
    return np.asarray(total / total[0, 0], dtype=np.complex128)


# -- camera.dirt_percent ----------------------------------------------------------------------------------


def dirt_receipts(spec: Dirt, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Of every struck camera the share that is in half shade or more, and the light that is lost."""
    result = []
    for name in struck(spec, site.rig):
        both = pairs(step, site, name, MOST_PICTURES)
        if not both:
            result.append(unseen(spec.name, f"{name} covered", spec.unit, spec.percent))
            continue
        before = np.sum([light_of(p.before).mean(axis=2) for p in both], axis=0)
        after = np.sum([light_of(p.after).mean(axis=2) for p in both], axis=0)
        rounded = np.sum([steps()[p.after].mean(axis=2) ** 2 for p in both], axis=0) / 12.0
        bright = before > DARKEST * len(both)
        found = bright.mean() > 0.5
        ratio = np.where(bright, after / np.where(bright, before, 1.0), 1.0)
        ratio_sd = np.sqrt(rounded) / np.where(bright, before, 1.0)
        half, n, dark = 1.0 - 0.5 * spec.opacity, int(bright.sum()), 1.0 - float(bright.mean())
        near = float(np.mean(np.abs(ratio - half)[bright] < 2.0 * ratio_sd[bright])) if found else 0.0
        share = 0.01 * step.realised.get(f"{name} covered", spec.percent)
        hidden = dark * sqrt(share * (1.0 - share))  # what black pixels would have shown
        for what, unit, requested, measured, sd, allowed in (
            (
                "covered",
                "%",
                spec.percent,
                100.0 * float(np.mean(ratio[bright] <= half)) if found else None,
                100.0 * (0.5 * near + hidden + 1.0 / max(n, 1)),
                0.1 + 100.0 / before.size,
            ),
            (
                "lost",
                "% of the light",
                step.realised.get(f"{name} lost", 0.0),
                100.0 * float(np.mean(1.0 - ratio[bright])) if found else None,
                100.0 * (float(np.mean(ratio_sd[bright] if found else 0.0)) * 0.1 + hidden + 1e-5),
                0.0,
            ),
        ):
            result.append(
                judge(
                    fault=spec.name, quantity=f"{name} {what}", unit=unit, requested=requested,
                    realised=step.realised.get(f"{name} {what}", 0.0), measured=measured, systematic=5.0 * sd,
                    allowed=allowed,
                    note="light of each pixel, after over before" if found else "most of it is black",
                )
            )  # fmt: skip
    return (*result, *nothing_else(spec, step, site))
