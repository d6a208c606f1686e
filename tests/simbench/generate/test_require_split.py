"""What is required, in which part a drive is, and what a seed may vary: words, laws, bad input."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.changes import varied
from scenarios.errors import BadInput
from scenarios.load import load_scenario
from simbench.generate.require import parse_requirement
from simbench.generate.split import NAMES, parse_shares, part_of


@given(st.sampled_from(["points", "nearest_m"]), st.sampled_from([">=", "<="]), st.integers(-99, 99))
def test_a_bound_reads_back_as_it_was_written(name: str, sign: str, value: int) -> None:
    assert str(parse_requirement(f"{name}{sign}{value}")) == f"{name}{sign}{value}"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("visible>=0.5", "unknown measure 'visible'"),
        ("points=3", "is no bound"),
        ("points>=many", "'many' is no number"),
        ("points>=nan", "'nan' is no number"),
        ("", "is no bound"),
    ],
)
def test_what_is_no_bound_is_told(text: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        parse_requirement(text)


SHARES = st.tuples(st.integers(0, 100), st.integers(0, 100)).map(sorted)


@given(SHARES, st.integers(0, 10**6))
def test_a_part_depends_on_name_and_seed_alone_and_empty_parts_stay_empty(cuts: list[int], seed: int) -> None:
    shares = (float(cuts[0]), float(cuts[1] - cuts[0]), 100.0 - cuts[1])
    part = part_of("a", seed, shares)
    assert part == part_of("a", seed, shares)
    assert shares[NAMES.index(part)] > 0.0
    assert part_of("a", seed, None) == ""


@given(st.integers(0, 10**6), st.integers(0, 49), st.integers(51, 100))
def test_a_drive_leaves_train_only_when_train_becomes_smaller(seed: int, less: int, more: int) -> None:
    if part_of("a", seed, (float(less), 100.0 - less, 0.0)) == "train":
        assert part_of("a", seed, (float(more), 100.0 - more, 0.0)) == "train"


def test_shares_are_hit_as_well_as_chance_hits_them() -> None:
    counts = Counter(part_of("overtake-approach", seed, (80.0, 10.0, 10.0)) for seed in range(4000))
    for name, expected in zip(NAMES, (3200, 400, 400), strict=True):
        assert abs(counts[name] - expected) < 4 * (expected * (1 - expected / 4000)) ** 0.5


@pytest.mark.parametrize("text", ["80,20", "80,10,20", "-10,100,10", "a,b,c", "", "nan,50,50", "100,0,0,0"])
def test_what_is_no_three_shares_is_told(text: str) -> None:
    with pytest.raises(BadInput, match="is not three shares"):
        parse_shares(text)


@pytest.mark.parametrize(
    ("text", "change"),
    [
        ("road.width_m=30..60", "road.width_m={uniform: [30, 60]}"),
        ("a.b=-2.5..-1e1", "a.b={uniform: [-2.5, -1e1]}"),
        ("a=red|blue", "a={choice: [red, blue]}"),
        ("a={normal: {mean: 1, sd: 2}}", "a={normal: {mean: 1, sd: 2}}"),
    ],
)
def test_what_a_seed_draws_becomes_a_distribution(text: str, change: str) -> None:
    assert varied(text) == change


@pytest.mark.parametrize("text", ["road.width_m", "=1..2", "a=3", "a="])
def test_what_leaves_nothing_to_the_seed_is_told(text: str) -> None:
    with pytest.raises(BadInput):
        varied(text)


def test_seeds_draw_different_values_within_the_bounds() -> None:
    path = "systems.car.actors.rider.path.speed_mps"
    family = load_scenario("overtake-approach", (varied(f"{path}=5..8"),))
    speeds = [family.resolve(seed).system("car").actors["rider"].path.speed_mps for seed in range(20)]
    assert all(5.0 <= v <= 8.0 for v in speeds) and len(set(speeds)) == 20  # type: ignore[operator]
