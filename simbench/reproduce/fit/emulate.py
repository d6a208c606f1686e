"""A Gaussian process in place of the bench: one output of a run by its levels of errors, and its doubt.

The noise is what two runs at the same levels differ by, taken to be the same at all levels. Left-out
predictions are in closed form with the hyper-parameters of the whole (Rasmussen & Williams 2006, section
5.4.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.linalg import cho_solve, cholesky, solve_triangular

from simbench.reproduce.fit.hyper import Hyper, kernel, kernel_at, likeliest

FEWEST = 4
AT_ONCE = 2048  # places predicted at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class Emulator:
    """Of one output. x: the design's rows that have one, from 0 to 1; z: the outputs, mean 0 and SD 1; hyper:
    in these units. low, span: of the inputs; centre, scale: of the output, in its unit.

    kept: row numbers in the design; dropped: rows without a finite output. factor: Cholesky factor of the
    covariance of z, alpha: its inverse times z.
    """

    x: Float64[np.ndarray, "n d"]
    z: Float64[np.ndarray, " n"]
    low: Float64[np.ndarray, " d"]
    span: Float64[np.ndarray, " d"]
    centre: float
    scale: float
    hyper: Hyper
    kept: Int64[np.ndarray, " n"]
    dropped: int
    factor: Float64[np.ndarray, "n n"]
    alpha: Float64[np.ndarray, " n"]

    @property
    def noise_sd(self) -> float:
        """SD between runs at the same levels, in the output's unit."""
        return self.hyper.noise * self.scale

    @property
    def amplitude_sd(self) -> float:
        """SD of the bend about the straight mean, in the output's unit."""
        return self.hyper.amplitude * self.scale

    @property
    def lengths(self) -> Float64[np.ndarray, " d"]:
        """Of the bend, as shares of each input's range; of an input that does not vary: a prior guess."""
        return self.hyper.lengths


@dataclass(frozen=True, kw_only=True, eq=False)
class LeftOut:
    """Each kept row predicted from all others. sd: of a run, noise and emulator; residual: output - mean."""

    mean: Float64[np.ndarray, " n"]
    sd: Float64[np.ndarray, " n"]
    residual: Float64[np.ndarray, " n"]


@dataclass(frozen=True, kw_only=True)
class Goodness:
    """How well left-out rows are predicted. q2: 1 - their squared error / that of the mean of the others;
    None: the output has no spread. within_2sd: share of rows; a sound emulator has about 0.95."""

    n: int
    dropped: int
    rmse: float
    q2: float | None
    within_2sd: float
    noise_sd: float


def fit_emulator(
    inputs: Float64[np.ndarray, "n d"],
    outputs: Float64[np.ndarray, " n"],
    *,
    low: Float64[np.ndarray, " d"] | None = None,
    high: Float64[np.ndarray, " d"] | None = None,
) -> Emulator:
    """Fit one output to a design, in any units; inputs are scaled to low..high (the design's ends where not
    given). Best give skewed inputs as their prior quantiles. Rows whose output is not finite are dropped.
    ValueError: shapes, an input that is not finite, or fewer than 4 outputs.
    """
    if inputs.ndim != 2 or outputs.shape != (len(inputs),):
        raise ValueError(f"{inputs.shape} inputs do not go with {outputs.shape} outputs")
    if not np.isfinite(inputs).all():
        raise ValueError("an input is not finite")
    kept = np.flatnonzero(np.isfinite(outputs))
    if len(kept) < FEWEST:
        raise ValueError(f"{len(kept)} finite outputs: an emulator needs at least {FEWEST}")
    lowest = inputs.min(axis=0) if low is None else low
    span = (inputs.max(axis=0) if high is None else high) - lowest
    y = outputs[kept]
    centre, scale = float(y.mean()), float(y.std())
    scale = scale if scale > 1e-9 * (1.0 + abs(centre)) else 1.0
    x, z = _scaled(inputs[kept], lowest, span), (y - centre) / scale
    hyper = likeliest(x, z)
    factor, alpha = _solve(hyper, x, z)
    return Emulator(
        x=x, z=z, low=lowest, span=span, centre=centre, scale=scale, hyper=hyper, kept=kept,
        dropped=len(outputs) - len(kept), factor=factor, alpha=alpha,
    )  # fmt: skip


