"""What stamps claim: every fault of the room by the same laws, and what each of them does."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from scenarios.faults import (
    ClockDrift,
    ClockOffset,
    FaultSpec,
    StampJitter,
    StampMeaning,
    StampOnSave,
    StampQuantum,
    StampStep,
)
from simbench.faults.deliver import deliver
from simbench.faults.delivery import Delivery
from simbench.faults.flow import times
from simbench.faults.receipt import OK, UNVERIFIABLE
from simbench.faults.stamps import DELIVERED
from tests.simbench.faults.timing_laws import (
    LEFT,
    acted,
    bad,
    check_identity,
    check_mutants,
    check_pure,
    check_receipts,
    check_wrong_draw,
    drive,
    entry,
    ladder,
    receipts,
    site,
    stepped,
)
from tests.simbench.support import digest, faults

ALL: tuple[FaultSpec, ...] = (
    ClockOffset(offset_ms=30.0),
    ClockDrift(rate_ppm=50.0),
    StampJitter(sd_ms=5.0),
    StampOnSave(delay_ms=50.0),
    StampMeaning(share=0.5),
    StampStep(step_ms=40.0),
    StampQuantum(quantum_ms=7.0),
)
ONE = tuple(spec.model_copy(update={"sensors": (LEFT,)}) for spec in ALL)
LIDAR = tuple(spec.model_copy(update={"sensors": "lidar"}) for spec in ALL)
MORE = (
    ClockOffset(offset_ms=-30.0),
    ClockDrift(rate_ppm=-200.0, since_s=0.0),
    StampJitter(sd_ms=5.0, distribution="uniform"),
    StampJitter(sd_ms=5.0, distribution="heavy_tailed"),
    StampOnSave(delay_ms=20.0, jitter_ms=0.0),
    StampMeaning(share=-1.0),
    StampStep(step_ms=-1000.0, at_s=0.7),
)
EVERY = (*ALL, *ONE, *LIDAR, *MORE)


def name_of(spec: FaultSpec) -> str:
    return f"{spec.name}-{spec.sensors if isinstance(spec.sensors, str) else spec.sensors[0]}"  # type: ignore[attr-defined]


def test_the_room_is_covered() -> None:
    assert {type(spec) for spec in ALL} == {fault.spec for fault in DELIVERED}


@pytest.mark.parametrize("spec", ALL, ids=name_of)
def test_zero_is_the_identity(spec: FaultSpec) -> None:
    check_identity(spec)


@pytest.mark.parametrize("spec", EVERY, ids=name_of)
def test_a_fault_leaves_its_input_and_repeats_itself(spec: FaultSpec) -> None:
    check_pure(spec)


@pytest.mark.parametrize("spec", [ALL[2], ALL[3], MORE[2], MORE[3]], ids=name_of)
def test_another_seed_draws_otherwise(spec: FaultSpec) -> None:
    assert digest(acted(spec).delivery) != digest(acted(spec, seed=1).delivery)


@pytest.mark.parametrize("spec", EVERY, ids=name_of)
def test_clean_draws_are_proved(spec: FaultSpec) -> None:
    check_receipts(spec)


@pytest.mark.parametrize("spec", EVERY, ids=name_of)
def test_a_wrong_injector_is_caught(spec: FaultSpec) -> None:
    check_mutants(spec)


@pytest.mark.parametrize(
    "spec", [s for s in EVERY if not isinstance(s, StampJitter | StampQuantum)], ids=name_of
)
def test_a_draw_that_was_not_asked_for_is_caught(spec: FaultSpec) -> None:
    check_wrong_draw(spec)


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("timing.clock_offset_ms", "offset"),
        ("timing.clock_drift_ppm", "rate"),
        ("timing.stamp_jitter_ms", "spread"),
        ("timing.stamp_on_save_ms", "mean lag"),
        ("timing.stamp_meaning_share", "shift"),
        ("timing.stamp_step_ms", "step"),
        ("timing.stamp_quantum_ms", "rounded off"),
    ],
)
def test_a_higher_severity_is_more(name: str, quantity: str) -> None:
    assert all(weaker < stronger for weaker, stronger in pairwise(ladder(name, quantity)))


@pytest.mark.parametrize("spec", EVERY, ids=name_of)
def test_only_stamps_move(spec: FaultSpec) -> None:
    """Whole deliveries without their stamps are the same, byte by byte."""

    def bare(delivery: Delivery) -> str:
        shots = {n: [s.timed(0, s.arrival_ns) for s in shots] for n, shots in delivery.shots.items()}
        sweeps = [s.timed(0, s.arrival_ns) for s in delivery.sweeps]
        return digest(shots, sweeps, delivery.motions, delivery.reference)

    assert bare(acted(spec).delivery) == bare(drive().measured)


def test_every_fault_of_the_room_at_once_is_proved() -> None:
    _, steps = deliver(drive().measured, faults(*ALL), site())
    assert [step.spec.name for step in steps] == [fault.spec.name for fault in DELIVERED]
    for step in steps:
        assert not bad(entry(step.spec).receipts(step.spec, step, site()))


@pytest.mark.parametrize("distribution", ["gaussian", "uniform", "heavy_tailed"])
def test_jitter_has_the_spread_that_was_asked_for(distribution: str) -> None:
    from scenarios.seeding import stream
    from simbench.faults.chances import scattered, spread_by_median

    drawn = scattered(distribution, 200_000, stream(0, "test"))
    assert spread_by_median(drawn, distribution) == pytest.approx(1.0, rel=0.01)
    assert abs(drawn.mean()) < 0.02
    far = {"gaussian": 2.7e-3, "uniform": 0.0, "heavy_tailed": 1.38e-2}[distribution]  # beyond 3 SD
    assert np.mean(np.abs(drawn) > 3.0) == pytest.approx(far, rel=0.1, abs=1e-4)


def test_a_stamp_made_on_saving_ascends_and_forgets_the_one_before() -> None:
    late = acted(StampOnSave(delay_ms=50.0, jitter_ms=40.0)).delivery
    other = acted(StampOnSave(delay_ms=50.0, jitter_ms=40.0), acted(ClockOffset(offset_ms=9.0)).delivery)
    for name in late.shots:
        stamps = times(late, site().rig, name)
        assert (np.diff(stamps.stamp_ns) > 0).all()
        assert (stamps.stamp_ns - stamps.true_ns >= 50_000_000).all()
        assert np.array_equal(stamps.stamp_ns, times(other.delivery, site().rig, name).stamp_ns)


def test_the_end_of_the_sweep_is_a_turn_after_its_start() -> None:
    sweeps = acted(StampMeaning(share=1.0, sensors="lidar")).delivery.sweeps
    assert {
        after.stamp_ns - before.stamp_ns
        for before, after in zip(drive().measured.sweeps, sweeps, strict=True)
    } == {100_000_000}


def test_a_step_after_the_end_cannot_be_verified() -> None:
    found = receipts(stepped(StampStep(step_ms=40.0, at_s=100.0)))
    assert {r.status for r in found if "beside" not in r.quantity} == {UNVERIFIABLE}
    assert all("ends before" in r.note for r in found if "beside" not in r.quantity)


def test_an_effect_below_a_nanosecond_cannot_be_verified() -> None:
    found = receipts(stepped(ClockOffset(offset_ms=1e-6)))
    assert {r.status for r in found if "beside" not in r.quantity} == {UNVERIFIABLE}


@pytest.mark.parametrize("spec", EVERY, ids=name_of)
def test_sensors_that_are_spared_are_proved_to_be(spec: FaultSpec) -> None:
    (beside,) = [r for r in receipts(stepped(spec)) if "beside" in r.quantity]
    assert (beside.status, beside.measured) == (OK, 0.0)
