"""What is asked for: the same runs every time, with levels within their bounds, and faults that there are."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import BadInput
from scenarios.fault_set import parse_fault_arguments
from simbench.campaign.ledger import Ledger
from simbench.plugins import load_pipeline
from simbench.reproduce.campaign import missing, named
from simbench.reproduce.cells import CELLS
from simbench.reproduce.collect import Board, boards_read, key_of
from simbench.reproduce.levels import GROUPS, LATE_CHANCE, LEVELS, at_bounds, faults_at, prior
from simbench.reproduce.plan import (
    FULL,
    MENDED,
    QUICK,
    Size,
    asks,
    board_asks,
    drives,
    fit_points,
    strip_levels,
)
from simbench.reproduce.variants import NAMES, reference_of, variant_of

WHOLE = asks(FULL)
RIGS = pytest.mark.parametrize("system", list(LEVELS))


def test_the_same_runs_are_asked_for_every_time_and_no_two_are_alike() -> None:
    for size in (QUICK, FULL):
        assert (board_asks(size), asks(size)) == (board_asks(size), asks(size))
        assert len({(ask.part, ask.cell, ask.point, ask.job.seed) for ask in asks(size)}) == len(asks(size))


def test_a_drive_that_two_parts_ask_for_is_counted_once() -> None:
    assert drives(WHOLE) == len({key_of(ask) for ask in WHOLE}) < len(WHOLE)


def test_quick_runs_are_runs_of_the_whole() -> None:
    """Else a quick reproduction would be no start of a full one."""
    assert set(asks(QUICK)) <= set(WHOLE) and set(board_asks(QUICK)) <= set(board_asks(FULL))


def test_every_fault_that_is_asked_for_is_there() -> None:
    texts = {ask.job.faults for ask in WHOLE}
    assert len(texts) > 300
    for faults in texts:
        parse_fault_arguments(faults, "car")


def test_the_paper_s_cells_have_at_least_twenty_seeds_under_every_condition() -> None:
    for cell in CELLS:
        for condition in ("none", "bounds", "reached"):
            mine = [
                a for a in WHOLE if a.part == "tables" and a.cell == cell.name and a.point == (condition,)
            ]
            assert len({ask.job.seed for ask in mine}) >= 20


def test_each_thing_is_mended_in_every_cell_with_as_many_seeds_as_a_sentence_needs() -> None:
    for cell in CELLS:
        runs = [a for a in WHOLE if a.part == "groups" and a.cell == cell.name and a.point[0] in MENDED]
        by_set = {mask: {a.job.seed for a in runs if a.point == (mask,)} for mask in MENDED}
        assert len(by_set) == 1 + len(GROUPS)
        assert all(len(seeds) == FULL.groups >= 6 for seeds in by_set.values())


@RIGS
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_the_prior_keeps_every_level_between_zero_and_its_bound(system: str, share: float) -> None:
    levels = LEVELS[system]
    values = prior(levels, np.full((1, len(levels)), share))[0]
    for level, value in zip(levels, values, strict=True):
        if level.chance is None:
            assert value == pytest.approx(share * level.bound)
        else:
            assert value == (level.bound if share >= 1.0 - level.chance else 0.0)


@RIGS
def test_the_design_fills_the_prior_evenly(system: str) -> None:
    points, levels = fit_points(system, 128), LEVELS[system]
    for column, level in zip(points.T, levels, strict=True):
        expected = 0.5 if level.chance is None else LATE_CHANCE
        assert column.mean() / level.bound == pytest.approx(expected, abs=0.02)
    assert np.array_equal(points[:16], fit_points(system, 16))


@RIGS
def test_a_cause_at_zero_is_not_mentioned_and_all_groups_are_all_causes(system: str) -> None:
    levels = LEVELS[system]
    assert faults_at(levels, [0.0] * len(levels)) == ("none",)
    assert len(faults_at(levels, at_bounds(levels))) == 1 + len(levels)
    by_group = [faults_at(levels, at_bounds(levels, [group]))[1:] for group in GROUPS]
    assert all(by_group)
    assert sorted(f for one in by_group for f in one) == sorted(faults_at(levels, at_bounds(levels))[1:])


@RIGS
def test_a_strip_goes_beyond_physics_where_there_is_something_beyond(system: str) -> None:
    for level in LEVELS[system]:
        values = strip_levels(level.bound, level.fault)
        assert list(values) == sorted(values) and level.bound in values
        if level.name not in ("box lag", "spin phase"):
            assert values[-1] > level.bound


@pytest.mark.parametrize("name", NAMES)
def test_every_variant_is_a_pipeline_that_differs_from_the_method(name: str) -> None:
    pipeline = load_pipeline(reference_of(name))()
    method = load_pipeline("probabilistic")()
    assert variant_of(reference_of(name)).what
    assert pipeline.config != method.config  # type: ignore[attr-defined]


def test_a_name_that_is_no_variant_is_refused() -> None:
    with pytest.raises(BadInput):
        variant_of(reference_of("nothing"))
    with pytest.raises(TypeError, match="does not say"):
        variant_of("robust")


def test_boards_come_back_from_their_row() -> None:
    boards = [Board(system="car", camera="a", seed=1, tpr=None, tpr_true=0.5)]
    rows = [{"system": "car", "camera": "a", "seed": 1, "tpr": None, "tpr_true": 0.5}]
    assert boards_read(json.dumps(rows)) == tuple(boards)


def test_what_is_missing_is_what_the_ledger_does_not_hold(tmp_path: object) -> None:
    from pathlib import Path

    from simbench.campaign.ledger import Done

    small = Size(
        name="quick",
        seeds=1,
        boards=1,
        variants=0,
        scenes=0,
        groups=0,
        map=0,
        strips=0,
        claims=0,
        fit_points=0,
    )
    with Ledger(Path(str(tmp_path)), {"what": "shen2023"}) as ledger:
        before = missing(small, ledger)
        assert len(before) == 12 + 2
        ledger.add(Done(key=key_of(before[3]), value="[]"), 3)
        after = missing(small, ledger)
        assert [named(one) for one in after] == [named(one) for one in before if one != before[3]]
