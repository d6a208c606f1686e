"""Looks: none but the planned ones, and levels that spend no more than alpha, by two ways of counting."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from scenarios.seeding import stream
from simbench.verdict.decide import judge
from simbench.verdict.sequential import LEVELS, LOOKS, decide_at, next_look

TIMES = np.array([0.25, 0.5, 1.0])
POCOCK = 0.05 * np.log(1.0 + (np.e - 1.0) * TIMES)  # what may be spent by each look


def spent(levels: list[float]) -> list[float]:
    """Chance that a Brownian motion is beyond its level first at each look: by integrating its density."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    at, mass, time, found = np.zeros(1), np.ones(1), 0.0, []
    for level, now in zip(levels, TIMES, strict=False):
        edge, low, step = ndtri(1.0 - level) * np.sqrt(now), -8.0 * np.sqrt(now), np.sqrt(now - time)
        found.append(float((mass * ndtr((at - edge) / step)).sum()))
        here = (edge - low) / 2 * nodes + (edge + low) / 2
        density = np.exp(-(((here[:, None] - at) / step) ** 2) / 2) / (step * np.sqrt(2 * np.pi)) @ mass
        at, mass, time = here, density * weights * (edge - low) / 2, now
    return found


def test_the_levels_spend_no_more_than_pococks_function_at_any_look() -> None:
    total = np.cumsum(spent(list(LEVELS.values())))
    assert (total <= POCOCK).all()
    assert total == pytest.approx([0.0177, 0.0305, 0.0494], abs=5e-5)


def test_all_of_alpha_would_allow_levels_that_are_hardly_higher() -> None:
    exact: list[float] = []
    for allowed in np.diff([0.0, *POCOCK]):
        exact.append(brentq(lambda p, a=allowed: spent([*exact, p])[-1] - a, 1e-4, 0.1))
    assert exact == pytest.approx([0.0179, 0.0189, 0.0279], abs=5e-5)
    assert all(0.97 * e < level < e for e, level in zip(exact, LEVELS.values(), strict=True))


def test_simulated_looks_are_wrong_as_often_as_integrated() -> None:
    """400,000 sums of normal values at 20, 40 and 80 runs."""
    steps = stream(0, "looks").normal(size=(400_000, 3)) * np.sqrt([20, 20, 40])
    z = np.cumsum(steps, axis=1) / np.sqrt(LOOKS)
    wrong = (z > ndtri(1.0 - np.array(list(LEVELS.values())))).any(axis=1).mean()
    assert wrong == pytest.approx(sum(spent(list(LEVELS.values()))), abs=4 * np.sqrt(0.05 * 0.95 / 400_000))


def sides(n: int, by: float, noise: float = 0.0) -> tuple[dict[int, float | None], dict[int, float | None]]:
    off = stream(1, "sides").normal(0.0, noise, n) if noise else np.zeros(n)
    return dict.fromkeys(range(n), 0.9), {i: 0.9 - by + float(off[i]) for i in range(n)}


def look(n: Any, by: float, noise: float = 0.01) -> Any:
    old, new = sides(n, by, noise)
    return decide_at(n, old, new, better="higher", rng=stream(0, "test"))


@pytest.mark.parametrize("n", [20, 40, 80])
def test_a_look_judges_at_its_own_level(n: Any) -> None:
    old, new = sides(n, 0.04, 0.02)
    ours = decide_at(n, old, new, better="higher", rng=stream(0, "test"))
    theirs = judge(old, new, better="higher", alpha=LEVELS[n], rng=stream(0, "test"))
    assert ours.alpha == LEVELS[n] and (ours.low, ours.verdict) == (theirs.low, theirs.verdict)


@pytest.mark.parametrize("n", [0, 6, 19, 21, 39, 60, 79, 81, 160])
def test_no_other_look_can_end_a_run(n: int) -> None:
    with pytest.raises(ValueError, match="looks are at 20, 40, 80 runs"):
        look(n, 0.0)


def test_a_look_must_see_exactly_its_runs() -> None:
    old, new = sides(40, 0.0)
    with pytest.raises(ValueError, match="a look at 20 runs got 40 old and 40 new ones, 40 shared"):
        decide_at(20, old, new, better="higher", rng=stream(0, "test"))
    with pytest.raises(ValueError, match="39 shared"):
        decide_at(40, old, {i + 1: v for i, v in new.items()}, better="higher", rng=stream(0, "test"))


def test_only_the_last_look_spends_the_budget() -> None:
    first, last = look(40, 0.05), look(80, 0.05)
    assert (first.verdict, first.note) == ("INCONCLUSIVE", None)
    assert (last.verdict, last.note) == ("INCONCLUSIVE", "budget of 80 runs spent")
    assert (look(80, 0.0).verdict, look(80, 0.1).verdict) == ("PASS", "REGRESSION")


def test_looks_follow_each_other() -> None:
    assert [next_look(n) for n in (0, 19, 20, 40, 79)] == [20, 20, 40, 80, 80]
    assert next_look(80) is None
    assert all(a < b for a, b in pairwise(LOOKS))
