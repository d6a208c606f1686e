"""Every effect has a switch, changes what it should, and moves no other effect's draws."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from fusion.messages import LidarScan
from scenarios.load import load_sensor
from scenarios.scenario import LidarEffect, LidarSensor
from simbench.motion import Motion
from simbench.sensors import lidar, returns
from simbench.truth import ScanTruth
from tests.simbench.scenes import scripted_motion, staged

HERE = ("divergence_deg", "dropout_rate", "false_positive_rate", "angle_noise_deg", "resolution_m")


@pytest.fixture(scope="module")
def motion() -> Motion:
    return scripted_motion(staged("overtake-approach", "car", 1))


@pytest.fixture(scope="module")
def loud() -> LidarSensor:
    """An OS1 with every effect large enough to be seen."""
    sensor = load_sensor("os1-64")
    assert isinstance(sensor, LidarSensor)
    return sensor.model_copy(
        update={"dropout_rate": 0.1, "false_positive_rate": 0.05, "angle_noise_deg": 0.1}
    )


def swept(motion: Motion, sensor: LidarSensor, seed: int = 5) -> tuple[LidarScan, ScanTruth]:
    return lidar.sweep("lidar", sensor, motion, 0, 0, np.random.default_rng(seed))


def by_beam(scan: LidarScan, truth: ScanTruth, value: np.ndarray) -> np.ndarray:
    """[1024 64], NaN where there is no point."""
    table = np.full((1024, 64), np.nan)
    table[np.searchsorted((np.arange(1024) * 100_000_000) // 1024, scan.offset_ns), scan.ring] = value
    return table


def ranges(motion: Motion, sensor: LidarSensor) -> tuple[np.ndarray, np.ndarray]:
    """Measured range and part by beam."""
    scan, truth = swept(motion, sensor)
    measured = np.linalg.norm(scan.xyz_m.astype(np.float64), axis=1)
    return by_beam(scan, truth, measured), by_beam(scan, truth, truth.part_id)


@pytest.mark.parametrize("effect", lidar.EFFECTS)
def test_every_effect_shows_when_it_is_on_and_is_gone_when_it_is_off(
    effect: LidarEffect, motion: Motion, loud: LidarSensor
) -> None:
    on, _ = ranges(motion, loud)
    off, _ = ranges(motion, lidar.without(loud, effect))
    assert not np.array_equal(on, off, equal_nan=True)
    zero: dict[str, dict[str, object]] = {
        "divergence": {"divergence_deg": (0.0, 0.0)},
        "resolution": {"resolution_m": 0.0},
        "angle_noise": {"angle_noise_deg": 0.0},
        "dropout": {"dropout_rate": 0.0},
        "false_positives": {"false_positive_rate": 0.0},
        "range_noise": {
            "noise": loud.noise.model_copy(update={"high_m": 0.0, "medium_m": 0.0, "low_m": 0.0})
        },
    }
    if effect in zero:
        same, _ = ranges(motion, loud.model_copy(update=zero[effect]))
        assert np.array_equal(off, same, equal_nan=True)


def test_the_resolution_moves_a_point_by_half_a_step_at_most(motion: Motion, loud: LidarSensor) -> None:
    on, part = ranges(motion, loud)
    off, _ = ranges(motion, lidar.without(loud, "resolution"))
    real = (part >= 0) & (off > loud.min_range_m + 0.01)
    assert np.nanmax(np.abs(on - off)[real]) <= 0.006 + 1e-5
    assert np.nanmax(np.abs(on - off)[real]) > 0.0059


def test_range_noise_moves_points_and_loses_none(motion: Motion, loud: LidarSensor) -> None:
    on, part = ranges(motion, loud)
    off, _ = ranges(motion, lidar.without(loud, "range_noise"))
    assert np.array_equal(np.isnan(on), np.isnan(off))
    moved = np.abs(on - off)[part >= 0]
    assert 0.01 < np.median(moved[moved > 0.0]) < 0.1


def test_dropout_takes_its_share_of_returns_and_leaves_the_others_alone(
    motion: Motion, loud: LidarSensor
) -> None:
    sensor = lidar.without(loud, "false_positives")
    on, _ = ranges(motion, sensor)
    off, _ = ranges(motion, lidar.without(sensor, "dropout"))
    kept = ~np.isnan(on)
    assert np.array_equal(on[kept], off[kept])
    lost = np.isnan(on) & ~np.isnan(off)
    n = int((~np.isnan(off)).sum())
    assert lost.sum() / n == pytest.approx(0.1, abs=5.0 * np.sqrt(0.09 / n))
    far = off > np.nanmedian(off)
    assert lost[far].sum() / far.sum() == pytest.approx(0.1, abs=0.01)  # whatever the strength


def test_false_returns_stand_only_where_nothing_returned(motion: Motion, loud: LidarSensor) -> None:
    on, part = ranges(motion, loud)
    off, _ = ranges(motion, lidar.without(loud, "false_positives"))
    kept = ~np.isnan(off)
    assert np.array_equal(on[kept], off[kept])
    new = ~np.isnan(on) & ~kept
    assert (part[new] == -1).all() and (part[kept] >= 0).all()
    assert new.sum() / (~kept).sum() == pytest.approx(0.05, abs=0.006)


def test_the_range_law_only_takes_points_away(motion: Motion, loud: LidarSensor) -> None:
    sensor = lidar.without(loud, "false_positives")
    on, _ = ranges(motion, sensor)
    off, _ = ranges(motion, lidar.without(sensor, "range_law"))
    kept = ~np.isnan(on)
    assert np.array_equal(on[kept], off[kept])
    assert (~np.isnan(off)).sum() > 1.05 * kept.sum()


def test_angle_noise_changes_no_beams_chance_to_be_detected(motion: Motion, loud: LidarSensor) -> None:
    """Its draws are its own: on ground nearby, where every beam returns, range noise stays the same."""
    sensor = lidar.without(loud, "resolution", "divergence")
    on, truth_on = swept(motion, sensor)
    off, truth_off = swept(motion, lidar.without(sensor, "angle_noise"))
    noise = [
        by_beam(s, t, np.linalg.norm(s.xyz_m.astype(np.float64), axis=1) - t.true_range_m)
        for s, t in ((on, truth_on), (off, truth_off))
    ]
    part = [by_beam(s, t, t.part_id) for s, t in ((on, truth_on), (off, truth_off))]
    ground = (part[0] == part[1]) & (part[1] == 0)
    near = ground & (by_beam(off, truth_off, truth_off.true_range_m) < 9.0)
    assert near.sum() > 1000
    assert np.corrcoef(noise[0][near], noise[1][near])[0, 1] > 0.999


def test_all_effects_off_is_the_ideal_sensor_that_sees_without_limit(
    motion: Motion, loud: LidarSensor
) -> None:
    off, truth_off = swept(motion, lidar.without(loud, *lidar.EFFECTS))
    ideal, truth = lidar.sweep("lidar", lidar.without(loud, "range_law"), motion, 0, 0, None)
    for field in fields(ideal):
        assert np.array_equal(getattr(off, field.name), getattr(ideal, field.name)), field.name
    assert np.array_equal(truth_off.true_range_m, truth.true_range_m)
    np.testing.assert_allclose(
        np.linalg.norm(off.xyz_m.astype(np.float64), axis=1), truth.true_range_m, rtol=2e-7
    )


def test_with_the_switches_in_any_order_the_sensor_is_the_same(loud: LidarSensor) -> None:
    assert lidar.without(loud, "dropout", "divergence") == lidar.without(
        lidar.without(loud, "divergence"), "dropout"
    )
    assert lidar.without(loud) == loud


@pytest.mark.parametrize("name", ["os1-64", "vlp-16"])
def test_the_compiled_laws_are_those_written_out_in_the_module(name: str, motion: Motion) -> None:
    """Noise scaled out by its draw: every point's spread is `range_noise_m` of its strength."""
    sensor = load_sensor(name)
    assert isinstance(sensor, LidarSensor)
    sensor = lidar.without(sensor, "resolution", "divergence", "angle_noise", "dropout", "false_positives")
    scan, truth = swept(motion, sensor, seed=11)
    draws = returns.draw(sensor, np.random.default_rng(11))
    table = lidar.beam_table(sensor)
    column = np.searchsorted(table.column_offset_ns, scan.offset_ns, side="right") - 1
    error = np.linalg.norm(scan.xyz_m.astype(np.float64), axis=1) - truth.true_range_m
    reach = returns.max_range_m(sensor, scan.intensity.astype(np.float64))
    sd = returns.range_noise_m(sensor, (reach / truth.true_range_m) ** 2)
    expected = draws.range_noise[column, scan.ring] * sd
    np.testing.assert_allclose(error, expected, rtol=1e-4, atol=1e-5)
    chance = 1.0 / (1.0 + np.exp((truth.true_range_m / reach - 1.0) / returns.SOFT_EDGE))
    assert (draws.detection[column, scan.ring] < chance + 1e-5).all()


@pytest.mark.parametrize("name", ["os1-64", "vlp-16"])
def test_what_is_surely_strong_needs_no_second_look(
    name: str, motion: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the table of sure ranges empty every return goes the long way: the same bytes."""
    sensor = load_sensor(name)
    assert isinstance(sensor, LidarSensor)
    quick = swept(motion, sensor)
    sure_m = returns._surely_strong_m(sensor)
    reach = returns.max_range_m(sensor, quick[0].intensity.astype(np.float64))
    assert (quick[1].true_range_m < 0.2 * reach).mean() > 0.05  # there are such
    assert (np.diff(sure_m) >= 0.0).all()
    assert sure_m[128] > 0.2 * returns.max_range_m(sensor, np.array([0.5]))[0]
    monkeypatch.setattr(returns, "_surely_strong_m", lambda _: np.zeros_like(sure_m))
    slow = swept(motion, sensor)
    for ours, theirs in zip(quick, slow, strict=True):
        for field in fields(ours):
            assert np.array_equal(getattr(ours, field.name), getattr(theirs, field.name)), field.name
