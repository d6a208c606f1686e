"""The fit as tables, and its verdict in sentences."""

from __future__ import annotations

from collections.abc import Iterator

from simbench.reproduce.fit.study import CellReach, Fit
from simbench.reproduce.sheet import Sheet
from simbench.reproduce.words import COLUMNS, NONE, number, p_is, stretches


def levels(fit: Fit) -> Sheet:
    """What the fit makes of every level."""
    rows = [
        (
            one.name, f"0 to {one.bound:g} {one.unit}", f"{one.p50:.3g} [{one.p5:.3g}, {one.p95:.3g}]",
            f"{one.mean:.3g} ({one.prior_mean:.3g})",
            *(stretches(fits) for fits in one.fits), stretches(one.fits_together),
            f"{fit.checked.holm_p[one.name]:.2f}",
        )
        for one in fit.levels
    ]  # fmt: skip
    return Sheet(
        name=f"levels-{fit.system}-{fit.baseline}",
        title=f"Levels that bring the {COLUMNS[fit.baseline]} to the paper's values, {fit.system}",
        columns=(
            "cause", "prior: uniform", "posterior: median [5 %, 95 %]", "mean (of the prior)",
            *(f"alone reaches {cell}" for cell in fit.cells), "alone reaches both", "check: Holm p",
        ),
        rows=tuple(rows), notes=tuple(fit_words(fit)),
    )  # fmt: skip


def fit_words(fit: Fit) -> Iterator[str]:
    """The verdict on a fit in sentences."""
    if fit.verdict == "conflict":
        yield (
            f"Prior-data conflict ({p_is(fit.joint_p)}): no levels within physics give both values but by "
            f"chance; the posterior is where the bench comes nearest, not an explanation."
        )
    else:
        yield (
            f"Levels within physics give both values (prior predictive {p_is(fit.joint_p)}): "
            f"{100 * fit.share:.0f} % of the prior does within chance and discrepancy"
            f"{', so that the two values say little about the levels' if fit.share > 0.5 else ''}."
        )
    for one in fit.reach:
        yield (
            f"{one.cell}: printed {100 * one.observed:.1f} %, within reach {100 * one.lowest:.1f} to "
            f"{100 * one.highest:.1f} % ({p_is(one.tail_p)}): {reach_words(one)}."
        )
    yield f"If the paper's two scenarios are the other way round: {p_is(fit.exchanged_p)}."
    yield (
        f"{fit.points} levels in a Sobol design; Gaussian-process emulators with "
        f"Q2 {', '.join(NONE if g.q2 is None else f'{g.q2:.2f}' for g in fit.emulators)}, run to run SD "
        f"{', '.join(f'{100 * g.noise_sd:.1f}' for g in fit.emulators)} points; discrepancy "
        f"{100 * fit.discrepancy:g} points; {fit.ess:.0f} effective draws."
    )
    coverage = ", ".join(f"{nominal}: {100 * value:.0f} %" for nominal, value in fit.checked.coverage.items())
    yield (
        f"On {fit.checked.truths} synthetic truths the intervals cover {coverage}; ranks are "
        f"{'uniform' if fit.checked.passed else 'NOT uniform'}"
        f"{f' ({fit.checked.why})' if fit.checked.why else ''}."
    )
    for other in fit.sensitivity:
        yield (
            f"With a discrepancy of {100 * other.discrepancy:g} points: {p_is(other.joint_p)}, "
            f"{100 * other.share:.1f} % of the prior fits."
        )
    if fit.why:
        yield fit.why


def reach_words(one: CellReach) -> str:
    """Whether any level reaches a cell, as far as the emulator knows."""
    if one.lowest <= one.observed <= one.highest:
        return "some level gives it"
    gap = 100 * max(one.lowest - one.observed, one.observed - one.highest)
    if one.reached:
        return f"no level gives it; the nearest is {gap:.1f} points off, which chance and discrepancy allow"
    if one.excluded:
        return f"no level gives it; the nearest is {gap:.1f} points off"
    return f"not known: the nearest is {gap:.1f} points off and the emulator is in doubt"


def predictions(fit: Fit) -> Sheet:
    """What the levels that fit predict of what was not fitted."""
    rows = [
        (
            one.what, number(one.predicted.printed, 3),
            f"{one.predicted.p50:.3f} [{one.predicted.p5:.3f}, {one.predicted.p95:.3f}]",
            number(one.predicted.tail_p, 3),
        )
        for one in fit.predictions
    ]  # fmt: skip
    return Sheet(
        name=f"predictions-{fit.system}-{fit.baseline}",
        title=f"Predicted from the {COLUMNS[fit.baseline]}'s fit, {fit.system}: none of these was fitted",
        columns=("number", "paper", "predicted: median [5 %, 95 %]", "chance of one as far out"),
        rows=tuple(rows),
        notes=(
            f"A TPR may differ by {100 * fit.discrepancy:g} points (SD) at the same levels; for the others "
            "no discrepancy is known, and none is taken.",
        ),
    )
