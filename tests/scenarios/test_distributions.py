"""Distributions: draws stay between the ends and follow the law; malformed ones are refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from scenarios.distributions import Choice, Normal, Uniform, corners, find_distributions, substitute
from scenarios.errors import BadInput
from scenarios.seeding import stream
from scenarios.yaml_source import parse_yaml

FINITE = st.floats(-1e6, 1e6)


@given(a=FINITE, b=FINITE, seed=st.integers(0, 10**6))
def test_a_uniform_draw_lies_between_its_ends(a: float, b: float, seed: int) -> None:
    low, high = sorted((a, b))
    assert low <= Uniform(low=low, high=high).draw(stream(seed, "x")) <= high


@given(mean=FINITE, sd=st.floats(0, 1e4), seed=st.integers(0, 10**6))
def test_a_normal_draw_lies_within_three_standard_deviations(mean: float, sd: float, seed: int) -> None:
    normal = Normal(mean=mean, sd=sd)
    low, high = normal.ends()
    assert (low, high) == (mean - 3.0 * sd, mean + 3.0 * sd)
    assert low <= normal.draw(stream(seed, "x")) <= high


@given(values=st.lists(FINITE, min_size=1, max_size=5), seed=st.integers(0, 10**6))
def test_a_choice_is_one_of_its_values(values: list[float], seed: int) -> None:
    assert Choice(values=tuple(values)).draw(stream(seed, "x")) in values


def _farthest(draws: list[float], law: Callable[[np.ndarray], np.ndarray]) -> float:
    """Kolmogorov and Smirnov's distance between the draws and a distribution function."""
    x = np.sort(draws)
    steps = np.arange(len(x) + 1) / len(x)
    return float(max(np.abs(law(x) - steps[1:]).max(), np.abs(law(x) - steps[:-1]).max()))


def test_draws_follow_the_stated_law() -> None:
    rng = stream(5, "law")
    n, limit = 4000, 1.95 / np.sqrt(4000)  # exceeded with probability 0.001
    normal = [Normal(mean=2.0, sd=0.5).draw(rng) for _ in range(n)]
    uniform = [Uniform(low=-1.0, high=3.0).draw(rng) for _ in range(n)]
    cut = ndtr(-3.0)
    assert _farthest(normal, lambda x: (ndtr((x - 2.0) / 0.5) - cut) / (1.0 - 2.0 * cut)) < limit
    assert _farthest(uniform, lambda x: (x + 1.0) / 4.0) < limit
    counts = np.unique([Choice(values=(1, 2, 3)).draw(rng) for _ in range(n)], return_counts=True)[1]
    assert np.abs(counts - n / 3).max() < 4.0 * np.sqrt(n * 2 / 9)


def test_all_ends_and_all_choices_are_reached_by_the_corners() -> None:
    found = {
        ("a",): Uniform(low=1.0, high=2.0),
        ("b",): Choice(values=("x", "y", "z")),
        ("c",): Normal(mean=0.0, sd=1.0),
    }
    assert corners(found) == [
        {("a",): 1.0, ("b",): "x", ("c",): -3.0},
        {("a",): 2.0, ("b",): "y", ("c",): 3.0},
        {("a",): 2.0, ("b",): "z", ("c",): 3.0},
    ]
    assert corners({}) == [{}]


def test_distributions_are_found_by_path_and_replaced_in_a_copy() -> None:
    document = parse_yaml("a: {uniform: [1, 2]}\nb:\n  - 3\n  - {c: {choice: [x, y]}}\n", "f.yaml")
    found = find_distributions(document.data, document.where)
    assert found == {("a",): Uniform(low=1.0, high=2.0), ("b", 1, "c"): Choice(values=("x", "y"))}
    tree = substitute(document.data, {("a",): 1.5, ("b", 1, "c"): "y", ("b", 1, "new"): 4})
    assert tree == {"a": 1.5, "b": [3, {"c": "y", "new": 4}]}
    assert document.data["b"][1] == {"c": {"choice": ["x", "y"]}}


@pytest.mark.parametrize(
    ("text", "field", "says"),
    [
        ("{uniform: [2, 1]}", "a.uniform", "low 2 is above high 1"),
        ("{uniform: [1]}", "a.uniform", "two numbers"),
        ("{uniform: [1, x]}", "a.uniform", "two numbers"),
        ("{uniform: [1, true]}", "a.uniform", "two numbers"),
        ("{uniform: {low: 1, high: 2}}", "a.uniform", "two numbers"),
        ("{uniform: [1, 2], choice: [3]}", "a.choice", "one key only"),
        ("{uniform: [1, 2], speed: 3}", "a.speed", "one key only"),
        ("{normal: {mean: 1, sd: -1}}", "a.normal.sd", "must not be negative"),
        ("{normal: {mean: 1}}", "a.normal", "mean: number, sd: number"),
        ("{normal: {mean: 1, sd: 1, cut: 2}}", "a.normal", "mean: number, sd: number"),
        ("{normal: [1, 2]}", "a.normal", "mean: number, sd: number"),
        ("{choice: []}", "a.choice", "empty"),
        ("{choice: 3}", "a.choice", "a list of values"),
        ("{choice: [1, x]}", "a.choice", "numbers only or words only"),
        ("{choice: [[1], [2]]}", "a.choice", "numbers only or words only"),
    ],
)
def test_a_malformed_distribution_is_refused_with_its_place(text: str, field: str, says: str) -> None:
    document = parse_yaml(f"\na: {text}\n", "f.yaml")
    with pytest.raises(BadInput) as caught:
        find_distributions(document.data, document.where)
    assert (caught.value.file, caught.value.line, caught.value.field) == ("f.yaml", 2, field)
    assert says in str(caught.value)
