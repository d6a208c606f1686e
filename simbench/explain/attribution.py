"""From a table of values to what each cause cost: dividends and Shapley values with their intervals, what is
named as a cause, and when nothing is.

All numbers are losses: higher is worse (of precision, clean minus now; of an error in metres, now minus
clean). An effect below zero is a gain, and is shown so.

A run without a value, with whatever causes, is left out of that metric whole, for the runs are compared with
themselves; it is counted and told. Then "no cause" is not said: what could not be measured may be the
effect. Before that, a pipeline that failed counts as precision 0 and as gross error in every frame (it has
no metres to count).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from scenarios.seeding import stream
from simbench.explain.dividends import causes_in, dividends, members, order, shapley, up_to
from simbench.explain.family import exceeds, limit, t_values
from simbench.explain.permutations import Sampled
from simbench.score.statistics import MIN_RUNS, Summary, summarize

ROUNDING = 1e-12  # of the largest value: what sums and differences of exact equals leave
Verdict = Literal["caused", "no cause", "undecided"]


@dataclass(frozen=True, kw_only=True)
class Effect:
    """What a set of causes adds to the loss. summary: over runs, with its own 95 % interval; together: its
    interval among all dividends and the total at once, which decides whether it `counts`; share: of the
    total, where that is sure not to be zero. se: of sampling, where it was sampled."""

    causes: tuple[str, ...]
    summary: Summary
    together: tuple[float, float] | None = None
    counts: bool = False
    share: float | None = None
    sampling_se: float | None = None


@dataclass(frozen=True, kw_only=True)
class Attribution:
    """One metric of one pipeline. dividends: of every set whose value is known, by size; remainder: of all
    sets of three and more, None where there are none. named: the dividends that count, largest first; the
    remainder (no causes of its own) among them only where its sets were not taken apart. left_out: seeds."""

    pipeline: str
    metric: str
    clean: Summary
    whole: Summary
    total: Effect
    dividends: tuple[Effect, ...]
    remainder: Effect | None
    shapley: tuple[Effect, ...]
    left_out: tuple[int, ...]
    named: tuple[Effect, ...]
    verdict: Verdict
    why: str


def attribute(
    losses: Float64[np.ndarray, "s r"],
    names: Sequence[str],
    seeds: Sequence[int],
    *,
    pipeline: str = "",
    metric: str = "",
) -> Attribution:
    """Of a whole table: row S the loss with the set S of causes, NaN without a value; a column is a seed's
    run."""
    if causes_in(len(losses)) != len(names):
        raise ValueError(f"{len(losses)} rows do not fit {len(names)} causes")
    has = np.isfinite(losses).all(axis=0)
    known, ran = losses[:, has], [seed for seed, ok in zip(seeds, has, strict=True) if ok]
    table = _rounded(dividends(known), known)
    sets = up_to(len(names), len(names))[1:]
    taken = [(members(mask, names), table[mask]) for mask in sets]
    above = table[[mask for mask in sets if order(mask) > 2]].sum(axis=0) if len(names) > 2 else None
    phi = [(row, None) for row in shapley(table)]
    return _told(
        pipeline, metric, names, seeds, ran, known[0], known[-1], taken, above, False, phi,
    )  # fmt: skip


def attribute_sampled(
    small: Float64[np.ndarray, "m r"],
    whole: Float64[np.ndarray, " r"],
    found: Sampled,
    names: Sequence[str],
    seeds: Sequence[int],
    left_out: Sequence[int],
    *,
    pipeline: str = "",
    metric: str = "",
) -> Attribution:
    """Of many causes. small: the losses of all sets up to two (`up_to(k, 2)`), complete; whole: with all
    causes; seeds: those that were asked for, `left_out` of them without a value somewhere."""
    masks = up_to(len(names), 2)
    at = {mask: small[i] for i, mask in enumerate(masks)}
    rows: dict[int, np.ndarray] = {}
    for mask in masks[1:]:
        one = [1 << i for i in range(len(names)) if mask >> i & 1]
        alone = at[one[0]] - at[0]
        rows[mask] = alone if len(one) == 1 else (at[mask] - at[one[1]]) - alone
    largest = np.vstack([small, whole])
    table = _rounded(np.array(list(rows.values())), largest)
    above = _rounded((whole - small[0] - table.sum(axis=0))[None], largest)[0]
    taken = [(members(mask, names), row) for mask, row in zip(rows, table, strict=True)]
    phi = [(row, float(se)) for row, se in zip(found.phi, found.se, strict=True)]
    ran = [seed for seed in seeds if seed not in left_out]
    return _told(pipeline, metric, names, seeds, ran, small[0], whole, taken, above, True, phi)


def _rounded(
    table: Float64[np.ndarray, "m r"], values: Float64[np.ndarray, "s r"]
) -> Float64[np.ndarray, "m r"]:
    """Exact zeros in place of what rounding leaves."""
    floor = ROUNDING * float(np.abs(values).max(initial=0.0))
    return np.where(np.abs(table) <= floor, 0.0, table)


def _told(
    pipeline: str,
    metric: str,
    names: Sequence[str],
    seeds: Sequence[int],
    ran: Sequence[int],
    clean: np.ndarray,
    whole: np.ndarray,
    taken: Sequence[tuple[tuple[str, ...], np.ndarray]],
    above: np.ndarray | None,
    above_decides: bool,
    phi: Sequence[tuple[np.ndarray, float | None]],
) -> Attribution:
    def over_runs(values: np.ndarray, *what: str) -> Summary:
        rng = stream(0, "explain", pipeline, metric, *what)
        return summarize(dict(zip(ran, values.tolist(), strict=True)), rng)

    total = whole - clean
    decisive = [*(row for _, row in taken), total]
    if above is not None and above_decides:
        decisive.append(above)
    bounds, counts = _together(np.array(decisive).reshape(len(decisive), len(ran)), pipeline, metric)
    cost = over_runs(total, "total")
    sure = cost.ci95 is not None and not cost.ci95[0] <= 0.0 <= cost.ci95[1]

    def effect(
        of: tuple[str, ...], values: np.ndarray, what: str, at: int | None = None, se: float | None = None
    ) -> Effect:
        """`at`: its place among those that decide."""
        summary = over_runs(values, what, *of)
        return Effect(
            causes=of,
            summary=summary,
            together=None if at is None else bounds[at],
            counts=at is not None and counts[at],
            share=summary.mean / cost.mean if sure and cost.mean and summary.mean is not None else None,
            sampling_se=se,
        )

    effects = tuple(effect(of, row, "dividend", i) for i, (of, row) in enumerate(taken))
    last = len(decisive) - 1
    left = None if above is None else effect((), above, "remainder", last if above_decides else None)
    named = [e for e in (*effects, *(() if left is None else (left,))) if e.counts]
    left_out = tuple(seed for seed in seeds if seed not in ran)
    verdict, why = _verdict(len(ran), left_out, bool(named), counts[len(taken)])
    return Attribution(
        pipeline=pipeline,
        metric=metric,
        clean=over_runs(clean, "clean"),
        whole=over_runs(whole, "whole"),
        total=Effect(
            causes=tuple(names), summary=cost, together=bounds[len(taken)], counts=counts[len(taken)]
        ),
        dividends=effects,
        remainder=left,
        shapley=tuple(
            effect((name,), row, "shapley", se=se) for name, (row, se) in zip(names, phi, strict=True)
        ),
        left_out=left_out,
        named=tuple(sorted(named, key=lambda e: -abs(e.summary.mean or 0.0))),
        verdict=verdict,
        why=why,
    )


def _together(
    effects: Float64[np.ndarray, "m n"], pipeline: str, metric: str
) -> tuple[list[tuple[float, float] | None], list[bool]]:
    """The intervals of all effects at once, and which of them exclude zero; none below 6 runs."""
    m, n = effects.shape
    if n < MIN_RUNS or m == 0:
        return [None] * m, [False] * m
    c = limit(effects, stream(0, "explain", pipeline, metric, "together"))
    if not np.isfinite(c):
        return [None] * m, [False] * m
    mean, half = effects.mean(axis=1), c * effects.std(axis=1, ddof=1) / np.sqrt(n)
    bounds: list[tuple[float, float] | None] = [
        (float(a - b), float(a + b)) for a, b in zip(mean, half, strict=True)
    ]
    return bounds, [bool(found) for found in exceeds(t_values(effects), c)]


def _verdict(runs: int, left_out: Sequence[int], any_named: bool, total_counts: bool) -> tuple[Verdict, str]:
    if runs < MIN_RUNS:
        return "undecided", f"{runs} runs with a value everywhere: at least {MIN_RUNS} are needed"
    if any_named:
        return "caused", ""
    if total_counts:
        return (
            "undecided",
            f"all causes together cost or gain, but no set of them is beyond chance in {runs} runs",
        )
    if left_out:
        return "undecided", f"{len(left_out)} runs have no value somewhere, which may be an effect"
    return "no cause", f"no effect is beyond chance in {runs} runs"
