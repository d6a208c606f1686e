"""Dividends, Shapley values and their sampling: laws, hand-computed rows, and the definition itself as
oracle."""

from __future__ import annotations

from itertools import combinations, islice, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from simbench.explain.dividends import causes_in, dividends, members, order, shapley, up_to, values_of
from simbench.explain.permutations import MIN_PAIRS, orders, prefixes, sampled

NUMBERS = st.floats(-10.0, 10.0, allow_subnormal=False)


@st.composite
def tables(draw: st.DrawFn, fewest: int = 0, most: int = 6) -> np.ndarray:
    k, runs = draw(st.integers(fewest, most)), draw(st.integers(1, 4))
    return draw(arrays(np.float64, (1 << k, runs), elements=NUMBERS))


def by_definition(values: np.ndarray) -> np.ndarray:
    """The alternating sum over all subsets, one by one."""
    result = np.zeros_like(values)
    for s in range(len(values)):
        for t in range(s + 1):
            if t & ~s == 0:
                result[s] += (-1) ** (order(s) - order(t)) * values[t]
    return result


def shapley_by_orders(values: np.ndarray) -> np.ndarray:
    """The mean marginal contribution over all k! orders."""
    k = causes_in(len(values))
    found = [np.zeros((k, values.shape[1]))]
    for one in permutations(range(k)):
        row = np.zeros((k, values.shape[1]))
        row[list(one)] = np.diff(values[list(prefixes(one))], axis=0)
        found.append(row)
    return np.sum(found, axis=0) / max(len(found) - 1, 1)


def test_two_causes_by_hand() -> None:
    # alone: +0.1 and +0.3; together +0.7, so 0.3 more than both; half of it goes to each
    table = dividends(np.array([[0.2], [0.3], [0.5], [0.9]]))
    assert table[:, 0] == pytest.approx([0.2, 0.1, 0.3, 0.3])
    assert shapley(table)[:, 0] == pytest.approx([0.25, 0.45])


def test_causes_that_need_each_other_have_a_pair_and_nothing_alone() -> None:
    table = dividends(np.array([[1.0], [1.0], [1.0], [4.0]]))
    assert table[:, 0].tolist() == [1.0, 0.0, 0.0, 3.0]
    assert shapley(table)[:, 0].tolist() == [1.5, 1.5]


def test_causes_of_which_one_is_enough_take_back_what_they_cost_together() -> None:
    table = dividends(np.array([[0.0], [2.0], [2.0], [2.0]]))
    assert table[:, 0].tolist() == [0.0, 2.0, 2.0, -2.0]


@given(tables())
def test_the_transform_is_the_definition_and_can_be_undone(values: np.ndarray) -> None:
    table = dividends(values)
    assert table == pytest.approx(by_definition(values), abs=1e-9)
    assert values_of(table) == pytest.approx(values, abs=1e-9)


@given(tables())
def test_dividends_and_shapley_values_add_up_to_the_total(values: np.ndarray) -> None:
    table, total = dividends(values), values[-1] - values[0]
    assert table[1:].sum(axis=0) == pytest.approx(total, abs=1e-8)
    assert shapley(table).sum(axis=0) == pytest.approx(total, abs=1e-8)


@given(tables(most=5))
def test_shapley_values_are_means_over_all_orders(values: np.ndarray) -> None:
    assert shapley(dividends(values)) == pytest.approx(shapley_by_orders(values), abs=1e-8)


@given(tables(fewest=1), st.data())
def test_a_cause_that_never_acts_has_exact_zeros(values: np.ndarray, data: st.DataObject) -> None:
    i = data.draw(st.integers(0, causes_in(len(values)) - 1))
    masks = np.arange(len(values))
    idle = values[masks & ~(1 << i)]
    table = dividends(idle)
    assert (table[masks >> i & 1 == 1] == 0.0).all()
    assert (shapley(table)[i] == 0.0).all()


