"""The verdict keeps what it promises, on fewer trials than the benchmark's 5,000."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.special import bdtrc

from scenarios.seeding import stream
from simbench.verdict.decide import judge
from tests.benchmarks.verdict import both_gates, cell_of, p_values, table
from tests.benchmarks.verdict_runs import DATA, MADE_BY, MARGIN, kinds, recorded

TRIALS = 300
KINDS = {kind.name: kind for kind in kinds()}


def beyond_chance(hits: int, promised: float) -> bool:
    """So many or more would come once in 1,000 times."""
    return hits > 0 and bool(bdtrc(hits - 1, TRIALS, promised) < 1e-3)


@pytest.mark.parametrize("name", ["normal", "zero-inflated", "zero-inflated, made"])
def test_a_loss_of_the_margin_is_rarely_called_anything(name: str) -> None:
    cell = cell_of(KINDS[name], 1.0, TRIALS)
    for rule in ("20", "40", "80", "looks"):
        assert not beyond_chance(cell.ends[rule].passed, 0.05), rule
        assert not beyond_chance(cell.ends[rule].regressed, 0.05), rule
    assert cell.ends["40"].passed + cell.ends["40"].regressed > 0, "it does decide now and then"


def test_rare_failures_pass_as_often_as_none_is_seen_at_20_runs_and_are_held_at_40() -> None:
    cell = cell_of(KINDS["rare failure"], 1.0, TRIALS)
    unseen = (recorded("coverage.smooth", "robust", "no_coast") == 0.0).mean() ** 20
    assert cell.ends["20"].passed / TRIALS == pytest.approx(unseen, abs=0.06)
    assert not beyond_chance(cell.ends["40"].passed, 0.05)


@pytest.mark.parametrize("margins", [1.0, 2.0])
def test_both_gates_together_hold_gross_failures_at_any_number_of_runs(margins: float) -> None:
    cell = cell_of(KINDS["rare failure, made"], margins, TRIALS)
    assert cell.ends["20"].passed > 0.05 * TRIALS or margins == 2.0, "the first gate alone does not"
    assert not any(beyond_chance(ends.both, 0.05) for ends in cell.ends.values())


def test_what_planning_promises_is_found() -> None:
    """SD 1.7 d: 20 runs have 80 % power, looks need fewer than 40 on average."""
    none, twice = (cell_of(KINDS["normal"], margins, TRIALS) for margins in (0.0, 2.0))
    assert none.ends["20"].passed / TRIALS > 0.75 and twice.ends["20"].regressed / TRIALS > 0.7
    assert none.ends["looks"].passed / TRIALS > 0.97 and none.ends["looks"].runs < 40


@pytest.mark.parametrize("n", [12, 20, 40])
@pytest.mark.parametrize("name", list(KINDS))
def test_many_trials_at_once_are_judged_as_one(n: int, name: str) -> None:
    d = KINDS[name].draws(stream(2, "few", name), 8, n, 0.7 * MARGIN)
    many = p_values(d, stream(0, "many"))
    for row, (passing, regression) in zip(d, many.T, strict=True):
        one = judge(dict.fromkeys(range(n), 0.0), dict(enumerate(row)), better="higher", rng=stream(0, "one"))
        assert (one.p_pass, one.p_regression) == pytest.approx((passing, regression), abs=0.05)


@pytest.mark.parametrize("name", list(KINDS))
@pytest.mark.parametrize("margins", [0.0, 1.0, 2.0])
def test_every_kind_truly_loses_what_it_says(name: str, margins: float) -> None:
    d = KINDS[name].draws(stream(3, "mean", name), 4000, 20, margins * MARGIN)
    assert d.mean() == pytest.approx(-margins * MARGIN, abs=4 * d.std() / np.sqrt(d.size))


def test_the_recorded_runs_have_the_shapes_they_stand_for() -> None:
    raw, coverage = (
        recorded("mae_m.raw", "robust", "probabilistic"),
        recorded("coverage.smooth", "robust", "no_coast"),
    )
    assert len(raw) == len(coverage) == 80
    assert abs(((raw - raw.mean()) ** 3).mean()) < 0.5 * raw.std() ** 3
    assert (coverage == 0.0).mean() == pytest.approx(0.9) and (coverage <= 0.0).all()
    assert json.loads(DATA.read_text(encoding="utf-8"))["made_by"] == MADE_BY
    assert DATA.stat().st_size < 30_000


def test_tables_have_a_row_for_each_kind_and_rule() -> None:
    cells = [cell_of(kinds()[place], margins, 20) for place in (0, -1) for margins in (1.0, 0.0, 2.0)]
    rows = table(cells)
    assert len(rows) == 1 + 2 * 5 and {len(row) for row in rows} == {6}
    assert [row[0] for row in both_gates(cells)] == ["runs", "12", "20", "40", "80", "looks"]
