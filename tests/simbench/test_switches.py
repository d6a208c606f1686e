"""What the bench can leave out: with the cause off its effect is gone, and nothing else has moved."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scenarios.errors import BadInput
from simbench.capture import Captured
from simbench.case import Job
from simbench.run import run_case
from simbench.sensors.lidar import beam_table, period_ns
from simbench.sensors.rig import axis_deg, fire_offset_ns
from simbench.stage import Stage, stage
from simbench.switches import (
    REFERENCE_RATE,
    ROLLING_SCAN,
    SPIN_PHASE,
    check_switches,
    scored_without,
    switched,
)
from tests.simbench.support import recorded, staged

PERIOD_NS = 100_000_000


@lru_cache
def at(system: str, *off: str) -> Stage:
    whole = staged(system, duration_s=0.8, columns=128)
    return replace(whole, rig=switched(whole.rig, off))


@lru_cache
def captured(system: str, *off: str) -> Captured:
    return recorded(at(system, *off))


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_a_frozen_scan_sees_everything_at_one_instant_in_the_middle_of_the_turn(system: str) -> None:
    rolling, frozen = captured(system).recording, captured(system, ROLLING_SCAN).recording
    for before, after in zip(rolling.truth.scans, frozen.truth.scans, strict=True):
        assert np.ptp(before.fire_ns) > 0.8 * PERIOD_NS
        assert np.ptp(after.fire_ns) < 30_000
        assert np.abs(after.fire_ns - (before.seq + 0.5) * PERIOD_NS).max() < 30_000


def test_a_frozen_scan_says_when_it_fired_and_is_delivered_as_a_turning_one_is() -> None:
    rolling, frozen = captured("car").measured, captured("car", ROLLING_SCAN).measured
    for before, after in zip(rolling.sweeps, frozen.sweeps, strict=True):
        assert (after.scan.stamp_ns, after.scan.arrival_ns) == (before.scan.stamp_ns, before.scan.arrival_ns)
        assert np.array_equal(after.scan.stamp_ns + after.scan.offset_ns, after.truth.fire_ns)


def test_beams_of_a_frozen_scan_look_where_they_did_in_the_order_in_which_they_did() -> None:
    lidar = at("car").rig.lidar
    for sensor in (
        lidar,
        lidar.model_copy(update={"fire_delay_us": tuple(0.5 * (i % 4) for i in range(64))}),
    ):
        before, after = beam_table(sensor), beam_table(sensor.model_copy(update={"rolling": False}))
        assert np.array_equal(before.direction, after.direction)
        assert np.array_equal(before.order, after.order) and before.last_offset_ns == after.last_offset_ns
        assert (np.diff(after.group_offset_ns) > 0).all()


def test_with_the_world_at_rest_a_frozen_scan_is_the_turning_one() -> None:
    """Nothing moves against the LiDAR: each point must be where it was, bit by bit."""
    scans = []
    for rolling in (True, False):
        still = staged("car", scenario="static-board", duration_s=0.4, columns=128)
        lidar = still.rig.lidar.model_copy(update={"rolling": rolling})
        scans.append(
            [s.scan for s in recorded(replace(still, rig=replace(still.rig, lidar=lidar))).measured.sweeps]
        )
    for turning, frozen in zip(*scans, strict=True):
        assert len(turning.ring) > 100 and np.array_equal(turning.ring, frozen.ring)
        assert np.array_equal(turning.xyz_m, frozen.xyz_m)


@pytest.mark.parametrize("system", ["car", "wearable"])
@pytest.mark.parametrize("frozen", [False, True])
def test_in_phase_every_camera_is_exposed_when_the_scan_fires_along_its_axis(
    system: str, frozen: bool
) -> None:
    off = (SPIN_PHASE, ROLLING_SCAN) if frozen else (SPIN_PHASE,)
    rig = at(system, *off).rig
    plain = at(system).rig
    for name in rig.cameras:
        middle_ns = rig.timing(name, 0.8, 0).mid_ns
        along_ns = fire_offset_ns(rig, axis_deg(rig, name))
        assert np.abs((middle_ns - along_ns + PERIOD_NS // 2) % PERIOD_NS - PERIOD_NS // 2).max() <= 1
        if frozen:
            assert abs(along_ns - PERIOD_NS // 2) < 30_000
        else:
            assert along_ns == fire_offset_ns(plain, axis_deg(plain, name))


def test_a_camera_that_runs_faster_than_the_scan_is_in_phase_once_a_turn() -> None:
    rig = at("wearable", SPIN_PHASE).rig
    name, camera = next(iter(rig.cameras.items()))
    quick = replace(rig, cameras={**rig.cameras, name: camera.model_copy(update={"rate_hz": 29.0})})
    middle_ns = quick.timing(name, 0.8, 0).mid_ns
    assert (np.diff(middle_ns) == period_ns(rig.lidar) // 3).all()


def test_the_phase_of_the_cameras_moves_no_point() -> None:
    before, after = captured("car").measured.sweeps, captured("car", SPIN_PHASE).measured.sweeps
    assert all(np.array_equal(a.scan.xyz_m, b.scan.xyz_m) for a, b in zip(before, after, strict=True))


@pytest.mark.parametrize("system", ["car", "wearable"])
def test_without_its_rate_the_reference_has_no_lag_and_all_else_is_as_it_was(system: str) -> None:
    recording = recorded(staged(system, duration_s=1.0, columns=512, size_px=None)).recording
    other = scored_without(recording, (REFERENCE_RATE,))
    assert other.messages is recording.messages
    held, carried = (
        {row.metric: row.value for row in run_case("static_projection", Holder(r)).rows}
        for r in (recording, other)
    )
    moved = {name for name in held if held[name] != carried[name]}
    assert abs(held["budget_longitudinal_m.reference_lag"] or 0.0) > 0.1
    assert carried["budget_longitudinal_m.reference_lag"] == carried["budget_lateral_m.reference_lag"] == 0.0
    assert all("gnss" in name or name.endswith(("reference_lag", ".total")) for name in moved), moved
    for axis in ("longitudinal", "lateral"):
        parts = [v for name, v in carried.items() if name.startswith(f"budget_{axis}_m.") and v is not None]
        assert sum(parts[:-1]) == pytest.approx(parts[-1], abs=1e-9)


class Holder:
    """What `run_case` asks for."""

    def __init__(self, recording: object) -> None:
        self.recording = recording


def test_nothing_off_is_the_same_rig_and_recording() -> None:
    rig, recording = at("car").rig, captured("car").recording
    assert switched(rig, ()).lidar == rig.lidar and not switched(rig, ()).in_phase
    assert scored_without(recording, ()) is recording


def test_a_stage_obeys_its_job_and_refuses_what_it_does_not_know() -> None:
    job = Job(
        scenario="overtake-approach", system="car", seed=0, pipelines=(), off=(ROLLING_SCAN, SPIN_PHASE)
    )
    rig = stage(job).rig
    assert not rig.lidar.rolling and rig.in_phase
    with pytest.raises(BadInput, match=r"did you mean 'bench\.rolling_scan'"):
        check_switches(("bench.rolling_scans",))
