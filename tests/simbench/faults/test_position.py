"""Faults of the GNSS reference: one list of them, and every law asked of each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from scenarios.faults import FaultSpec
from scenarios.faults.reference import (
    ReferenceBias,
    ReferenceFloat,
    ReferenceHeading,
    ReferenceLag,
    ReferenceLever,
    ReferenceNoise,
    ReferenceOutage,
    ReferencePeriod,
)
from scenarios.severity import severe
from simbench.faults.deliver import deliver
from simbench.faults.receipt import OK, UNVERIFIABLE
from simbench.truth import GnssReference
from tests.simbench.faults.laws import Case, act, clean, entry, mismatches, other, receipts, scaled, site
from tests.simbench.support import digest, faults

LEVER = ReferenceLever(forward_m=0.5, left_m=-0.3, up_m=0.2)
EGO_LEVER = other(LEVER, of="ego")
OPPOSITE = {"forward_m": -0.5, "left_m": 0.3, "up_m": -0.2}
CASES = [
    Case(LEVER, (other(LEVER, **OPPOSITE), EGO_LEVER, *scaled(LEVER, 100.0, 0.01))),
    Case(EGO_LEVER, (other(EGO_LEVER, **OPPOSITE), LEVER, *scaled(EGO_LEVER, 100.0, 0.01))),
    Case(ReferenceBias(bias_cm=20.0), scaled(ReferenceBias(bias_cm=20.0), 0.01, 0.5, 2.0, 100.0)),
    Case(ReferenceNoise(noise_cm=5.0), scaled(ReferenceNoise(noise_cm=5.0), 0.01, 0.3, 2.0, 100.0)),
    Case(
        ReferenceFloat(duration_s=2.0, at_s=0.6),
        scaled(ReferenceFloat(duration_s=2.0, at_s=0.6), 1e-3, 0.5, 2.0),
    ),
    Case(
        ReferenceHeading(heading_deg=2.0),
        scaled(ReferenceHeading(heading_deg=2.0), -1.0, 0.5, 2.0, np.pi / 180.0, 180.0 / np.pi),
    ),
    Case(ReferencePeriod(period_s=0.6), scaled(ReferencePeriod(period_s=0.6), 1e-3, 0.5, 2.0)),
    Case(
        ReferenceOutage(duration_s=1.4, at_s=0.8),
        scaled(ReferenceOutage(duration_s=1.4, at_s=0.8), 1e-3, 0.5, 2.0),
    ),
    Case(ReferenceLag(lag_ms=100.0), scaled(ReferenceLag(lag_ms=100.0), -1.0, 1e-3, 0.5, 2.0, 1e3)),
]
NAMES = [f"{case.spec.name}-{k}" for k, case in enumerate(CASES)]
SPECS = pytest.mark.parametrize("case", CASES, ids=NAMES)
ALL = tuple({type(case.spec): case.spec for case in reversed(CASES)}.values())
RANDOM = (ReferenceBias, ReferenceNoise, ReferenceFloat)
ONCE_IS_TWICE = (ReferenceOutage, ReferencePeriod)  # what is gone cannot go again


def reference(delivery: object) -> GnssReference:
    found = delivery.reference  # type: ignore[attr-defined]
    assert isinstance(found, GnssReference)
    return found


@SPECS
def test_zero_strength_is_the_identity(case: Case) -> None:
    (zero,) = scaled(case.spec, 0.0)
    zero = other(zero, **dict.fromkeys(zero.zero_when_off, 0.0))
    assert zero.is_off
    assert digest(act(zero, clean(), site()).delivery.reference) == digest(clean().reference)


@SPECS
def test_inputs_stay_draws_repeat_and_nothing_else_moves(case: Case) -> None:
    before = clean()
    was = digest(before.reference)
    once, again = act(case.spec, before, site()), act(case.spec, before, site())
    assert digest(before.reference) == was
    assert digest(once.delivery.reference) == digest(again.delivery.reference) != was
    elsewhere = act(case.spec, before, site(1)).delivery.reference
    assert (digest(elsewhere) != digest(once.delivery.reference)) == isinstance(case.spec, RANDOM)
    assert once.delivery.shots is before.shots and once.delivery.sweeps is before.sweeps


@SPECS
@pytest.mark.parametrize("seed", range(5))
def test_a_clean_draw_is_ok_and_the_parts_add_up(case: Case, seed: int) -> None:
    acted = act(case.spec, clean(), site(seed))
    found = receipts(case.spec, clean(), acted, site(seed))
    assert {r.status for r in found} == {OK}, found
    after = reference(acted.delivery)
    parts = after.centre_ego_m + after.lever_m + after.heading_m + after.noise_m
    np.testing.assert_allclose(after.position_ego_m, parts, atol=1e-9)


@SPECS
def test_an_injector_that_acts_otherwise_is_caught(case: Case) -> None:
    before, place = clean(), site()
    honest = act(case.spec, before, place)
    off = other(case.spec, **dict.fromkeys(case.spec.zero_when_off, 0.0))
    for mutant in (off, *case.mutants):
        acted = act(mutant, before, place)
        in_the_world = replace(honest, delivery=acted.delivery)
        assert mismatches(receipts(case.spec, before, in_the_world, place)), mutant
        lied = replace(honest, realised={**honest.realised, **acted.realised}, delivery=acted.delivery)
        assert mismatches(receipts(case.spec, before, lied, place)), mutant


@SPECS
def test_an_injector_that_acts_twice_is_caught(case: Case) -> None:
    once = act(case.spec, clean(), site())
    twice = replace(once, delivery=act(case.spec, once.delivery, site()).delivery)
    if isinstance(case.spec, ONCE_IS_TWICE):
        assert digest(twice.delivery.reference) == digest(once.delivery.reference)
    else:
        assert mismatches(receipts(case.spec, clean(), twice, site()))


@SPECS
def test_a_part_that_is_forgotten_is_caught(case: Case) -> None:
    """A position that moves while the budget's parts stay would put the error on the pipeline's account."""
    once = act(case.spec, clean(), site())
    after, before = reference(once.delivery), reference(clean())
    if len(after.fix_ns) < len(before.fix_ns) or isinstance(case.spec, ReferenceLag):
        return
    for part in ("lever_m", "noise_m", "heading_m"):
        if np.abs(getattr(after, part) - getattr(before, part)).max() < 1e-6:
            continue
        forgot = replace(once.delivery, reference=replace(after, **{part: getattr(before, part)}))
        assert "sum of the parts, true centre" in mismatches(
            receipts(case.spec, clean(), replace(once, delivery=forgot), site())
        )


@pytest.mark.parametrize("kind", [type(spec) for spec in ALL])
def test_more_of_a_fault_is_more_of_its_effect(kind: type[FaultSpec]) -> None:
    measured = []
    for level in range(1, 6):
        spec = severe(kind.name, level)
        found = receipts(spec, clean(), act(spec, clean(), site()), site())
        assert not mismatches(found), found
        if found[0].measured is not None:  # a time that is longer than the run cannot show
            measured.append(found[0].measured)
    rises = np.diff(np.array(measured, dtype=float))
    assert len(measured) >= 3 and (rises[:2] > 0.0).all() and (rises >= 0.0).all(), measured


def test_one_degree_of_heading_moves_a_target_at_20_m_by_35_cm() -> None:
    before, after = clean(), act(ReferenceHeading(heading_deg=1.0), clean(), site()).delivery
    far_m = np.linalg.norm(reference(before).position_ego_m[:, :2], axis=1)
    moved_m = np.linalg.norm(reference(after).position_ego_m - reference(before).position_ego_m, axis=1)
    np.testing.assert_allclose(20.0 * moved_m / far_m, 0.349, atol=1e-3)


def test_all_together_keep_their_receipts() -> None:
    delivered, steps = deliver(clean(), faults(*ALL), site())
    assert len(steps) == len(ALL)
    for step in steps:
        found = entry(step.spec).receipts(step.spec, step, site())
        assert {r.status for r in found} == {OK}, found
    assert digest(delivered.shots) == digest(clean().shots)


@SPECS
def test_without_a_reference_nothing_is_claimed(case: Case) -> None:
    before = replace(clean(), reference=None)
    (one,) = receipts(case.spec, before, act(case.spec, before, site()), site())
    assert one.status == UNVERIFIABLE and one.note == "this run has no GNSS reference"


def test_an_outage_of_the_whole_run_leaves_no_fix() -> None:
    acted = act(ReferenceOutage(duration_s=100.0, at_s=0.0), clean(), site())
    assert len(reference(acted.delivery).fix_ns) == 0
    assert not mismatches(receipts(ReferenceOutage(duration_s=100.0, at_s=0.0), clean(), acted, site()))


@pytest.mark.parametrize(
    ("kind", "fields", "says"),
    [
        (ReferenceNoise, {"noise_cm": -1.0}, "greater than or equal to 0"),
        (ReferenceBias, {"bias_cm": float("nan")}, "finite"),
        (ReferenceFloat, {"duration_s": 1.0, "least_m": 2.0}, "must not be below least_m"),
        (ReferenceHeading, {"heading_deg": 181.0}, "less than or equal to 180"),
        (ReferenceLever, {"of": "both"}, "'target' or 'ego'"),
        (ReferenceOutage, {"at_s": -1.0}, "greater than or equal to 0"),
    ],
)
def test_bad_input_is_refused(kind: type[FaultSpec], fields: dict[str, object], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        kind(**fields)
