"""Numbers as the tables and findings of the reproduction print them."""

from __future__ import annotations

from simbench.case import ORACLE
from simbench.reproduce.cells import BASELINE, GROUND, METHOD, OURS
from simbench.reproduce.tables import Spread
from simbench.score.statistics import Summary

COLUMNS = {
    BASELINE: "raw box",
    GROUND: "box without ground",
    METHOD: "P-Fusion",
    OURS: "robust",
    ORACLE: "oracle",
}
NONE = "–"


def share(one: Summary, signed: bool = False) -> str:
    """A mean in per cent with its interval, or its range where there are too few runs for one."""
    return _summary(one, 100.0, 1, signed)


def metres(one: Summary, signed: bool = False) -> str:
    """The same in metres."""
    return _summary(one, 1.0, 2, signed)


def _summary(one: Summary, scale: float, digits: int, signed: bool) -> str:
    if one.mean is None:
        return NONE
    mark = "+" if signed else ""
    mean = f"{scale * one.mean:{mark}.{digits}f}"
    if one.ci95 is not None:
        return mean + interval(one, scale, digits, signed=signed)
    if one.n > 1 and one.low is not None and one.high is not None:
        return f"{mean} ({scale * one.low:{mark}.{digits}f} to {scale * one.high:{mark}.{digits}f})"
    return mean


def spread(one: Spread | None, digits: int) -> str:
    """Median and percentiles over draws."""
    return NONE if one is None else f"{one.median:.{digits}f} [{one.low:.{digits}f}, {one.high:.{digits}f}]"


def chance(p: float) -> str:
    """A p; what the paper prints as .001 stands for less."""
    return "< .001" if p <= 0.001 else f"{p:.3f}"


def chances(one: Spread | None) -> str:
    """Median and percentiles of p over draws."""
    return NONE if one is None else f"{chance(one.median)} [{chance(one.low)}, {chance(one.high)}]"


def plain_share(value: float | None) -> str:
    """In per cent."""
    return NONE if value is None else f"{100 * value:.1f}"


def number(value: float | None, digits: int) -> str:
    return NONE if value is None else f"{value:.{digits}f}"


def signed(value: float | None) -> str:
    return NONE if value is None else f"{value:+.2f}"


def stretches(fits: tuple[tuple[float, float], ...]) -> str:
    """Parts of a range of levels; what is next to nothing is 0."""
    return (
        ", ".join(f"{0.0 if low < 1e-3 * high else low:.3g} to {high:.3g}" for low, high in fits)
        or "no level"
    )


def p_is(p: float) -> str:
    """A p as sentences have it."""
    return "p < .001" if p <= 0.001 else f"p = {p:.3f}"


def interval(one: Summary, scale: float, digits: int, *, signed: bool = False) -> str:
    """The 95 % interval as `bounds` writes it."""
    return bounds(one.ci95, scale, digits, signed=signed)


def bounds(ends: tuple[float, float] | None, scale: float, digits: int, *, signed: bool = False) -> str:
    """An interval in brackets after a blank; nothing where there is none."""
    if ends is None:
        return ""
    mark, (low, high) = "+" if signed else "", ends
    return f" [{scale * low:{mark}.{digits}f}, {scale * high:{mark}.{digits}f}]"
