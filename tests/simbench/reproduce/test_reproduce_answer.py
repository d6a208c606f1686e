"""The whole answer from runs that no simulation made, whose numbers are known; and what is written of it."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

from scenarios.errors import BadInput
from simbench.campaign.local import Here
from simbench.explain.attribution import attribute
from simbench.reproduce.answer import Answer, answer, as_json, read_answer
from simbench.reproduce.campaign import Found
from simbench.reproduce.cells import BASELINE, CELLS, GROUND, METHOD, OURS
from simbench.reproduce.files import as_csv, as_latex
from simbench.reproduce.findings import as_markdown, findings
from simbench.reproduce.fit.study import fit_rig
from simbench.reproduce.levels import GROUPS
from simbench.reproduce.sentences import together
from simbench.reproduce.sheets import sheets
from simbench.reproduce.sheets_fit import reach_words
from tests.simbench.reproduce.made_up import CLEAN, LOSS, SMALL, made_up

FEWER = (
    mock.patch("simbench.reproduce.fit.study.DRAWS", 2000),
    mock.patch("simbench.reproduce.fit.study.CHECKED_DRAWS", 500),
)


@pytest.fixture(scope="module")
def found() -> Found:
    return made_up()


@pytest.fixture(scope="module")
def told(found: Found) -> Answer:
    with FEWER[0], FEWER[1]:
        return answer(found, Here())


def without_fits(found: Found) -> Found:
    return replace(found, size=replace(found.size, fit_points=0))


def test_tables_hold_the_means_that_the_runs_were_made_with(told: Answer) -> None:
    for table, share in zip(told.conditions, (0.0, 1.0, 0.8), strict=True):
        for cell in table.cells:
            for name in (BASELINE, GROUND, METHOD, OURS):
                assert cell.pipelines[name].mean == pytest.approx(CLEAN[name] - LOSS[name] * share, abs=0.05)
            gain, less_lost = cell.raw.gain.difference.mean, LOSS[BASELINE] - LOSS[METHOD]
            expected = CLEAN[METHOD] - CLEAN[BASELINE] + less_lost * share
            assert gain == pytest.approx(expected, abs=0.05)
            assert cell.raw.runs == SMALL.seeds


def test_groups_that_add_up_have_equal_shares_and_no_interaction(told: Answer) -> None:
    assert list(told.attributions) == ["car S1", "wearable S1"]
    for found in told.attributions.values():
        one = next(a for a in found if a.pipeline == BASELINE and a.metric == "tpr")
        assert one.total.summary.mean == pytest.approx(LOSS[BASELINE], abs=0.05)
        for effect in one.shapley:
            assert effect.summary.mean == pytest.approx(LOSS[BASELINE] / len(GROUPS), abs=0.05)


def test_a_set_of_causes_is_told_only_where_it_counts_among_all_and_else_why_not(told: Answer) -> None:
    shown = [
        one
        for rows in told.attributions.values()
        for one in rows
        if (one.pipeline, one.metric) in ((BASELINE, "tpr"), (METHOD, "tpr"), (METHOD, "mae_m.smooth"))
    ]
    lines = list(together(told.attributions))
    assert len(lines) == len(shown) == 6
    for one, line in zip(shown, lines, strict=True):
        assert all(" and ".join(effect.causes) in line for effect in one.named)
        assert (one.why in line) if not one.named else ("beyond chance, all sets at once" in line)


def test_a_cause_that_costs_the_same_in_every_run_is_named_with_its_interval() -> None:
    names, seeds = ("clocks", "boxes"), list(range(10))
    drive = np.random.default_rng(0).normal(0.3, 0.02, 10)
    both = drive + 0.1 + np.random.default_rng(1).normal(0.0, 0.002, 10)
    table = np.array([drive, drive + 0.1 + np.random.default_rng(2).normal(0.0, 0.002, 10), drive, both])
    line = next(together({"car S1": [attribute(table, names, seeds, pipeline=BASELINE, metric="tpr")]}))
    assert re.search(r"everything at its bound \+(9\.\d|10\.\d) \[", line)
    assert re.search(r"all sets at once: clocks \+(9\.\d|10\.\d) \[\+9\.\d, \+10\.\d\] \(n = 10\)", line)


def test_mending_a_group_gives_back_its_share_and_the_algorithm_the_difference(told: Answer) -> None:
    assert {one.cell for one in told.mended} == {cell.name for cell in CELLS}
    for one in told.mended:
        gained = one.tpr.difference.mean
        assert gained is not None
        if one.what == "algorithm":
            assert gained == pytest.approx(CLEAN[OURS] - LOSS[OURS] - CLEAN[METHOD] + LOSS[METHOD], abs=0.05)
        else:
            assert gained == pytest.approx(LOSS[METHOD] / len(GROUPS), abs=0.05)


def test_a_cell_above_what_any_level_gives_is_far_out_and_a_conflict(told: Answer) -> None:
    """Without errors the raw box has 60 % here; the paper's car S2 has 68 %."""
    fit = next(f for f in told.fits if f.system == "car" and f.baseline == BASELINE)
    first, second = fit.reach
    assert first.reached and first.tail_p > 0.1
    assert second.highest < 0.66 and second.tail_p < 0.02
    assert fit.verdict == "conflict" and fit.joint_p < 0.05


