"""What every fault of the LiDAR promises: laws, receipts, and the mutants that the receipts must catch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest

from scenarios.faults import FaultSpec
from scenarios.faults import lidar as specs
from scenarios.load import load_sensor
from scenarios.scenario import LidarSensor
from scenarios.severity import severe
from simbench.capture import Captured
from simbench.faults.compared import compared
from simbench.faults.deliver import DELIVERY_FAULTS, deliver
from simbench.faults.delivery import Delivery, Sweep
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.firings import firing_of
from simbench.faults.points import DELIVERED
from simbench.faults.receipt import MISMATCH, OK, UNVERIFIABLE, Receipt
from simbench.run import run_case
from simbench.sensors.beams import beam_table
from tests.simbench.support import digest, faults, receipts_of, recorded, staged


@dataclass(frozen=True, kw_only=True)
class Example:
    """A fault at a strength that can be halved and doubled. also: the same fault with other fields set."""

    spec: FaultSpec
    signed: bool = False
    unit: float = 100.0  # what a wrong unit multiplies the strength with (or divides it by)


EXAMPLES: dict[str, Example] = {
    "dropout": Example(spec=specs.Dropout(percent=20.0)),
    "weak dropout": Example(spec=specs.WeakDropout(percent=40.0)),
    "beams": Example(spec=specs.BeamLoss(percent=40.0)),
    "even beams": Example(spec=specs.BeamLoss(percent=37.5, pattern="even")),
    "range noise": Example(spec=specs.RangeNoise(sd_cm=4.0)),
    "range bias": Example(spec=specs.RangeBias(bias_cm=6.0), signed=True),
    "azimuth offset": Example(spec=specs.AzimuthError(offset_deg=0.5), signed=True, unit=180.0 / np.pi),
    "eccentricity": Example(
        spec=specs.AzimuthError(offset_deg=-0.2, eccentricity_deg=0.3), signed=True, unit=180.0 / np.pi
    ),
}
EXAMPLES |= {
    "dirt": Example(spec=specs.DirtSector(width_deg=60.0, azimuth_deg=20.0)),
    "dim dirt": Example(
        spec=specs.DirtSector(width_deg=90.0, azimuth_deg=170.0, height_deg=20.0, opacity=0.5)
    ),
    "short range": Example(spec=specs.ReducedRange(lost_percent=40.0)),
    "ghosts": Example(spec=specs.Ghosts(percent=3.0)),
    "fog": Example(spec=specs.Fog(mor_m=100.0), unit=1000.0),
    "rain": Example(spec=specs.Rain(rate_mmph=50.0), unit=1000.0),
}
ENTRIES = {fault.spec: fault for fault in DELIVERED}
ids = pytest.mark.parametrize("which", EXAMPLES)


@cache
def clean() -> Captured:
    """One short drive, measured once; every fault acts on what was measured there."""
    return recorded(staged(duration_s=1.0, columns=128, background=True))


def site(seed: int = 0) -> Site:
    return replace(clean().site, seed=seed)


def entry(spec: FaultSpec) -> DeliveryFault:
    return ENTRIES[type(spec)]


def act(spec: FaultSpec, seed: int = 0, on: Delivery | None = None) -> Acted:
    return entry(spec).act(spec, clean().measured if on is None else on, site(seed))


def proof(spec: FaultSpec, acted: Acted, seed: int = 0, realised: Acted | None = None) -> tuple[Receipt, ...]:
    """Receipts of what acted, with what the bench says it drew (`realised`: of another act)."""
    drawn = (acted if realised is None else realised).realised
    step = Step(spec=spec, before=clean().measured, after=acted.delivery, realised=drawn)
    return entry(spec).receipts(spec, step, site(seed))


def statuses(found: tuple[Receipt, ...]) -> set[str]:
    return {receipt.status for receipt in found}


def scaled(spec: FaultSpec, by: float) -> FaultSpec:
    """The same fault with every strength times `by`, past what the spec would allow."""
    strengths = {name: by * getattr(spec, name) for name in spec.zero_when_off}
    if isinstance(spec, specs.ReducedRange):  # no sensor sees to less than nothing
        strengths["lost_percent"] = min(strengths["lost_percent"], 99.9)
    return spec.model_copy(update=strengths)


def named(sweep: Sweep) -> list[tuple[int, int]]:
    """Firing time and ring of every point: one firing returns one point."""
    return list(zip(sweep.truth.fire_ns.tolist(), sweep.scan.ring.tolist(), strict=True))


def in_order(sweep: Sweep) -> bool:
    """Whether the points still lie in firing order, as they are measured."""
    return bool((np.diff(sweep.truth.fire_ns) >= 0).all())


# -- laws -------------------------------------------------------------------------------------------------


def test_every_fault_of_the_room_has_an_example_severities_and_an_injector() -> None:
    assert {type(e.spec) for e in EXAMPLES.values()} == set(ENTRIES) == set(specs.SPECS)
    assert {s.fault for s in specs.SEVERITIES} == {spec.name for spec in specs.SPECS}


@ids
def test_zero_strength_is_the_identity(which: str) -> None:
    zero = scaled(EXAMPLES[which].spec, 0.0)
    assert zero.is_off
    np.testing.assert_equal(digest(*act(zero).delivery.sweeps), digest(*clean().measured.sweeps))


@ids
def test_inputs_stay_untouched_and_everything_but_the_sweeps_as_it_was(which: str) -> None:
    measured = clean().measured
    was = digest(*measured.sweeps)
    after = act(EXAMPLES[which].spec).delivery
    assert digest(*measured.sweeps) == was != digest(*after.sweeps)
    assert (after.shots, after.motions, after.reference) == (
        measured.shots, measured.motions, measured.reference,
    )  # fmt: skip


@ids
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(which: str) -> None:
    spec = EXAMPLES[which].spec
    first = digest(*act(spec).delivery.sweeps)
    assert digest(*act(spec).delivery.sweeps) == first
    drawn = which not in ("even beams", "range bias", "azimuth offset", "dirt")
    assert (digest(*act(spec, seed=1).delivery.sweeps) != first) == drawn


@ids
def test_points_keep_their_order_types_and_truth(which: str) -> None:
    before, after = clean().measured.sweeps, act(EXAMPLES[which].spec).delivery.sweeps
    assert len(before) == len(after)
    for was, now in zip(before, after, strict=True):
        scan, truth = now.scan, now.truth
        n = len(scan.xyz_m)
        assert in_order(now)
        assert (scan.xyz_m.dtype, scan.intensity.dtype, scan.ring.dtype) == (np.float32, np.float32, np.int16)
        assert {len(a) for a in (scan.intensity, scan.offset_ns, scan.ring, truth.object_id, truth.part_id,
                                 truth.true_range_m, truth.fire_ns, truth.incidence_rad)} == {n}  # fmt: skip
        assert ((scan.intensity >= 0) & (scan.intensity <= 1)).all() and np.isfinite(scan.xyz_m).all()
        np.testing.assert_array_equal(truth.fire_ns - scan.offset_ns, scan.stamp_ns)
        assert (scan.stamp_ns, scan.arrival_ns) == (was.scan.stamp_ns, was.scan.arrival_ns)
        # A point that is still there has the truth that it had.
        known = dict(
            zip(named(was), zip(was.truth.object_id, was.truth.true_range_m, strict=True), strict=True)
        )
        found = zip(named(now), zip(truth.object_id, truth.true_range_m, strict=True), strict=True)
        for (name, real), what in zip(found, truth.part_id >= 0, strict=True):
            assert not what or known[name] == real


@ids
def test_a_draw_does_not_depend_on_the_scene(which: str) -> None:
    """Of a sweep without every other point exactly those of the rest are left that were left before."""
    spec, measured = EXAMPLES[which].spec, clean().measured
    thin = measured.with_sweeps(lambda sweep: sweep.keep(np.arange(len(sweep.scan.ring)) % 2 == 0))
    whole, part = act(spec).delivery.sweeps, act(spec, on=thin).delivery.sweeps
    for sweep, few, source in zip(whole, part, thin.sweeps, strict=True):
        of = set(named(source))
        rows, found = (
            {name: tuple(xyz) for name, xyz in zip(named(s), s.scan.xyz_m, strict=True) if name in of}
            for s in (sweep, few)
        )
        assert found == rows


# -- receipts ---------------------------------------------------------------------------------------------


@ids
@pytest.mark.parametrize("seed", range(5))
def test_a_clean_draw_is_ok(which: str, seed: int) -> None:
    spec = EXAMPLES[which].spec
    found = proof(spec, act(spec, seed), seed)
    assert statuses(found) == {OK}, [r for r in found if r.status != OK]
    assert all(r.fault == spec.name and r.unit and r.note for r in found)


@ids
def test_no_point_at_all_is_unverifiable(which: str) -> None:
    spec = EXAMPLES[which].spec
    empty = clean().measured.with_sweeps(lambda sweep: sweep.keep(np.zeros(0, dtype=np.int64)))
    acted = act(spec, on=empty)
    step = Step(spec=spec, before=empty, after=acted.delivery, realised=acted.realised)
    found = entry(spec).receipts(spec, step, site())
    assert MISMATCH not in statuses(found) and (UNVERIFIABLE in statuses(found) or "ghosts" in spec.name)


@pytest.mark.parametrize("name", sorted(s.name for s in specs.SPECS))
def test_more_of_a_fault_is_more_of_its_measured_effect(name: str) -> None:
    effects = []
    for level in range(1, 6):
        spec = severe(name, level)
        acted = act(spec)
        found = proof(spec, acted)
        assert MISMATCH not in statuses(found), found
        assert found[0].measured is not None
        effects.append(found[0].measured)
    assert all(stronger > weaker for weaker, stronger in pairwise(effects)), effects


MUTANTS: dict[str, Callable[[Example], float]] = {
    "off": lambda e: 0.0,
    "half": lambda e: 0.5,
    "twice": lambda e: 2.0,
    "wrong unit up": lambda e: e.unit,
    "wrong unit down": lambda e: 1.0 / e.unit,
    "sign": lambda e: -1.0,
}


@ids
@pytest.mark.parametrize("mutant", MUTANTS)
def test_an_injector_that_acts_otherwise_than_asked_is_caught(which: str, mutant: str) -> None:
    example = EXAMPLES[which]
    if mutant == "sign" and not example.signed:
        pytest.skip("has no sign")
    honest, wrong = act(example.spec), act(scaled(example.spec, MUTANTS[mutant](example)))
    assert MISMATCH in statuses(proof(example.spec, wrong, realised=honest))  # the draw was right
    assert MISMATCH in statuses(proof(example.spec, wrong))  # the draw itself was wrong


@ids
def test_an_injector_that_acts_twice_is_caught(which: str) -> None:
    """With draws of its own each time: with the same ones, a loss that is repeated loses nothing more."""
    spec = EXAMPLES[which].spec
    once = act(spec)
    again = act(spec, seed=7, on=once.delivery)
    if digest(*again.delivery.sweeps) == digest(*once.delivery.sweeps):
        pytest.skip("twice is once")
    assert MISMATCH in statuses(proof(spec, again, realised=once))


@ids
def test_an_injector_replaced_by_the_identity_is_caught_in_the_whole_chain(which: str) -> None:
    spec = EXAMPLES[which].spec

    def idle(spec: FaultSpec, delivery: Delivery, at: Site) -> Acted:
        return Acted(delivery=delivery, realised=entry(spec).act(spec, delivery, at).realised)

    chain = tuple(replace(f, act=idle) if f.spec is type(spec) else f for f in DELIVERY_FAULTS)
    with mock.patch("simbench.faults.deliver.DELIVERY_FAULTS", chain):
        _, (step,) = deliver(clean().measured, faults(spec), site())
    assert MISMATCH in statuses(entry(spec).receipts(spec, step, site()))


@ids
def test_another_fault_of_the_room_leaves_the_receipt_ok(which: str) -> None:
    spec = EXAMPLES[which].spec
    for other in (specs.RangeNoise(sd_cm=3.0), specs.Dropout(percent=5.0)):
        if type(other) is type(spec):
            continue
        _, steps = deliver(clean().measured, faults(spec, other), site())
        for step in steps:
            found = entry(step.spec).receipts(step.spec, step, site())
            assert statuses(found) == {OK}, found


def test_all_faults_together_are_recorded_and_ok() -> None:
    together = tuple({type(e.spec): e.spec for e in EXAMPLES.values()}.values())
    at = staged(duration_s=1.0, columns=128, background=True, specs=together)
    captured = recorded(at)
    found = receipts_of(captured, at)
    assert {r.fault for r in found} == {spec.name for spec in together}
    assert MISMATCH not in statuses(found), [r for r in found if r.status == MISMATCH]
    assert all(in_order(sweep) for sweep in captured.steps[-1].after.sweeps)
    for case in (run_case(name, captured) for name in ("static_projection", "probabilistic")):
        assert case.status == "ok", case.why
        assert all(np.isfinite(row.value) if row.value is not None else row.why for row in case.rows)


@pytest.mark.parametrize(
    "spec",
    [
        specs.Dropout(percent=100.0),
        specs.BeamLoss(percent=99.0),
        specs.RangeNoise(sd_cm=100.0),
        specs.RangeBias(bias_cm=-500.0),
        specs.AzimuthError(offset_deg=-30.0, eccentricity_deg=10.0),
        specs.DirtSector(width_deg=360.0),
        specs.ReducedRange(lost_percent=99.0),
        specs.Ghosts(percent=100.0, max_range_m=500.0),
        specs.Fog(mor_m=0.25, backscatter=10.0),
        specs.Rain(rate_mmph=300.0, backscatter=0.0),
    ],
    ids=lambda spec: spec.name,
)
def test_the_strongest_that_a_fault_allows_is_no_mismatch(spec: FaultSpec) -> None:
    found = proof(spec, act(spec))
    assert MISMATCH not in statuses(found), found


@pytest.mark.parametrize("name", ["os1-64", "vlp-16"])
def test_the_firing_of_a_point_is_found_by_its_offset_and_ring(name: str) -> None:
    sensor = load_sensor(name)
    assert isinstance(sensor, LidarSensor)
    table = beam_table(sensor)
    beams = np.tile(table.order, sensor.columns)
    firing = np.repeat(np.arange(sensor.columns), len(table.order)) * len(table.order) + beams
    like = clean().measured.sweeps[0]
    rows = np.zeros(len(firing), dtype=np.int64)
    full = like.keep(rows)
    offset_ns = table.fire_offset_ns.reshape(-1)[firing].astype(np.int32)
    scan = replace(full.scan, ring=beams.astype(np.int16), offset_ns=offset_ns)
    np.testing.assert_array_equal(firing_of(replace(full, scan=scan), sensor), firing)


def test_a_weak_point_goes_before_a_strong_one() -> None:
    spec = specs.WeakDropout(percent=90.0)
    acted = act(spec)
    step = Step(spec=spec, before=clean().measured, after=acted.delivery, realised=acted.realised)
    both = compared(step)
    weak = both.percent_lost(both.before.intensity < 0.15)
    strong = both.percent_lost(both.before.intensity > 0.3)
    assert weak is not None and strong is not None and weak > 60.0 and strong < 15.0