@given(tables(fewest=2), st.data())
def test_causes_that_can_change_places_share_alike(values: np.ndarray, data: st.DataObject) -> None:
    k = causes_in(len(values))
    i, j = data.draw(st.permutations(range(k)))[:2]
    masks = np.arange(len(values))
    flip = (masks >> i ^ masks >> j) & 1
    swapped = masks ^ (flip << i | flip << j)
    phi = shapley(dividends(0.5 * (values + values[swapped])))
    assert phi[i] == pytest.approx(phi[j], abs=1e-9)


def test_sets_are_counted_by_size_and_named_by_their_causes() -> None:
    assert up_to(3, 2) == (0, 1, 2, 4, 3, 5, 6)
    assert [members(mask, ("a", "b", "c")) for mask in (0, 5, 7)] == [(), ("a", "c"), ("a", "b", "c")]
    assert all(
        len(up_to(6, n)) == sum(len(list(combinations(range(6), m))) for m in range(n + 1)) for n in range(7)
    )


@pytest.mark.parametrize("rows", [0, 3, 6])
def test_a_table_of_no_power_of_two_is_refused(rows: int) -> None:
    with pytest.raises(ValueError, match="2\\^k rows"):
        dividends(np.zeros((rows, 1)))


# -- sampling -----------------------------------------------------------------------------------------------


def test_every_drawn_order_is_followed_by_its_reverse() -> None:
    for forth, back in islice(orders(5, np.random.default_rng(1)), 20):
        assert back == forth[::-1] and sorted(forth) == list(range(5))
    assert prefixes((2, 0, 1)) == (0, 4, 5, 7)


@given(tables(fewest=2, most=2))
def test_one_pair_of_orders_is_all_there_is_of_two_causes(values: np.ndarray) -> None:
    pairs = list(islice(orders(2, np.random.default_rng(0)), 1))
    found = sampled(pairs, lambda masks: values[list(masks)])
    assert found.phi == pytest.approx(shapley(dividends(values)), abs=1e-9)


def test_sampling_converges_to_the_exact_values_within_its_own_error() -> None:
    values = np.random.default_rng(7).normal(size=(1 << 7, 3)).cumsum(axis=0)
    exact = shapley(dividends(values)).mean(axis=1)
    drawn = orders(7, np.random.default_rng(8))
    few = sampled(list(islice(drawn, 20)), lambda masks: values[list(masks)])
    many = sampled(list(islice(drawn, 2000)), lambda masks: values[list(masks)])
    for found in (few, many):
        assert (np.abs(found.phi.mean(axis=1) - exact) < 4.5 * found.se).all()
        assert found.phi.sum(axis=0) == pytest.approx(values[-1] - values[0])
    assert (many.se < 0.2 * few.se).all()


def test_a_reversed_order_cancels_every_pair_of_causes() -> None:
    """Between two causes one order has the one first, its reverse the other: pairs cost no sampling error."""
    rng = np.random.default_rng(3)
    table = np.zeros((1 << 7, 1))
    for mask in up_to(7, 2):
        table[mask] = rng.normal()
    values = values_of(table)
    found = sampled(list(islice(orders(7, rng), MIN_PAIRS)), lambda masks: values[list(masks)])
    assert found.phi == pytest.approx(shapley(table), abs=1e-9) and found.is_enough(1.0)


def test_the_error_must_be_small_against_the_total_and_known_from_enough_orders() -> None:
    values = np.random.default_rng(5).normal(size=(1 << 4, 2))
    drawn = list(islice(orders(4, np.random.default_rng(6)), 40))
    found = sampled(drawn, lambda masks: values[list(masks)])
    largest = float(found.se.max())
    assert found.is_enough(51.0 * largest) and found.is_enough(-51.0 * largest)
    assert not found.is_enough(49.0 * largest)
    assert not sampled(drawn[: MIN_PAIRS - 1], lambda masks: values[list(masks)]).is_enough(1e9)
