"""Which runs belong together, and which instant is shown: by rule, never by hand."""

from __future__ import annotations

import statistics

from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.report.choose import (
    groups_of,
    instants,
    mean_of_runs,
    median_and_worst,
    run_values,
    shift_px,
    value_of,
    views_of,
)
from tests.simbench.report.make import crashed, result, without_target

shares = st.lists(st.integers(0, 100).map(lambda k: k / 100), min_size=1, max_size=9)


@settings(max_examples=25)
@given(st.data())
def test_the_shown_pair_has_the_median_loss_and_the_other_one_the_largest(data: st.DataObject) -> None:
    losses, results = [], []
    for seed in range(data.draw(st.integers(1, 2))):
        clean = data.draw(shares)
        bad = data.draw(st.lists(st.sampled_from(clean), min_size=len(clean), max_size=len(clean)))
        losses += [a - b for a, b in zip(clean, bad, strict=True)]
        for errors, tpr in ((), clean), (("demo",), bad):
            results.append(result(seed, errors=errors, tpr={"static_projection": tpr}))
    (group,) = groups_of(results)
    chosen = median_and_worst(group)
    assert chosen is not None
    median, worst = chosen
    assert median.loss is not None and worst.loss is not None
    assert abs(median.loss - statistics.median_low(losses)) < 1e-9
    assert abs(worst.loss - max(losses)) < 1e-9
    assert median.of == len(losses)


def test_of_equal_losses_the_one_with_the_middle_shift_is_shown() -> None:
    same = {"static_projection": [0.5] * 5}
    (group,) = groups_of([result(tpr=same), result(errors=("demo",), tpr=same)])
    chosen = median_and_worst(group)
    assert chosen is not None
    assert shift_px(views_of(chosen[0].run.faulted)[chosen[0].key]) == 2.0  # of 0, 1, 2, 3, 4
    assert shift_px(views_of(chosen[1].run.faulted)[chosen[1].key]) == 4.0


def test_the_order_of_the_results_decides_nothing_about_the_instant() -> None:
    results = [result(seed, errors=errors) for seed in (0, 1) for errors in ((), ("demo",))]
    a, b = (median_and_worst(groups_of(given)[0]) for given in (results, results[::-1]))
    assert a is not None and b is not None
    assert [(i.run.seed, i.key, i.loss) for i in a] == [(i.run.seed, i.key, i.loss) for i in b]


def test_one_clean_run_serves_every_set_of_faults() -> None:
    errors = [(), ("demo",), ("timing.trigger_offset_ms=20",)]
    groups = groups_of([result(errors=e) for e in errors])
    assert len(groups) == 2
    assert all(g.sides == ("clean", "faulted") for g in groups)
    assert groups[0].runs[0].clean is groups[1].runs[0].clean


def test_runs_with_another_calibration_are_no_sides_of_one_another() -> None:
    groups = groups_of([result(), result(errors=("demo",)), result(errors=("demo",), found_in="a.yaml")])
    assert [(g.told, g.sides) for g in groups] == [("true", ("clean", "faulted")), ("found", ("faulted",))]


def test_systems_and_scenarios_are_groups_of_their_own() -> None:
    groups = groups_of([result(), result(system="wearable"), without_target()])
    assert [(g.scenario, g.system, g.has_target()) for g in groups] == [
        ("overtake-approach", "car", True),
        ("overtake-approach", "wearable", True),
        ("empty-road", "car", False),
    ]


def test_baseline_and_method_are_the_papers_where_they_ran() -> None:
    (group,) = groups_of([result(pipelines=("probabilistic", "mine", "static_projection"))])
    assert (group.baseline, group.method) == ("static_projection", "probabilistic")
    (group,) = groups_of([result(pipelines=("first", "second"))])
    assert (group.baseline, group.method) == ("first", "second")
    (group,) = groups_of([result(pipelines=("only",))])
    assert (group.baseline, group.method) == ("only", None)


def test_a_crashed_baseline_leaves_no_instant() -> None:
    (group,) = groups_of([result(crash=("static_projection",))])
    assert instants(group) == ()
    assert median_and_worst(group) is None
    assert crashed("x").scores is None


def test_runs_weigh_the_same_and_missing_ones_are_left_out() -> None:
    results = [
        result(0, tpr={"static_projection": [0.2] * 3}),
        result(1, tpr={"static_projection": [0.6] * 9}),
        result(2, crash=("static_projection",)),
    ]
    (group,) = groups_of(results)
    values = run_values(group, "clean", "static_projection", "tpr")
    assert values[2] is None
    mean = mean_of_runs(group, "clean", "static_projection", "tpr")
    assert mean is not None and abs(mean - 0.4) < 1e-12
    assert value_of(None, "static_projection", "tpr") is None
