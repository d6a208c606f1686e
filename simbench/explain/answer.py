"""The whole answer: every metric of every pipeline taken apart, and the error budgets without and with all
causes.

Up to six causes every set of them is measured. With more, all sets of up to two and all causes together (the
dividends of singles and pairs stay exact, all above is the remainder), and Shapley values are sampled
(`permutations.py`) until their error is below 2 % of every total that is sure not to be zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.seeding import stream
from simbench.case import ORACLE
from simbench.explain.attribution import Attribution, attribute, attribute_sampled
from simbench.explain.dividends import up_to
from simbench.explain.permutations import MIN_PAIRS, MOST_PAIRS, Order, orders, prefixes, sampled
from simbench.explain.values import METRICS, Measured
from simbench.score.metrics import BUDGET_AXES, BUDGET_PARTS
from simbench.score.statistics import MIN_RUNS, Summary, summarize, t_interval

MOST_EXACT = 6


@dataclass(frozen=True, kw_only=True)
class BudgetRow:
    """A part of the error budget along an axis, signed, mean over runs: without the causes and with all."""

    pipeline: str
    axis: str
    part: str
    clean: Summary
    whole: Summary


@dataclass(frozen=True, kw_only=True)
class Answer:
    """attributions: by pipeline, then metric. valueless: metrics that no run has, whatever the causes.
    pairs: of orders that Shapley values were sampled with; None: exact. reached: whether the sampling error
    is as small as wanted."""

    attributions: tuple[Attribution, ...]
    valueless: tuple[tuple[str, str], ...]
    budget: tuple[BudgetRow, ...]
    pairs: int | None
    reached: bool


def answer(measured: Measured, told: Callable[[Sequence[int]], None] = lambda _: None) -> Answer:
    """Measure what is needed and take it apart. `told` hears of every batch of sets before it is measured."""
    k = len(measured.question.causes)
    everything = range(1 << k)

    def measure(masks: Sequence[int]) -> None:
        told(masks)
        measured.measure(masks)

    if k <= MOST_EXACT:
        measure(everything)
        return _answer(measured, tuple(_exact(measured)), None, True)
    small = up_to(k, 2)
    measure((*small, everything[-1]))
    rng, pairs = stream(0, "explain", "orders", *measured.question.causes), list[tuple[Order, Order]]()
    known = {*small, everything[-1]}
    for pair in orders(k, rng):
        pairs.append(pair)
        wanted = sorted({mask for order in pair for mask in prefixes(order)})
        measure(wanted)
        known.update(wanted)
        if len(known) == len(everything):
            return _answer(measured, tuple(_exact(measured)), None, True)
        reached = all(_is_enough(measured, *of, known, pairs) for of in _questions(measured))
        if (reached and len(pairs) >= MIN_PAIRS) or len(pairs) == MOST_PAIRS:
            break
    found = tuple(_sampled(measured, *of, small, known, pairs) for of in _questions(measured))
    return _answer(measured, found, len(pairs), reached)


def _questions(measured: Measured) -> Iterator[tuple[str, str]]:
    """Those that have a value in some run."""
    for pipeline, metric in _asked(measured):
        if np.isfinite(measured.losses(pipeline, metric, measured.masks)).any():
            yield pipeline, metric


def _asked(measured: Measured) -> Iterator[tuple[str, str]]:
    """Every pipeline and metric; the oracle's precision is 1 whatever happens."""
    for pipeline in (*measured.question.pipelines, ORACLE):
        for metric in METRICS:
            if (pipeline, metric) != (ORACLE, "precision"):
                yield pipeline, metric


def _exact(measured: Measured) -> Iterator[Attribution]:
    names, seeds = measured.question.causes, measured.question.seeds
    for pipeline, metric in _questions(measured):
        losses = measured.losses(pipeline, metric, range(1 << len(names)))
        yield attribute(losses, names, seeds, pipeline=pipeline, metric=metric)


def _known(
    measured: Measured, pipeline: str, metric: str, known: Iterable[int]
) -> tuple[dict[int, np.ndarray], list[int]]:
    """The losses of every known set, of the runs that have all of them; and the seeds of the other runs."""
    masks = sorted(known)
    losses = measured.losses(pipeline, metric, masks)
    has = np.isfinite(losses).all(axis=0)
    left_out = [seed for seed, ok in zip(measured.question.seeds, has, strict=True) if not ok]
    return {mask: losses[i, has] for i, mask in enumerate(masks)}, left_out


def _is_enough(
    measured: Measured, pipeline: str, metric: str, known: Iterable[int], pairs: Sequence[tuple[Order, Order]]
) -> bool:
    """Whether the sampling error is below 2 % of this total, or the total may as well be zero."""
    row, _ = _known(measured, pipeline, metric, known)
    total = row[max(row)] - row[0]
    if len(total) < MIN_RUNS:
        return True
    low, high = t_interval(total)
    if low <= 0.0 <= high:
        return True
    return sampled(pairs, lambda of: np.array([row[mask] for mask in of])).is_enough(float(total.mean()))


def _sampled(
    measured: Measured,
    pipeline: str,
    metric: str,
    small: Sequence[int],
    known: Iterable[int],
    pairs: Sequence[tuple[Order, Order]],
) -> Attribution:
    row, left_out = _known(measured, pipeline, metric, known)

    def values(of: Sequence[int]) -> np.ndarray:
        return np.array([row[mask] for mask in of])

    return attribute_sampled(
        values(small), row[max(row)], sampled(pairs, values), measured.question.causes,
        measured.question.seeds, left_out, pipeline=pipeline, metric=metric,
    )  # fmt: skip


def _answer(
    measured: Measured, attributions: tuple[Attribution, ...], pairs: int | None, reached: bool
) -> Answer:
    whole = (1 << len(measured.question.causes)) - 1

    def over_runs(pipeline: str, axis: str, part: str, mask: int) -> Summary:
        values = measured.raw(pipeline, f"budget_{axis}_m.{part}", mask)
        return summarize(values, stream(0, "explain", "budget", pipeline, axis, part, str(mask)))

    budget = tuple(
        BudgetRow(
            pipeline=pipeline,
            axis=axis,
            part=part,
            clean=over_runs(pipeline, axis, part, 0),
            whole=over_runs(pipeline, axis, part, whole),
        )
        for pipeline in (*measured.question.pipelines, ORACLE)
        for axis in BUDGET_AXES
        for part in BUDGET_PARTS
    )
    told = {(a.pipeline, a.metric) for a in attributions}
    valueless = tuple(of for of in _asked(measured) if of not in told)
    return Answer(attributions=attributions, valueless=valueless, budget=budget, pairs=pairs, reached=reached)
