"""What a wrong injector would do instead of what it was asked for: the seven mistakes a receipt must see.

Off, half, double, wrong sign, wrong sensor, wrong unit, applied twice. A mutant is the specs by which the
data are made while the receipt is asked about the honest one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import get_args

from scenarios.faults import FaultSpec

UNITS: dict[str, tuple[tuple[str, float], ...]] = {
    "deg": (("rad for deg", 180.0 / pi), ("deg for rad", pi / 180.0)),
    "ms": (("s for ms", 1e3), ("us for ms", 1e-3)),
    "cm": (("m for cm", 1e2), ("mm for cm", 1e-1)),
    "m": (("km for m", 1e3), ("mm for m", 1e-3)),
    "s": (("ms for s", 1e-3), ("min for s", 60.0)),
    "%": (("share for %", 1e-2), ("% for share", 1e2)),
    "fraction": (("% for share", 1e-2), ("share for %", 1e2)),
    "share": (("% for share", 1e-2), ("share for %", 1e2)),
    "px": (("share of the width for px", 1e-3), ("px for share of the width", 1e3)),
}
ONCE_FOR_GOOD = ("camera.jpeg_loss",)
"""Coding a picture again with the table that it was coded with moves a value here and there by one."""
OTHER = (("a thousandth", 1e-3), ("a thousandfold", 1e3))


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """A mistake. kind: which of the seven; specs: what acts; honest: what was asked for."""

    kind: str
    name: str
    honest: FaultSpec
    specs: tuple[FaultSpec, ...]


def mutants(spec: FaultSpec, cameras: tuple[str, ...]) -> Iterator[Mutant]:
    """All that make sense of a fault on a rig with these cameras. A strength of words has neighbours in place
    of factors; a fault that scales nothing below 0 has no wrong sign; one that names no sensor has no wrong
    one."""

    def one(kind: str, name: str, *specs: FaultSpec, honest: FaultSpec = spec) -> Mutant:
        return Mutant(kind=kind, name=name, honest=honest, specs=specs)

    yield one("off", "off")
    words = spec.strength_words()
    if words:
        now = words.index(str(getattr(spec, spec.strength)))
        for other in (now - 1, now + 1):
            if 0 < other < len(words):  # the first word is nothing, which is off
                yield one("half" if other < now else "double", words[other], _word(spec, words[other]))
    else:
        yield one("half", "half", by(spec, 0.5))
        yield one("double", "double", by(spec, 2.0))
        if signed(spec):
            along = _along_an_axis(spec)
            yield one("sign", "sign", by(along, -1.0), honest=along)
        for name, factor in _units(spec):
            yield one("unit", name, by(spec, factor))
    if spec.name not in ONCE_FOR_GOOD:
        yield one("twice", "twice", spec, spec)
    if "sensors" in type(spec).model_fields and len(cameras) > 1:
        some = 2 if getattr(spec, "what", "") == "cameras_swapped" else 1  # two are swapped
        honest, wrong = _aimed(spec, cameras[:some]), _aimed(spec, cameras[some : 2 * some])
        yield one("sensor", "another camera", wrong, honest=honest)
        if some == 1:
            yield one("sensor", "all cameras", _aimed(spec, "cameras"), honest=honest)
        if "lidar" in str(type(spec).model_fields["sensors"].annotation):
            yield one("sensor", "the LiDAR", _aimed(spec, "lidar"), honest=honest)
            yield one("sensor", "a camera", honest, honest=_aimed(spec, "lidar"))


def by(spec: FaultSpec, factor: float) -> FaultSpec:
    """So many times as strong, past what the spec allows."""
    fields = spec.zero_when_off or (spec.strength,)
    values = {name: getattr(spec, name) for name in fields}
    scaled = {name: type(value)(factor * value) for name, value in values.items()}
    return spec.model_copy(update=scaled)


def signed(spec: FaultSpec) -> bool:
    """Whether its strength may be negative."""
    for constraint in type(spec).model_fields[spec.strength].metadata:
        least = getattr(constraint, "ge", getattr(constraint, "gt", None))
        if least is not None:
            return bool(least < 0)
    return False


def _along_an_axis(spec: FaultSpec) -> FaultSpec:
    """A direction drawn evenly and its opposite are drawn alike: a wrong sign shows along a given axis."""
    if getattr(spec, "axis", None) != "random":
        return spec
    axes = get_args(type(spec).model_fields["axis"].annotation)
    return spec.model_copy(update={"axis": next(axis for axis in axes if axis != "random")})


def _units(spec: FaultSpec) -> tuple[tuple[str, float], ...]:
    return UNITS.get(spec.unit.split()[0], OTHER)


def _word(spec: FaultSpec, word: str) -> FaultSpec:
    return spec.model_copy(update={spec.strength: word})


def _aimed(spec: FaultSpec, sensors: str | tuple[str, ...]) -> FaultSpec:
    """The same fault on other sensors."""
    return spec.model_copy(update={"sensors": sensors})
