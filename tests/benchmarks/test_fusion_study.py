"""The scripts behind docs/fusion.md: bounds on the side that a limit fears, weights that a law recovers."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from fusion.confidence import ConfidenceConfig, confidence
from fusion.pipelines.robust import Robust, RobustConfig
from tests.benchmarks import ablations, fusion_table, miscalibration, reliability


def runs(values: list[float | None]) -> dict[int, float | None]:
    return dict(enumerate(values))


def rows(pipeline: str, metric: str, better: str, values: list[float | None]) -> list[dict[str, object]]:
    key = {"scenario": "overtake-approach", "system": "car", "faults": "none", "pipeline": pipeline}
    return [{**key, "seed": i, "metric": metric, "better": better, "value": v} for i, v in enumerate(values)]


@pytest.mark.parametrize("count", [6, 20])
def test_the_bound_lies_on_the_side_that_a_limit_fears(count: int) -> None:
    values = np.random.default_rng(0).normal(0.9, 0.02, count).tolist()
    low, high = fusion_table.value(runs(values), True, "a"), fusion_table.value(runs(values), False, "a")
    assert low.mean == high.mean == pytest.approx(np.mean(values))
    assert low.bound is not None and high.bound is not None and low.mean is not None
    assert low.bound < low.mean < high.bound
    assert low.keeps(low.bound) and not low.keeps(low.bound + 1e-9)
    assert high.keeps(high.bound) and not high.keeps(high.bound - 1e-9)


def test_a_run_without_a_value_and_too_few_runs_keep_no_limit() -> None:
    assert not fusion_table.value(runs([1.0] * 20 + [None]), True, "a").keeps(0.5)
    assert fusion_table.value(runs([1.0] * 20), True, "a").keeps(0.5)
    assert fusion_table.value(runs([1.0] * 5), True, "a").bound is None
    assert not fusion_table.value(runs([1.0] * 5), True, "a").keeps(0.5)


def test_only_what_robust_does_not_keep_is_bold() -> None:
    good = rows("robust", "precision", "higher", [1.0] * 20) + rows(
        "other", "precision", "higher", [0.1] * 20
    )
    (line, other) = fusion_table.table(good, "clean", ["precision"])[2:]
    assert "**" not in line and "1.000 (≥ 1.000)" in line and "**" not in other
    bad = rows("robust", "precision", "higher", [0.98] * 20)
    assert "**0.980 (≥ 0.980)**" in fusion_table.table(bad, "clean", ["precision"])[2]


def test_differences_are_paired_by_seed() -> None:
    base = rows("static_projection", "tpr", "higher", [0.1 * i for i in range(7)])
    ours = rows("robust", "tpr", "higher", [0.1 * i + 0.3 for i in range(7)])
    (line,) = fusion_table.against(base + ours, "static_projection", ["tpr"])[2:]
    assert "+0.300 | +0.300 to +0.300 | 0.016" in line


VARIANTS = {
    name: factory
    for name, factory in vars(ablations).items()
    if inspect.isfunction(factory) and factory.__module__ == ablations.__name__ and not name.startswith("_")
}


def test_every_ablation_switches_one_thing_off_and_no_two_the_same() -> None:
    configs = [factory().config for factory in VARIANTS.values()]
    assert len(configs) > 10 and RobustConfig() not in configs
    assert len({repr(config) for config in configs}) == len(configs)
    assert all(isinstance(factory(), Robust) for factory in VARIANTS.values())


def test_the_fit_finds_the_weights_that_made_the_data() -> None:
    rng, true = np.random.default_rng(3), ConfidenceConfig()
    score, support = rng.uniform(-16, 0, 20_000), rng.uniform(0, 1, 20_000)
    points, sightings = rng.integers(1, 300, 20_000), rng.integers(1, 12, 20_000)
    chance = np.array(
        [
            confidence(s, u, int(p), int(n), true)
            for s, u, p, n in zip(score, support, points, sightings, strict=True)
        ]
    )
    right = (rng.random(20_000) < chance).astype(float)
    data = np.column_stack([score, support, np.log(points), np.log(np.minimum(sightings, 10)), chance, right])
    found = reliability.fitted(data)
    expected = [true.bias, true.score, true.support, true.points, true.sightings]
    np.testing.assert_allclose(found, expected, rtol=0.15, atol=0.1)


def test_the_bins_of_a_calibrated_confidence_lie_on_the_diagonal() -> None:
    rng = np.random.default_rng(1)
    said = rng.random(50_000)
    bins = reliability.table(said, (rng.random(50_000) < said).astype(float))
    assert sum(count for _, _, count in bins) == 50_000
    for given, right, _ in bins:
        assert right == pytest.approx(given, abs=0.03)


def test_the_rivals_of_the_miscalibration_study_are_all_others_that_are_installed() -> None:
    from simbench.plugins import pipeline_names

    assert {*miscalibration.OURS, *miscalibration.RIVALS, "probabilistic_paper"} == set(pipeline_names())