def predict(
    emulator: Emulator, inputs: Float64[np.ndarray, "m d"]
) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
    """The mean over runs at each place and its SD, in the output's unit; a run scatters about it by noise_sd
    more. ValueError: another number of inputs than it was fitted to."""
    if inputs.ndim != 2 or inputs.shape[1] != len(emulator.low):
        raise ValueError(f"{inputs.shape} inputs: the emulator takes {len(emulator.low)} columns")
    x = _scaled(inputs, emulator.low, emulator.span)
    mean, sd = np.empty(len(x)), np.empty(len(x))
    for start in range(0, len(x), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        across = kernel(emulator.hyper, emulator.x, x[some])
        mean[some] = emulator.alpha @ across
        known = solve_triangular(emulator.factor, across, lower=True)
        sd[some] = np.sqrt(np.maximum(kernel_at(emulator.hyper, x[some]) - (known * known).sum(axis=0), 0.0))
    return emulator.centre + emulator.scale * mean, emulator.scale * sd


def without(emulator: Emulator, rows: Int64[np.ndarray, " r"]) -> Emulator:
    """As if some rows of the design had not been run; hyper-parameters and scales stay. ValueError: no row
    would be left."""
    stay = ~np.isin(emulator.kept, rows)
    if not stay.any():
        raise ValueError("no row would be left")
    x, z = emulator.x[stay], emulator.z[stay]
    factor, alpha = _solve(emulator.hyper, x, z)
    return Emulator(
        x=x, z=z, low=emulator.low, span=emulator.span, centre=emulator.centre, scale=emulator.scale,
        hyper=emulator.hyper, kept=emulator.kept[stay], dropped=emulator.dropped, factor=factor, alpha=alpha,
    )  # fmt: skip


def left_out(emulator: Emulator) -> LeftOut:
    """Every kept row, predicted from the others."""
    precision = np.diag(cho_solve((emulator.factor, True), np.eye(len(emulator.z))))
    residual = emulator.scale * emulator.alpha / precision
    output = emulator.centre + emulator.scale * emulator.z
    return LeftOut(mean=output - residual, sd=emulator.scale / np.sqrt(precision), residual=residual)


def goodness(emulator: Emulator) -> Goodness:
    """Of the left-out predictions."""
    out, n = left_out(emulator), len(emulator.z)
    square = float((out.residual**2).mean())
    # each row predicted by the mean of the others
    plain = float((emulator.z**2).mean()) * (emulator.scale * n / (n - 1)) ** 2
    return Goodness(
        n=n,
        dropped=emulator.dropped,
        rmse=square**0.5,
        q2=1.0 - square / plain if plain > 1e-18 * (1.0 + emulator.centre**2) else None,
        within_2sd=float((np.abs(out.residual) <= 2.0 * out.sd).mean()),
        noise_sd=emulator.noise_sd,
    )


def _scaled(
    inputs: Float64[np.ndarray, "n d"], low: Float64[np.ndarray, " d"], span: Float64[np.ndarray, " d"]
) -> Float64[np.ndarray, "n d"]:
    """From 0 to 1; an input without a range is 0.5 everywhere."""
    varies = span > 0.0
    return np.where(varies, (inputs - low) / np.where(varies, span, 1.0), 0.5)


def _solve(
    hyper: Hyper, x: Float64[np.ndarray, "n d"], z: Float64[np.ndarray, " n"]
) -> tuple[Float64[np.ndarray, "n n"], Float64[np.ndarray, " n"]]:
    factor = cholesky(kernel(hyper, x, x) + hyper.noise**2 * np.eye(len(x)), lower=True)
    return factor, cho_solve((factor, True), z)
