"""What a suite's gates answer, from sides made by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from scenarios.errors import BadInput
from simbench.suite.gate import Answer, Gate
from simbench.suite.judge import Asked, answer
from simbench.suite.side import Side
from tests.simbench.suite.sides import GROUP, ran, runs, side

SPREAD = np.random.Generator(np.random.PCG64(5)).normal(0.0, 0.01, 20)
OLD = [0.9 + 0.3 * s for s in SPREAD.tolist()]


def moved(by: float, values: Sequence[float] = OLD) -> list[float]:
    """The same runs, each a little otherwise, and all of them by `by`."""
    return [v + by + s for v, s in zip(values, SPREAD[::-1].tolist(), strict=True)]


def gate(found: Answer, kind: str, metric: str = "") -> Gate:
    (one,) = [g for g in found.gates if g.kind == kind and g.metric == metric]
    return one


def of_precision(new: Side, old: Side) -> Gate:
    return gate(answer(new, old), "baseline", "precision")


@pytest.mark.parametrize(
    ("by", "outcome", "code"),
    [(0.0, "PASS", 0), (0.1, "PASS", 0), (-0.1, "REGRESSION", 1), (-0.05, "INCONCLUSIVE", 4)],
)
def test_a_loss_beyond_the_margin_is_a_regression_and_at_the_margin_undecided(
    by: float, outcome: str, code: int
) -> None:
    found = answer(side(moved(by)), side(OLD))
    assert (found.outcome, found.exit_code) == (outcome, code)
    assert of_precision(side(moved(by)), side(OLD)).outcome == outcome


def test_the_same_outputs_pass_as_identical() -> None:
    found = of_precision(side(OLD), side(OLD))
    assert (found.outcome, found.note) == ("PASS", "identical")


def test_identical_outputs_with_two_runs_pass_where_other_two_runs_are_an_illustration() -> None:
    assert answer(side([0.9, 0.8]), side([0.9, 0.8])).outcome == "PASS"
    other = answer(side([0.9, 0.8]), side([0.91, 0.8]))
    assert (other.outcome, other.exit_code) == ("INCONCLUSIVE", 4)
    assert "illustration" in gate(other, "baseline", "precision").note


def test_twenty_scenarios_that_differ_in_nothing_else_are_judged_as_a_sample() -> None:
    def many(scenarios: int, by: float, worst: int | None = None) -> Side:
        groups = {}
        for i in range(scenarios):
            change = by - 0.3 * (i == worst) + 0.01 * (i % 3 - 1)
            groups[f"clean/s{i}/car/none/robust"] = runs([0.8 + 0.01 * k + change for k in range(3)])
        return side({**groups, "other/s0/car/none/robust": runs(OLD if by == 0.0 else moved(0.0))})

    def judged(new: Side, old: Side) -> dict[str, Gate]:
        return {g.group: g for g in answer(new, old).gates if g.kind == "baseline"}

    few = judged(many(19, 0.001), many(19, 0.0))  # each scenario by itself, with 3 runs
    assert len(few) == 20 and [g.outcome for g in few.values()].count("INCONCLUSIVE") == 19
    found = judged(many(20, 0.001), many(20, 0.0))
    assert set(found) == {"clean/20 scenarios/car/none/robust", "other/s0/car/none/robust"}
    assert {g.outcome for g in found.values()} == {"PASS"}
    assert found["clean/20 scenarios/car/none/robust"].n == 60
    assert judged(many(20, -0.1), many(20, 0.0))["clean/20 scenarios/car/none/robust"].outcome == "REGRESSION"
    spoiled = judged(many(20, 0.001, worst=7), many(20, 0.0))["clean/20 scenarios/car/none/robust"]
    assert spoiled.worst_group == "clean/s7/car/none/robust" and spoiled.worst in (0, 1, 2)
    assert any("sample" in note for note in answer(many(20, 0.001), many(20, 0.0)).notes)


def test_a_run_that_lost_its_value_is_an_error_and_never_left_out() -> None:
    found = answer(side([*OLD[:-1], None]), side(OLD))
    assert (found.outcome, found.exit_code) == ("ERROR", 1)
    assert "1 run (19) lost the value" in gate(found, "baseline", "precision").note


def test_nothing_asked_is_inconclusive_and_says_so() -> None:
    found = answer(side({GROUP: runs([0.9] * 6)}))
    assert (found.outcome, found.exit_code) == ("INCONCLUSIVE", 4)
    assert "nothing was asked" in found.sentence


def test_a_crash_fails_whatever_the_other_runs_say() -> None:
    crashed = ran(None, status="pipeline_error", gross=None, outputs=None, why="ValueError: boom")
    found = answer(side({GROUP: runs([0.9] * 6 + [crashed], limits={"precision": ">=0.5"})}))
    assert (found.outcome, found.exit_code) == ("ERROR", 1)
    assert (
        "1 of 7 runs did not end well; seed 6: pipeline_error, ValueError: boom" in gate(found, "runs").note
    )
    assert gate(found, "limit", "precision").outcome == "ERROR"


@pytest.mark.parametrize("status", ["bench_error", "receipt_mismatch"])
def test_what_the_bench_did_wrong_is_exit_3(status: str) -> None:
    bad = ran(None, status=status, gross=None, outputs=None, why="x")
    assert answer(side({GROUP: runs([0.9] * 6 + [bad], limits={"precision": ">=0.5"})})).exit_code == 3


def test_a_canary_that_passed_is_exit_3() -> None:
    good = side({GROUP: runs([0.9] * 6, limits={"precision": ">=0.5"})})
    assert answer(good).exit_code == 0
    found = answer(good, canary="the canary passed")
    assert (found.outcome, found.exit_code) == ("ERROR", 3)


@pytest.mark.parametrize(("limit", "outcome"), [(">=0.9", "PASS"), (">=0.91", "FAIL")])
def test_a_limit_is_about_the_mean_of_the_runs(limit: str, outcome: str) -> None:
    found = answer(side({GROUP: runs([0.8, 1.0] * 3, limits={"precision": limit})}))
    one = gate(found, "limit", "precision")
    assert (one.outcome, one.new, one.n) == (outcome, pytest.approx(0.9), 6)
    assert one.threshold == f"≥ {limit[2:]}"
    assert one.worst == 0
    assert found.exit_code == (0 if outcome == "PASS" else 1)


def test_a_limit_without_a_single_value_is_an_error() -> None:
    one = gate(answer(side({GROUP: runs([None] * 6, limits={"precision": ">=0.5"})})), "limit", "precision")
    assert one.outcome == "ERROR"
    assert "6 of 6 runs have no value" in one.note


def test_a_changed_bench_is_an_error_that_names_what_changed_unless_it_is_allowed() -> None:
    old, new = side(OLD), side(OLD, bench={"simbench": "2", "numpy": "2.0"})
    found = answer(new, old)
    assert (found.outcome, found.exit_code) == ("ERROR", 3)
    assert found.problems == (
        "the bench changed since the baseline: simbench 1 → 2; save a new baseline, or compare all the same "
        "with --allow-changed",
    )
    allowed = answer(new, old, Asked(changed=True))
    assert allowed.outcome == "PASS"
    assert allowed.notes[0] == "Compared all the same: the bench changed since the baseline: simbench 1 → 2."


def test_a_changed_scenario_or_metric_is_an_error_too() -> None:
    old = side({GROUP: runs([ran(v, outputs=str(v)) for v in OLD])})
    other = side({GROUP: runs([ran(v, outputs=str(v), scenario="t") for v in OLD])})
    assert "what happens in the runs changed" in answer(other, old).problems[0]
    assert f"{GROUP} (20 runs, e.g. seed 0)" in answer(other, old).problems[0]
    defined = side(OLD, metrics={"precision": "q"})
    assert "precision p → q" in answer(defined, side(OLD)).problems[0]


def test_a_group_that_one_side_lacks_is_an_error() -> None:
    two = side({GROUP: runs(OLD), "b/x/car/none/robust": runs(OLD)})
    assert answer(two, side(OLD)).exit_code == 3
    assert answer(side(OLD), two).exit_code == 3
    assert answer(side(OLD, whole=False), two).outcome == "PASS"
    assert answer(side(OLD, whole=False), two).notes[-1] == "1 groups of the baseline were not run."


def test_a_metric_that_the_baseline_has_not_is_an_error() -> None:
    new = side({GROUP: runs(OLD, margins={"precision": 0.05, "recall": 0.05})})
    found = answer(new, side(OLD))
    assert gate(found, "baseline", "recall").note == "the baseline has no values of it"
    assert found.exit_code == 3


def test_a_baseline_of_another_suite_is_bad_input() -> None:
    with pytest.raises(BadInput, match="the baseline is of the suite 'other', the run of 'gate'"):
        answer(side(OLD), side(OLD, suite="other"))


def test_new_rare_failures_are_a_regression_though_the_mean_holds() -> None:
    old = side({GROUP: runs([ran(0.9, outputs=f"o{i}") for i in range(20)])})
    new = side({GROUP: runs([ran(0.9, outputs=f"n{i}", gross=i < 5) for i in range(20)])})
    found = answer(new, old)
    assert gate(found, "baseline", "precision").outcome == "PASS"
    rare = gate(found, "rare", "gross failures")
    assert (rare.outcome, rare.old, rare.new, rare.worst) == ("REGRESSION", 0.0, 0.25, 0)
    assert found.exit_code == 1


def test_no_failure_in_twenty_runs_shows_a_share_of_0_139_and_no_less() -> None:
    def with_limit(share: float) -> Gate:
        group = runs([ran(0.9, outputs=f"o{i}") for i in range(20)], failed_runs=share)
        return gate(answer(side({GROUP: group})), "rare", "gross failures")

    assert with_limit(0.14).outcome == "PASS"
    assert with_limit(0.13).outcome == "INCONCLUSIVE"
    assert with_limit(0.14).high == pytest.approx(1.0 - 0.05 ** (1 / 20))  # Clopper-Pearson of 0 of 20


def test_one_regression_among_many_groups_must_survive_holm() -> None:
    loss = -0.05 - 2.2 * float(np.std(SPREAD[::-1] + 0.3 * SPREAD, ddof=1)) / np.sqrt(20)  # p of 0.02 alone
    groups = {f"g{i}/x/car/none/robust": runs(moved(0.0)) for i in range(30)}
    old = side({name: runs(OLD) for name in groups})
    alone = answer(side({"g0/x/car/none/robust": runs(moved(loss))}, whole=False), old)
    among = answer(side({**groups, "g0/x/car/none/robust": runs(moved(loss))}), old)
    assert alone.outcome == "REGRESSION"
    assert among.outcome == "INCONCLUSIVE"
    assert "Holm" in among.gates[0].note


def test_worst_comes_first() -> None:
    crashed = ran(None, status="timeout", gross=None, outputs=None, why="slow")
    groups = {
        "a/x/car/none/robust": runs([0.9] * 6, limits={"precision": ">=0.95"}),
        "b/x/car/none/robust": runs([0.9] * 6, limits={"precision": ">=0.99"}),
        "c/x/car/none/robust": runs([crashed]),
        "d/x/car/none/robust": runs([0.9] * 6, limits={"precision": ">=0.5"}),
    }
    order = [(g.outcome, g.group[0]) for g in answer(side(groups)).gates]
    assert order[:3] == [("ERROR", "c"), ("FAIL", "b"), ("FAIL", "a")]
    assert {outcome for outcome, _ in order[3:]} == {"PASS"}
