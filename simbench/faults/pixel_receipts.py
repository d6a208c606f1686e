"""Receipts of wrong exposure, little light and noise: display values after against before.

Exposure: ratio of the sums of linear light, over pixels that are neither black nor white. Noise: squared
changes of linear light, level by level, against those that a normal quadrature expects of a strength, with
clipping and rounding to 8 bits; the strength is sought that explains their weighted sum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import log, sqrt

import numpy as np
from jaxtyping import Float64

from scenarios.faults import FaultSpec
from scenarios.faults.camera import ExtraNoise, LowLight, WrongExposure
from scenarios.scenario import CameraSensor
from simbench.faults.fault import Site, Step
from simbench.faults.receipt import Receipt, judge, untouched
from simbench.faults.seen import Pair, borders, levels, light_of, nothing_else, pairs, steps, unseen
from simbench.faults.struck import struck

FEWEST = 200
DARKEST, BRIGHTEST = 4, 250  # display values that are neither black nor white
Z = np.linspace(-6.0, 6.0, 361)
WEIGHT = np.exp(-0.5 * Z**2) / np.exp(-0.5 * Z**2).sum()
ALIKE_SD = 0.005  # of a correlation, beside 1 / sqrt(n): clipping is alike from picture to picture

TRIALS = np.array(
    [0, 0.1, 0.25, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1, 1.02, 1.05, 1.1, 1.2, 1.35, 1.5, 2, 3, 5]
)  # times the strength that is asked for
ASKED = int(np.searchsorted(TRIALS, 1.0))
MODEL_SHARE = 0.002  # of the strength, at most: few electrons are not quite normal, even with their skewness

Electrons = tuple[float, float]
Levels = Float64[np.ndarray, "256 1"]
Read = Float64[np.ndarray, "256 z"]
Reading = Callable[[float, Levels, Electrons], Read]


# -- camera.exposure_ev -----------------------------------------------------------------------------------


def exposure_receipts(spec: WrongExposure, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Of every struck camera."""
    result = []
    for name in struck(spec, site.rig):
        quantity, both = f"{name} exposure", [pair.thinned() for pair in pairs(step, site, name)]
        if not both:
            result.append(unseen(spec.name, quantity, spec.unit, spec.stops))
            continue
        found, note = _stops(both), "linear light of pixels that are neither black nor white"
        result.append(
            judge(
                fault=spec.name, quantity=quantity, unit=spec.unit, requested=spec.stops,
                realised=step.realised[name], measured=None if found is None else found[0],
                systematic=0.0 if found is None else 5.0 * found[1], allowed=1e-9,
                note=note if found is not None else "hardly a pixel is neither black nor white",
            )
        )  # fmt: skip
    return (*result, *nothing_else(spec, step, site))


def _stops(both: list[Pair]) -> tuple[float, float] | None:
    """The SD is that of rounding to 8 bits, which errs alike wherever a display value is the same."""
    count = np.zeros((256, 256))
    for pair in both:
        code = pair.before.astype(np.int64) * 256 + pair.after
        count += np.bincount(code.ravel(), minlength=256 * 256).reshape(256, 256)
    count[: DARKEST + 1], count[BRIGHTEST:] = 0.0, 0.0
    count[:, : DARKEST + 1], count[:, BRIGHTEST:] = 0.0, 0.0
    if count.sum() < FEWEST:
        return None
    before, after = count.sum(axis=1) @ levels(), count.sum(axis=0) @ levels()
    rounded = np.sqrt(np.sum((count * steps()[None, :]) ** 2) / 12.0)
    return float(np.log2(after / before)), float(rounded / after / log(2.0)) + 1e-5


# -- camera.noise_e, camera.low_light_stops ---------------------------------------------------------------