def test_levels_that_reach_both_cells_are_no_conflict(told: Answer) -> None:
    fit = next(f for f in told.fits if f.system == "wearable" and f.baseline == GROUND)
    assert all(one.reached for one in fit.reach) and fit.verdict == "fits" and fit.share > 0.0


def test_the_same_runs_give_the_same_bytes(found: Found, told: Answer) -> None:
    again = answer(without_fits(found), Here())
    assert as_json(again) == as_json(replace(told, size=again.size, fits=(), slopes=()))
    with FEWER[0], FEWER[1]:
        assert fit_rig(found, "car", BASELINE) == told.fits[0]


def test_a_run_that_failed_is_in_no_number_and_is_told(found: Found) -> None:
    some = replace(without_fits(found), failures=("tables, car S1, none, seed 3: died",))
    text = as_markdown(answer(some, Here()), "x")
    assert text.endswith("## Runs that failed\n\n* tables, car S1, none, seed 3: died\n")


def test_every_table_is_whole_as_csv_and_as_latex(told: Answer) -> None:
    found = sheets(told)
    assert len({sheet.name for sheet in found}) == len(found) >= 20
    for sheet in found:
        assert sheet.rows and all(len(row) == len(sheet.columns) for row in sheet.rows)
        assert [tuple(row) for row in csv.reader(io.StringIO(as_csv(sheet)))] == [sheet.columns, *sheet.rows]
        body = as_latex(sheet)
        for line in body.splitlines():
            if line.endswith(r"\\") and not line.startswith(r"\\"):
                assert len(re.findall(r"(?<!\\)&", line)) == len(sheet.columns) - 1
            assert not re.search(r"(?<!\\)[%#_$]", line.replace(r"$-$", "").replace(f"tab:{sheet.name}", ""))
        assert body.count(r"\begin") == body.count(r"\end")


def test_findings_answer_every_question_with_numbers(told: Answer) -> None:
    for one in findings(told):
        assert one.says, one.question
        for line in one.says:
            assert re.search(r"\d", line), line
            assert "None" not in line and "nan" not in line, line


def test_shares_under_errors_say_under_which(told: Answer) -> None:
    asked = {one.question: one.says for one in findings(told)}
    reached = next(table for table in told.conditions if table.condition == "reached")
    for question in ("Do the tables agree?", "Does the method do what it was made for?"):
        assert reached.words in asked[question][0]
    for line in asked["Does the method help when nothing is wrong?"]:
        assert "no error injected" in line


def test_a_stored_result_is_read_as_it_was(told: Answer) -> None:
    again = read_answer(as_json(told), "result.json")
    assert as_json(again) == as_json(told)
    assert [one.says for one in findings(again)] == [one.says for one in findings(told)]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": "simbench-reproduction/1"}', "[" * 100_000])
def test_what_is_no_stored_result_is_refused_in_a_sentence(text: str) -> None:
    with pytest.raises(BadInput, match=r"result\.json.* is (no result|malformed)"):
        read_answer(text, "result.json")


def test_the_stored_result_holds_finite_numbers_only(told: Answer) -> None:
    data = json.loads(as_json(told), parse_constant=pytest.fail)
    assert data["schema"] == "simbench-reproduction/1" and data["runs"] == told.runs


def test_a_cell_is_said_to_be_reached_by_a_level_or_by_chance_or_not_or_not_known(told: Answer) -> None:
    one = replace(told.fits[0].reach[0], lowest=0.2, highest=0.4)
    assert reach_words(replace(one, observed=0.3, reached=True)) == "some level gives it"
    said = [
        reach_words(replace(one, observed=0.5, reached=reached, excluded=excluded))
        for reached, excluded in ((True, False), (False, True), (False, False))
    ]
    assert said == [
        "no level gives it; the nearest is 10.0 points off, which chance and discrepancy allow",
        "no level gives it; the nearest is 10.0 points off",
        "not known: the nearest is 10.0 points off and the emulator is in doubt",
    ]
