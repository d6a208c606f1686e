"""The fit of one rig: which levels of its causes, within what is physical, bring a baseline to the two values
that the paper printed for it; and what these levels predict of everything else that it printed.

The paper does not say whether its baseline was counted before or after the ground was removed, so both are
fitted. Fitted are the baseline's means in both scenarios, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from scenarios.seeding import stream
from simbench.paper import MAE, PASSES, PaperTpr
from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import CELLS, METHOD, Cell
from simbench.reproduce.collect import Run, values_of
from simbench.reproduce.fit.calibration_check import calibrate
from simbench.reproduce.fit.conflict import conflict, reach
from simbench.reproduce.fit.describe import (
    fitting,
    posterior_correlations,
    posterior_means,
    posterior_quantiles,
    prior_share,
)
from simbench.reproduce.fit.emulate import Emulator, Goodness, fit_emulator, goodness
from simbench.reproduce.fit.infer import Observed, Posterior, emulated, infer, run_covariance
from simbench.reproduce.fit.predict import Predictive, predictive
from simbench.reproduce.fit.single import alone, grids
from simbench.reproduce.levels import LEVELS, prior
from simbench.reproduce.plan import fit_points

DRAWS = 20_000
CHECKED_DRAWS = 4_000  # of the prior, in the check on synthetic truths
SHOWN = 400  # draws of the posterior that are kept for plots
GRID = 21  # levels of a curve
LEAST_VALUES = 8  # runs with a value, for an emulator
DISCREPANCY = 0.05  # SD of TPR: what the bench's scene and the paper's may differ by at the same levels
OTHERS = (0.0, 0.1)  # discrepancies with which the fit is made again


@dataclass(frozen=True, kw_only=True)
class CellReach:
    """Whether any level within the prior reaches a cell, and the chance of a value as far out as printed."""

    cell: str
    observed: float
    lowest: float
    highest: float
    reached: bool
    excluded: bool
    tail_p: float


@dataclass(frozen=True, kw_only=True)
class LevelPosterior:
    """One cause. p5, p50, p95: of the posterior (a frame late: `mean` is its share); curve: the emulated
    baseline along it with all others at 0, [level][cell]; fits: stretches of it that fit, by cell."""

    name: str
    unit: str
    bound: float
    p5: float
    p50: float
    p95: float
    mean: float
    prior_mean: float
    level: tuple[float, ...]
    curve: tuple[tuple[float, ...], ...]
    fits: tuple[tuple[tuple[float, float], ...], ...]
    fits_together: tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Checked:
    """Simulation-based calibration: are ranks uniform, by level and of the likelihood (Holm-adjusted p); and
    the coverage of the 50 and 90 % intervals, mean over levels."""

    truths: int
    passed: bool
    holm_p: dict[str, float]
    coverage: dict[str, float]
    why: str | None


@dataclass(frozen=True, kw_only=True)
class Predicted:
    """A number of the paper that was not fitted."""

    what: str
    predicted: Predictive


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """The fit with another discrepancy."""

    discrepancy: float
    joint_p: float
    share: float
    medians: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Fit:
    """verdict: `fits`: levels within physics reach all values together; `conflict`: they do not, within what
    chance and discrepancy allow (joint_p, Evans & Moshonov 2006, below 0.05), and the posterior is no answer.
    exchanged_p: joint_p if the paper's two scenarios are the other way round.
    share: of the prior's draws that fit; samples: draws of the posterior, a row a draw; plane: what draws of
    the prior give in the two cells."""

    system: str
    baseline: str
    cells: tuple[str, ...]
    observed: tuple[float, ...]
    points: int
    emulators: tuple[Goodness, ...]
    discrepancy: float
    verdict: Literal["fits", "conflict"]
    joint_p: float
    exchanged_p: float
    share: float
    prior_share: float
    ess: float
    why: str | None
    reach: tuple[CellReach, ...]
    levels: tuple[LevelPosterior, ...]
    correlations: tuple[tuple[float | None, ...], ...]
    samples: tuple[tuple[float, ...], ...]
    plane: tuple[tuple[float, ...], ...]
    checked: Checked
    predictions: tuple[Predicted, ...]
    sensitivity: tuple[Sensitivity, ...]


def fit_rig(found: Found, system: str, baseline: str) -> Fit:
    """ValueError: the design was not run, or too few of its runs have a value."""
    levels = LEVELS[system]
    count = found.size.fit_points
    design = fit_points(system, count)
    cells = tuple(cell for cell in CELLS if cell.system == system)
    names = tuple(cell.name for cell in cells)
    values = np.column_stack([_values(found, name, baseline, "tpr", count) for name in names])
    high = np.array([level.bound for level in levels])
    low = np.zeros(len(levels))

    def emulator(column: Float64[np.ndarray, " n"]) -> Emulator:
        return fit_emulator(design, column, low=low, high=high)

    def rng(name: str) -> np.random.Generator:
        return stream(0, "reproduce", "fit", system, baseline, name)

    emulators = [emulator(column) for column in values.T]
    draws = prior(levels, rng("draws").random((DRAWS, len(levels))))
    printed = tuple(cell.printed for cell in cells)
    observed, exchanged = _baselines(printed), _baselines(printed[::-1])
    at, run_cov = emulated(emulators, draws), run_covariance(emulators, independent=True)
    posterior = infer(draws, at, observed, run_cov, DISCREPANCY, rng("resampling"), keep=SHOWN)
    doubt = conflict(at, observed, run_cov, DISCREPANCY, rng("conflict"))
    other_way = conflict(at, exchanged, run_cov, DISCREPANCY, rng("exchanged"))
    return Fit(
        system=system, baseline=baseline, cells=names, observed=tuple(observed.values.tolist()), points=count,
        emulators=tuple(goodness(one) for one in emulators), discrepancy=DISCREPANCY,
        verdict="conflict" if doubt.joint_p < 0.05 else "fits", joint_p=doubt.joint_p,
        exchanged_p=other_way.joint_p, share=float(fitting(posterior).mean()),
        prior_share=prior_share(posterior), ess=posterior.ess, why=posterior.why,
        reach=tuple(
            CellReach(
                cell=name, observed=one.observed, lowest=one.lowest, highest=one.highest,
                reached=one.reached, excluded=one.excluded, tail_p=float(tail),
            )
            for name, one, tail in zip(
                names, reach(at, observed, run_cov, DISCREPANCY), doubt.cell_p, strict=True
            )
        ),
        levels=_levels(system, posterior, emulators, observed, run_cov),
        correlations=tuple(
            tuple(None if np.isnan(one) else float(one) for one in row)
            for row in posterior_correlations(posterior)
        ),
        samples=_drawn(draws[posterior.resampled]), plane=_drawn(at.mean[:SHOWN]),
        checked=_checked(design, values, draws[:CHECKED_DRAWS], emulators, rng("check"), system),
        predictions=_predictions(found, system, baseline, posterior, emulator, cells),
        sensitivity=tuple(
            Sensitivity(
                discrepancy=other,
                joint_p=conflict(at, observed, run_cov, other, rng(f"conflict {other}")).joint_p,
                share=float(fitting(again).mean()),
                medians=tuple(posterior_quantiles(again, (0.5,))[0].tolist()),
            )
            for other in OTHERS
            for again in (infer(draws, at, observed, run_cov, other, rng(f"again {other}"), keep=SHOWN),)
        ),
    )  # fmt: skip


def _drawn(rows: Float64[np.ndarray, "n d"]) -> tuple[tuple[float, ...], ...]:
    """For plots: four digits."""
    return tuple(tuple(float(f"{value:.4g}") for value in row) for row in rows.tolist())


def _baselines(printed: Sequence[PaperTpr]) -> Observed:
    """The baselines of these rows, cell by cell."""
    return Observed.of(
        [row.baseline for row in printed], passes=PASSES, frame_sd=[row.baseline_sd for row in printed],
        frames=[row.n for row in printed],
    )  # fmt: skip


def _values(found: Found, cell: str, pipeline: str, metric: str, count: int) -> Float64[np.ndarray, " n"]:
    """A metric at every point of the design; NaN where there is none."""
    return np.array([_one(found.of("fit", cell, pipeline, number), metric) for number in range(count)])


def _one(runs: Sequence[Run], metric: str) -> float:
    value = next(iter(values_of(runs, metric).values()), None)
    return np.nan if value is None else value


def _gain_sd(found: Found, cell: str, baseline: str, count: int) -> Float64[np.ndarray, " n"]:
    """At every point: the SD over pairs of the method's TPR minus the baseline's."""
    sds = []
    for number in range(count):
        before, after = (found.of("fit", cell, name, number) for name in (baseline, METHOD))
        one = {(p.scan_seq, p.camera): p.tpr for run in before for p in run.pairs}
        both = [
            p.tpr - one[key] for run in after for p in run.pairs if (key := (p.scan_seq, p.camera)) in one
        ]
        sds.append(float(np.std(both, ddof=1)) if len(both) > 1 else np.nan)
    return np.array(sds)


def _levels(
    system: str, posterior: Posterior, emulators: Sequence[Emulator], observed: Observed,
    run_cov: Float64[np.ndarray, "k k"],
) -> tuple[LevelPosterior, ...]:  # fmt: skip
    levels = LEVELS[system]
    low, median, high = posterior_quantiles(posterior, (0.05, 0.5, 0.95)).tolist()
    means = posterior_means(posterior)
    curves = alone(
        emulators, observed, run_cov, DISCREPANCY, np.zeros(len(levels)), grids(posterior.draws, GRID)
    )
    return tuple(
        LevelPosterior(
            name=level.name, unit=level.unit, bound=level.bound, p5=low[i], p50=median[i], p95=high[i],
            mean=float(means[i]), prior_mean=float(posterior.draws[:, i].mean()),
            level=tuple(curve.levels.tolist()), curve=tuple(tuple(row) for row in curve.mean.tolist()),
            fits=curve.fits, fits_together=curve.together,
        )
        for i, (level, curve) in enumerate(zip(levels, curves, strict=True))
    )  # fmt: skip


def _checked(
    design: Float64[np.ndarray, "n d"], values: Float64[np.ndarray, "n k"],
    draws: Float64[np.ndarray, "m d"], emulators: Sequence[Emulator], rng: np.random.Generator, system: str,
) -> Checked:  # fmt: skip
    found = calibrate(design, values, draws, rng, emulators=emulators)
    names = (*(level.name for level in LEVELS[system]), "likelihood")
    return Checked(
        truths=found.truths, passed=bool(found.passed),
        holm_p=dict(zip(names, found.holm_p.tolist(), strict=True)),
        coverage={f"{one.nominal:.0%}": float(one.share.mean()) for one in found.coverage}, why=found.why,
    )  # fmt: skip


def _predictions(
    found: Found, system: str, baseline: str, posterior: Posterior,
    emulator: Callable[[Float64[np.ndarray, " n"]], Emulator], cells: Sequence[Cell],
) -> tuple[Predicted, ...]:  # fmt: skip
    count, asked = found.size.fit_points, list[_Asked]()
    for cell in cells:
        row = cell.printed
        asked += [
            _Asked(
                what=f"{cell.name}: TPR of P-Fusion", values=_values(found, cell.name, METHOD, "tpr", count),
                printed=row.fusion, frame_sd=row.fusion_sd, n=row.n, most=1.0, discrepancy=DISCREPANCY,
            ),
            _Asked(
                what=f"{cell.name}: SD of the paired difference",
                values=_gain_sd(found, cell.name, baseline, count), printed=paired_sd(row), n=row.n,
            ),
        ]  # fmt: skip
    both = [_values(found, cell.name, METHOD, "mae_m.smooth.gnss", count) for cell in cells]
    mae = MAE[system]
    asked.append(
        _Asked(
            what="both scenarios: MAE against the held GNSS (m)", values=np.mean(both, axis=0),
            printed=mae.mean_m, frame_sd=mae.sd_m, n=mae.n,
        )
    )  # fmt: skip
    return tuple(
        Predicted(
            what=one.what,
            predicted=predictive(
                posterior, [emulator(one.values)],
                Observed.of([one.printed], passes=PASSES, frame_sd=[one.frame_sd], frames=[one.n]),
                discrepancy_sd=one.discrepancy, possible=(0.0, one.most),
            )[0],
        )
        for one in asked
        if np.isfinite(one.values).sum() >= LEAST_VALUES  # an emulator of fewer would be none
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Asked:
    """A number to predict: its values over the design [n], and how it was printed. most: the greatest that
    there can be. discrepancy: SD; known for a TPR only."""

    what: str
    values: Float64[np.ndarray, " n"]
    printed: float
    n: int
    frame_sd: float = 0.0
    most: float = np.inf
    discrepancy: float = 0.0


def paired_sd(row: PaperTpr) -> float:
    """The SD of the paired differences that the printed means, n and t imply: t = mean / (sd / sqrt(n))."""
    return (row.fusion - row.baseline) * math.sqrt(row.n) / row.paired_t
