"""Numbers left to the seed: `{uniform: [a, b]}`, `{normal: {mean: m, sd: s}}`, `{choice: [..]}`.

They are found and drawn on the plain tree of a file, before the schema sees it. `ends` are the values that
a distribution can reach, so that a file can be checked once for all seeds.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from scenarios.errors import FieldPath, Where, show

if TYPE_CHECKING:
    import numpy as np

Value: TypeAlias = str | int | float

WORDS = ("uniform", "normal", "choice")
TRUNCATED_AT_SD = 3.0


@dataclass(frozen=True, kw_only=True)
class Uniform:
    """Any number from low to high, all equally likely."""

    low: float
    high: float

    def ends(self) -> tuple[Value, ...]:
        return self.low, self.high

    def draw(self, rng: np.random.Generator) -> float:
        return min(self.low + (self.high - self.low) * float(rng.random()), self.high)


@dataclass(frozen=True, kw_only=True)
class Normal:
    """A normal distribution cut off at three standard deviations, drawn by inversion."""

    mean: float
    sd: float

    def ends(self) -> tuple[Value, ...]:
        return self.mean - TRUNCATED_AT_SD * self.sd, self.mean + TRUNCATED_AT_SD * self.sd

    def draw(self, rng: np.random.Generator) -> float:
        from statistics import NormalDist

        unit = NormalDist()
        tail = unit.cdf(-TRUNCATED_AT_SD)
        z = unit.inv_cdf(tail + (1.0 - 2.0 * tail) * float(rng.random()))
        return self.mean + self.sd * min(max(z, -TRUNCATED_AT_SD), TRUNCATED_AT_SD)


@dataclass(frozen=True, kw_only=True)
class Choice:
    """One of the values (all numbers or all words), all equally likely."""

    values: tuple[Value, ...]

    def ends(self) -> tuple[Value, ...]:
        return self.values

    def draw(self, rng: np.random.Generator) -> Value:
        return self.values[int(rng.integers(len(self.values)))]


Distribution: TypeAlias = Uniform | Normal | Choice


def find_distributions(tree: Any, where: Where) -> dict[FieldPath, Distribution]:
    """Every distribution in the plain tree by its path, in file order. BadInput: one is malformed."""
    return dict(_walk(tree, (), where))


def _walk(tree: Any, path: FieldPath, where: Where) -> Iterator[tuple[FieldPath, Distribution]]:
    if isinstance(tree, dict):
        if any(word in tree for word in WORDS):
            yield path, _distribution(tree, path, where)
        else:
            for key, value in tree.items():
                yield from _walk(value, (*path, key), where)
    elif isinstance(tree, list):
        for index, value in enumerate(tree):
            yield from _walk(value, (*path, index), where)


def _distribution(tree: dict[str, Any], path: FieldPath, where: Where) -> Distribution:
    if len(tree) != 1:
        other = next(key for key in tree if key not in WORDS) if set(tree) - set(WORDS) else list(tree)[1]
        raise where.error(f"a distribution has one key only, {show(other)} is too many", (*path, other))
    word, given = next(iter(tree.items()))
    here = (*path, word)
    if word == "choice":
        if not isinstance(given, list) or not given:
            raise where.error(f"must be a list of values, is {show(given) if given else 'empty'}", here)
        if not (all(map(_is_number, given)) or all(isinstance(value, str) for value in given)):
            raise where.error("must hold numbers only or words only", here)
        return Choice(values=tuple(given))
    if word == "uniform":
        if not isinstance(given, list) or len(given) != 2 or not all(map(_is_number, given)):
            raise where.error("must be [low, high]: two numbers", here)
        low, high = float(given[0]), float(given[1])
        if low > high:
            raise where.error(f"low {given[0]} is above high {given[1]}", here)
        return Uniform(low=low, high=high)
    fits = isinstance(given, dict) and set(given) == {"mean", "sd"} and all(map(_is_number, given.values()))
    if not fits:
        raise where.error("must be {mean: number, sd: number}", here)
    if given["sd"] < 0:
        raise where.error(f"must not be negative, is {given['sd']}", (*here, "sd"))
    return Normal(mean=float(given["mean"]), sd=float(given["sd"]))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def substitute(tree: Any, values: Mapping[FieldPath, Value]) -> Any:
    """A copy of the plain tree with `values` at their paths; the last key of a path may be new."""
    if () in values:
        return values[()]
    tree = copy.deepcopy(tree)
    for path, value in values.items():
        node = tree
        for word in path[:-1]:
            node = node[word]
        node[path[-1]] = value
    return tree


def corners(distributions: Mapping[FieldPath, Distribution]) -> list[dict[FieldPath, Value]]:
    """Value sets that between them reach every end: all low, all high, then further choices."""
    ends = {path: distribution.ends() for path, distribution in distributions.items()}
    count = max((len(values) for values in ends.values()), default=1)
    return [{path: values[min(k, len(values) - 1)] for path, values in ends.items()} for k in range(count)]
