"""Axes and plans: what is varied, between what, and what each point asks of the bench."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import BadInput
from scenarios.fault_set import parse_fault_arguments
from scenarios.faults import Flex, TriggerOffset
from simbench.case import Job
from simbench.stress.axes import fault_arguments, parse_axes, scenario_changes
from simbench.stress.plan import grid, jobs_of, scattered

OFFSET, JITTER = "timing.trigger_offset_ms", "timing.trigger_offset_ms.jitter_ms"


@given(low=st.floats(-500, 499), span=st.floats(1e-3, 500), count=st.integers(2, 50))
def test_a_range_has_its_ends_and_even_steps(low: float, span: float, count: int) -> None:
    high = min(low + span, 1000.0)
    (axis,) = parse_axes([f"{OFFSET}={low!r}:{high!r}:{count}"])
    assert len(axis.values) == count and axis.spread
    np.testing.assert_allclose(axis.values, np.linspace(low, high, count), rtol=1e-7, atol=1e-7)


@given(
    offset=st.floats(-500, 500).map(lambda v: float(f"{v:.9g}")),
    jitter=st.floats(0, 500).map(lambda v: float(f"{v:.9g}")),
    flex=st.floats(0, 20).map(lambda v: float(f"{v:.9g}")),
)
def test_the_arguments_of_a_point_are_read_back_as_its_values(
    offset: float, jitter: float, flex: float
) -> None:
    axes = parse_axes([f"{OFFSET}=0,1", f"{JITTER}=0,1", "motion.flex_deg=0,1", "road.width_m=40,50"])
    arguments = fault_arguments(axes, (offset, jitter, flex, 45.0))
    assert len(arguments) == 2, "one argument a fault"
    specs = {type(spec): spec for spec in parse_fault_arguments(arguments).specs}
    struck, bent = specs[TriggerOffset], specs[Flex]
    assert isinstance(struck, TriggerOffset) and isinstance(bent, Flex)
    assert (struck.offset_ms, struck.jitter_ms, bent.rms_deg) == (offset, jitter, flex)
    assert scenario_changes(axes, (offset, jitter, flex, 45.0)) == ("road.width_m=45",)


def test_words_are_values_too() -> None:
    (axis,) = parse_axes(["motion.road=A,B,E"])
    assert axis.values == ("A", "B", "E") and not axis.spread
    assert fault_arguments((axis,), ("B",)) == ("motion.road={roughness: B}",)


def test_a_grid_is_every_combination_once_and_every_seed_sees_every_point() -> None:
    plan = grid(parse_axes([f"{OFFSET}=0:100:3", "motion.flex_deg=0,0.5"]))
    assert plan.points == ((0, 0), (0, 0.5), (50, 0), (50, 0.5), (100, 0), (100, 0.5))
    template = Job(
        scenario="overtake-approach", system="car", seed=9, pipelines=("robust",), faults=("demo",)
    )
    tasks = jobs_of(plan, template, (3, 4))
    assert [(point, job.seed) for point, job in tasks] == [(p, s) for p in plan.points for s in (3, 4)]
    assert all(job.faults[0] == "demo" and len(job.faults) == 3 for _, job in tasks)


@pytest.mark.parametrize("design", ["lhs", "sobol"])
@pytest.mark.parametrize("count", [2, 7, 33])
def test_scattered_points_lie_between_the_ends_are_many_and_always_the_same(design: str, count: int) -> None:
    axes = parse_axes([f"{OFFSET}=-50:150", "motion.flex_deg=0:2"])
    plan = scattered(axes, count, design)  # type: ignore[arg-type]
    assert plan.points == scattered(axes, count, design).points  # type: ignore[arg-type]
    assert len(set(plan.points)) == count
    table = np.array(plan.points, dtype=float)
    assert (table >= [-50, 0]).all() and (table <= [150, 2]).all()
    if design == "lhs":  # one point in every slice of every axis
        slices = np.floor((table - [-50, 0]) / [200, 2] * count).astype(int)
        assert all(sorted(column) == list(range(count)) for column in slices.T)


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        (["timing.triger_offset_ms=0:1:2"], ("did you mean 'timing.trigger_offset_ms'?",)),
        ([f"{OFFSET}.jiter_ms=0:1:2"], ("did you mean 'jitter_ms'?",)),
        ([f"{OFFSET}"], ("NAME=LOW:HIGH:COUNT",)),
        ([f"{OFFSET}=5"], ("two values or more",)),
        ([f"{OFFSET}=5:5:3"], ("not below",)),
        ([f"{OFFSET}=0:1:2:3"], ("LOW:HIGH:COUNT",)),
        ([f"{OFFSET}=0:x:3"], ("no number",)),
        ([f"{OFFSET}=0:nan:3"], ("no number",)),
        ([f"{OFFSET}=0:1:1"], ("count", "2 to 1000")),
        ([f"{OFFSET}=0:5000:3"], ("offset_ms", "1000")),
        (["motion.flex_deg=-1,2"], ("rms_deg", "negative")),
        ([f"{OFFSET}=0,1", f"{OFFSET}=2,3"], ("varied twice",)),
    ],
)
def test_an_axis_that_makes_no_sense_costs_one_sentence(axes: list[str], words: tuple[str, ...]) -> None:
    with pytest.raises(BadInput) as error:
        parse_axes(axes)
    assert all(word in str(error.value) for word in words), str(error.value)
    assert "\n" not in str(error.value)


def test_a_list_has_nothing_in_between() -> None:
    with pytest.raises(BadInput, match=r"motion\.road is a list"):
        scattered(parse_axes(["motion.road=A,B"]), 4, "lhs")
