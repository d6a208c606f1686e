"""One small delivery for the tests of stamps and transport, and the laws that each of their faults obeys."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

from scenarios.faults import FaultSpec
from scenarios.severity import severe
from simbench.capture import Captured
from simbench.faults.deliver import DELIVERY_FAULTS
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, DeliveryFault, Site, Step
from simbench.faults.receipt import MISMATCH, OK, Receipt
from tests.simbench.support import digest, recorded, staged

LEFT, RIGHT = "cam-left", "cam-right"
IDEMPOTENT = {"timing.stamp_quantum_ms", "timing.stamp_on_save_ms", "timing.frozen_percent"}
"""Applied twice with the same draws they do what they do once."""


@cache
def drive() -> Captured:
    """Two seconds of the wearable with traffic: three free running cameras with host stamps, one LiDAR."""
    return recorded(staged("wearable", columns=64, background=True))


def site(seed: int = 0) -> Site:
    return replace(drive().site, seed=seed)


def entry(spec: FaultSpec) -> DeliveryFault:
    return next(fault for fault in DELIVERY_FAULTS if fault.spec is type(spec))


def acted(spec: FaultSpec, delivery: Delivery | None = None, seed: int = 0) -> Acted:
    return entry(spec).act(spec, drive().measured if delivery is None else delivery, site(seed))


def stepped(spec: FaultSpec, delivery: Delivery | None = None, seed: int = 0) -> Step:
    before = drive().measured if delivery is None else delivery
    done = acted(spec, before, seed)
    return Step(spec=spec, before=before, after=done.delivery, realised=done.realised)


def receipts(step: Step, seed: int = 0) -> tuple[Receipt, ...]:
    return entry(step.spec).receipts(step.spec, step, site(seed))


def bad(found: tuple[Receipt, ...]) -> list[Receipt]:
    return [receipt for receipt in found if receipt.status == MISMATCH]


def by(spec: FaultSpec, factor: float) -> FaultSpec:
    """That many times as strong; past the limits of the spec, as a wrong unit would be."""
    value = getattr(spec, spec.strength) * factor
    kind = type(getattr(spec, spec.strength))
    return spec.model_copy(update={spec.strength: kind(value)})


def mutants(spec: FaultSpec) -> Iterator[tuple[str, Delivery]]:
    """What wrong injectors would deliver."""
    yield "off", drive().measured
    factors = {"half": 0.5, "twice": 2.0, "a unit too small": 1e-3, "a unit too large": 1e3}
    if type(spec).name.endswith("_percent"):
        factors |= {"fraction": 0.01, "per cent of per cent": 100.0}
    if _signed(spec):
        factors["sign"] = -1.0
    for name, factor in factors.items():
        yield name, acted(by(spec, factor)).delivery
    if spec.name not in IDEMPOTENT:
        yield "applied twice", acted(spec, acted(spec).delivery).delivery
    if getattr(spec, "sensors", None) == (LEFT,):
        yield "wrong camera", acted(spec.model_copy(update={"sensors": (RIGHT,)})).delivery
        yield "every camera", acted(spec.model_copy(update={"sensors": "cameras"})).delivery
        if "lidar" in str(type(spec).model_fields["sensors"].annotation):
            yield "the LiDAR", acted(spec.model_copy(update={"sensors": "lidar"})).delivery


def _signed(spec: FaultSpec) -> bool:
    try:
        type(spec)(**{spec.strength: -0.1})
    except ValueError:
        return False
    return True


def check_identity(spec: FaultSpec) -> None:
    """Zero strength, past the fault set, changes no byte."""
    off = type(spec)(**{field: 0 for field in spec.zero_when_off})
    assert off.is_off
    assert digest(acted(off).delivery) == digest(drive().measured)


def check_pure(spec: FaultSpec) -> None:
    """Inputs stay; the same seed gives the same bytes."""
    before = digest(drive().measured)
    assert digest(acted(spec).delivery) == digest(acted(spec).delivery) != before
    assert digest(drive().measured) == before


def check_receipts(spec: FaultSpec) -> None:
    """Nothing is amiss on five clean draws, and the strength itself is seen."""
    for seed in range(5):
        found = receipts(stepped(spec, seed=seed), seed)
        assert not bad(found), bad(found)
        assert any(r.status == OK and r.requested != 0.0 for r in found), found


def check_mutants(spec: FaultSpec) -> None:
    honest = stepped(spec)
    for name, delivery in mutants(spec):
        assert bad(receipts(replace(honest, after=delivery))), (spec, name)


def check_wrong_draw(spec: FaultSpec) -> None:
    """A fault that draws and does something else than was asked for."""
    for factor in (0.0, 0.5, 2.0, 1e-3, 1e3):
        wrong = stepped(by(spec, factor))
        assert bad(receipts(replace(wrong, spec=spec))), (spec, factor)


def ladder(name: str, quantity: str) -> list[float]:
    """What the receipts measure at severities 1 to 5: the mean of a quantity over the sensors."""
    measured = []
    for level in range(1, 6):
        found = [r for r in receipts(stepped(severe(name, level))) if r.quantity.endswith(quantity)]
        assert not bad(tuple(found))
        values = [r.measured for r in found if r.measured is not None]
        measured.append(sum(values) / len(values))
    return measured