def noise_receipts(spec: ExtraNoise, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Of every struck camera."""
    return _of_noise(spec, step, site, "noise", _noisy)


def low_light_receipts(spec: LowLight, step: Step, site: Site) -> tuple[Receipt, ...]:
    """Of every struck camera."""
    return _of_noise(spec, step, site, "loss of light", _darkened)


def _noisy(read_e: float, lin: Levels, sensor: Electrons) -> Read:
    return np.asarray(lin + read_e / sensor[0] * Z)


def _darkened(stops: float, lin: Levels, sensor: Electrons) -> Read:
    """The electrons that are left and the read noise that is added, by the first four cumulants of their sum
    (Cornish and Fisher 1938): few electrons are not normal, and two cumulants alone see too little noise."""
    white_e, read_e = sensor
    kept, electrons = 2.0**-stops, np.rint(lin * white_e)
    shot = kept * (1.0 - kept) * electrons
    spread2 = shot + (1.0 - kept**2) * read_e**2 + 1e-12
    skew = (1.0 - 2.0 * kept) * shot / spread2**1.5
    excess = (1.0 - 6.0 * kept * (1.0 - kept)) * shot / spread2**2
    bent = skew * (Z**2 - 1.0) / 6.0
    bent += excess * (Z**3 - 3.0 * Z) / 24.0 - skew**2 * (2.0 * Z**3 - 5.0 * Z) / 36.0
    return np.asarray(lin + np.sqrt(spread2) * (Z + bent) / (kept * white_e))


def _of_noise(spec: FaultSpec, step: Step, site: Site, what: str, read: Reading) -> tuple[Receipt, ...]:
    strength = float(getattr(spec, spec.strength))
    result, alike = [], []
    for name in struck(spec, site.rig):
        quantity, whole = f"{name} {what}", pairs(step, site, name)
        if not whole:
            result.append(unseen(spec.name, quantity, spec.unit, strength))
            continue
        both = [pair.thinned() for pair in whole]
        drawn = sum(pair.before.size for pair in whole) if read is _noisy else None
        found = _strength(both, _curve(read, strength, _electrons(site.rig.cameras[name])), drawn)
        pixels = sum(pair.before.size for pair in both)
        result.append(
            judge(
                fault=spec.name, quantity=quantity, unit=spec.unit, requested=strength,
                realised=step.realised[name], measured=None if found is None else found[0],
                estimator_sd=0.0 if found is None else found[1], systematic=MODEL_SHARE * strength,
                allowed=max(5.0 * strength / sqrt(2.0 * pixels), 0.001 * strength),
                note="squared changes of linear light by level of brightness"
                if found is not None else "too few pixels in which it would be seen",
            )
        )  # fmt: skip
        alike += [_alike(one, two) for one, two in pairwise(both)][:1]
    return (
        *result,
        *untouched(
            fault=spec.name, quantity="likeness of the noise of two pictures", unit="1", found=alike,
            note="correlation of the changes of the same pixels",
        ),
        *nothing_else(spec, step, site),
    )  # fmt: skip


def _electrons(sensor: CameraSensor) -> Electrons:
    """Of white, and of read noise, by the sensor file."""
    if sensor.noise is None:
        return 10_000.0, 3.0
    return sensor.noise.full_well_e / sensor.noise.gain, float(sensor.noise.read_noise_e)


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """What trial strengths would do: mean squared change of linear light [trial level]. At the strength that
    is asked for, `fourth`: mean fourth power; `shared`: covariance of the squared change with the square of
    the normal number behind it."""

    strength: Float64[np.ndarray, " t"]
    square: Float64[np.ndarray, "t 256"]
    fourth: Float64[np.ndarray, "256"]
    shared: Float64[np.ndarray, "256"]


@lru_cache(maxsize=16)
def _curve(read: Reading, about: float, sensor: Electrons) -> Curve:
    lin = levels()[:, None]

    def change(strength: float) -> Float64[np.ndarray, "256 z"]:
        return np.asarray(levels()[np.searchsorted(borders(), read(strength, lin, sensor))] - lin)

    return Curve(
        strength=about * TRIALS,
        square=np.stack([change(float(s)) ** 2 @ WEIGHT for s in about * TRIALS]),
        fourth=np.asarray(change(about) ** 4 @ WEIGHT),
        shared=np.asarray(change(about) ** 2 * (Z**2 - 1.0) @ WEIGHT),
    )


def _strength(both: list[Pair], curve: Curve, drawn: int | None) -> tuple[float, float] | None:
    """The strength that explains the squared changes, and its SD; None where it would not be seen. drawn: so
    many normal numbers in all were drawn, of which the RMS is what was realised: what they and the squared
    changes scatter together is no error."""
    count, power = np.zeros(256), np.zeros(256)
    for pair in both:
        level, change = pair.before.ravel(), (light_of(pair.after) - light_of(pair.before)).ravel()
        count += np.bincount(level, minlength=256)
        power += np.bincount(level, change**2, minlength=256)
    count[255], power[255] = 0.0, 0.0  # white stays white
    expected = curve.square[ASKED]
    seen = (expected > 0.0) & (count > 0.0)
    if count[seen].sum() < FEWEST:
        return None
    weight = np.where(seen, 1.0 / np.where(seen, expected, 1.0), 0.0)
    total = curve.square @ (weight * count)
    slope = (total[ASKED + 1] - total[ASKED - 1]) / (curve.strength[ASKED + 1] - curve.strength[ASKED - 1])
    if slope <= 0.0:
        return None
    measured = float(np.interp(weight @ power, np.maximum.accumulate(total), curve.strength))
    spread = sqrt(float(np.sum(weight**2 * count * np.maximum(curve.fourth - expected**2, 0.0))))
    sd = spread / float(slope)
    if drawn is None:
        return measured, sd
    realised_sd = float(curve.strength[ASKED]) / sqrt(2.0 * drawn)
    along = 2.0 * realised_sd**2 / float(curve.strength[ASKED]) * float(np.sum(weight * count * curve.shared))
    return measured, sqrt(max(sd**2 + realised_sd**2 - along / float(slope), 0.0))


def _alike(one: Pair, two: Pair) -> tuple[float, float]:
    """Correlation of the changes in two pictures, apart from what all pixels of a level share; and its SD."""
    changes = []
    for pair in (one, two):
        level, change = pair.before.ravel(), (light_of(pair.after) - light_of(pair.before)).ravel()
        n = np.maximum(np.bincount(level, minlength=256), 1)
        mean = np.bincount(level, change, minlength=256) / n
        sd = np.sqrt(np.bincount(level, (change - mean[level]) ** 2, minlength=256) / n)
        changes.append((change - mean[level]) / np.maximum(sd[level], 1e-12))
    return float(np.mean(changes[0] * changes[1])), 1.0 / sqrt(len(changes[0])) + ALIKE_SD
