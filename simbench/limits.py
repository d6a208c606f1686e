"""What a pipeline must keep: `precision>=0.9`, `mae_m<=0.3`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.errors import Where, nearest, show
from simbench.score.metrics import BUDGET, METRICS, Metric

OPTION = "--limit"
STAGE = ".smooth"  # what a stem such as mae_m stands for
DEFINED = {metric.name: metric for metric in METRICS}
SIGNED = {metric.name for metric in BUDGET}  # the nearer to 0 the better
WORST = {"higher": 0.0, "lower": 1.0}  # of a share
LATENCY = re.compile(r"latency_ms(\.[\w-]+)?\.p(50|99)")


@dataclass(frozen=True, kw_only=True)
class Limit:
    """A metric's least (`>=`) or greatest (`<=`) value."""

    metric: Metric
    value: float

    @property
    def text(self) -> str:
        """As it is written, with the metric's full name."""
        return self.metric.name + self.text_of_value

    @property
    def text_of_value(self) -> str:
        """As it is written after the metric's name."""
        return f"{'>=' if self.metric.better == 'higher' else '<='}{self.value:g}"

    def margin(self, value: float | None) -> float:
        """By how much a value keeps the limit; below 0 it does not.

        A run without a value does not: a share counts as its worst, anything else misses by the limit's size.
        """
        if value is not None:
            value = abs(value) if self.metric.name in SIGNED else value
            return value - self.value if self.metric.better == "higher" else self.value - value
        size = abs(WORST[self.metric.better] - self.value) if self.metric.unit == "1" else abs(self.value)
        return -max(size, 1e-9)


def parse_limits(arguments: Sequence[str]) -> tuple[Limit, ...]:
    """The limits that `--limit` asks for. BadInput: malformed, unknown metric, wrong way round, twice."""
    limits = tuple(parse_limit(argument, Where(file=OPTION)) for argument in arguments)
    names = [limit.metric.name for limit in limits]
    for name in names:
        if names.count(name) > 1:
            raise Where(file=OPTION).error(f"{name} has two limits")
    return limits


def metric_named(word: str, where: Where, *, timed: bool = False) -> Metric:
    """The metric of a name, or of a stem such as mae_m. timed: latencies count too. BadInput: unknown."""
    name = word if word in DEFINED else word + STAGE
    if name in DEFINED:
        return DEFINED[name]
    if timed and LATENCY.fullmatch(word):
        return Metric(
            name=word, unit="ms", better="lower", per="scan", definition="Time that the pipeline takes."
        )
    stems = [known.removesuffix(STAGE) for known in DEFINED if known.endswith(STAGE)]
    latencies = ("latency_ms.p50", "latency_ms.p99") if timed else ()
    raise where.error(
        f"unknown metric {show(word)}; 'simbench list metrics' names them",
        hint=nearest(word, (*DEFINED, *stems, *latencies)),
    )


def parse_limit(argument: str, where: Where, *, timed: bool = False) -> Limit:
    """One limit. BadInput: malformed, unknown metric, wrong way round."""
    parts = re.fullmatch(r"\s*([^<>=\s]+)\s*(>=|<=)\s*(\S+)\s*", argument)
    if parts is None:
        raise where.error(f"is METRIC>=NUMBER or METRIC<=NUMBER; this is {show(argument)}")
    word, sign, number = parts.groups()
    metric = metric_named(word, where, timed=timed)
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", number):
        raise where.error(f"{word}: {show(number)} is no number")
    if (sign == ">=") != (metric.better == "higher"):
        right = ">=" if metric.better == "higher" else "<="
        raise where.error(f"{word}: {metric.better} is better, so its limit is {word}{right}{number}")
    return Limit(metric=metric, value=float(number))
