"""The three places where faults act, each as one and the same thing to a proof: data that a spec makes of a
seed, and the receipts that look at such data.

Delivery: what was measured is changed in a step. Telling: the calibration that is handed out. Drive: what is
measured at all (time of exposure, shake, brackets, edges of boxes, the sensors themselves).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

from scenarios.faults import EdgeError, FaultSpec, MotionBlur
from simbench.faults.deliver import DELIVERY_FAULTS
from simbench.faults.draw import place_of
from simbench.faults.fault import Site, Step
from simbench.faults.proof import receipts as captured_receipts
from simbench.faults.receipt import Receipt
from simbench.faults.refit import RIG_FAULTS, Refit, refit
from simbench.faults.tell import CALIBRATION_FAULTS
from simbench.faults.telling import Place, Telling, Witness
from simbench.proving.ground import Ground, again, empty, fault_set, glimpse, long, measured, pictured, swept
from simbench.proving.mutants import by
from simbench.stage import Stage

GROUNDS = {"camera": pictured, "lidar": swept, "reference": long}
"""By family, where it is not the measured drive."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """Data under a fault, and what the injector says that it drew."""

    data: Any
    realised: Any


@dataclass(frozen=True, kw_only=True)
class Proving:
    """make: by specs one after the other (none: as it is without a fault), for a seed. look: the receipts of
    a spec on data, with what was drawn."""

    make: Callable[[tuple[FaultSpec, ...], int], Made]
    look: Callable[[FaultSpec, Made, int], tuple[Receipt, ...]]


def place_where(spec: type[FaultSpec]) -> Proving:
    """Where a fault acts."""
    for delivered in DELIVERY_FAULTS:
        if delivered.spec is spec:
            ground = GROUNDS.get(spec.name.partition(".")[0], measured)
            return _delivery(delivered.act, delivered.receipts, ground)
    for told in CALIBRATION_FAULTS:
        if told.spec is spec and spec not in {fault.spec for fault in RIG_FAULTS}:
            return _telling(told.tell, told.receipts)
    if spec is MotionBlur:
        return _drive(glimpse, pictures=True)
    return _drive(partial(empty, boxes=spec is EdgeError))


def _delivery(act: Callable[..., Any], receipts: Callable[..., Any], ground: Callable[[], Ground]) -> Proving:
    def site(seed: int) -> Site:
        return replace(ground().captured.site, seed=seed)

    def make(specs: tuple[FaultSpec, ...], seed: int) -> Made:
        now, realised = ground().captured.measured, dict[str, float]()
        for spec in specs:
            acted = act(spec, now, site(seed))
            now, realised = acted.delivery, acted.realised
        return Made(data=now, realised=realised)

    def look(spec: FaultSpec, made: Made, seed: int) -> tuple[Receipt, ...]:
        step = Step(
            spec=spec, before=ground().captured.measured, after=made.data, realised=_filled(made.realised)
        )
        return tuple(receipts(spec, step, site(seed)))

    return Proving(make=make, look=look)


def _telling(tell: Callable[..., Any], receipts: Callable[..., Any]) -> Proving:
    def place(seed: int) -> Place:
        return place_of(measured().staged.rig, seed)

    def make(specs: tuple[FaultSpec, ...], seed: int) -> Made:
        now, realised = place(seed).true, dict[str, float]()
        for spec in specs:
            told = tell(spec, now, place(seed))
            now, realised = told.calibration, told.realised
        return Made(data=now, realised=realised)

    def look(spec: FaultSpec, made: Made, seed: int) -> tuple[Receipt, ...]:
        step = Telling(
            fault=spec.name, before=place(seed).true, after=made.data, realised=_filled(made.realised)
        )
        return tuple(receipts(spec, step, Witness(place=place(seed), evidence=(), body=None)))

    return Proving(make=make, look=look)


def _drive(ground: Callable[[], Stage], pictures: bool = False) -> Proving:
    @lru_cache(maxsize=8)  # each mutant is compared with the same honest drive
    def make(specs: tuple[FaultSpec, ...], seed: int) -> Made:
        rig = ground().rig
        for spec in specs:
            rig, _ = refit(rig, fault_set((spec,)))
        once = (specs[-1] if rig is not ground().rig else _at_once(specs),) if specs else ()
        captured = again(replace(ground(), rig=rig), once, seed, pictures)
        return Made(data=(captured, rig), realised=(captured.drawn, rig))

    def look(spec: FaultSpec, made: Made, seed: int) -> tuple[Receipt, ...]:
        (captured, rig), (drawn, said) = made.data, made.realised
        step = Refit(spec=spec, before=ground().rig, after=said)
        return captured_receipts(
            replace(captured, drawn=drawn), rig, fault_set((spec,)), captured.site.duration_s, (step,)
        )

    return Proving(make=make, look=look)


def _at_once(specs: tuple[FaultSpec, ...]) -> FaultSpec:
    """The same fault several times, as one: a drive is measured under one spec of a kind. The shake of a road
    doubles from class to class."""
    spec = specs[-1]
    words = spec.strength_words()
    if len(specs) == 1:
        return spec
    if not words:
        return by(spec, float(len(specs)))
    now = words.index(str(getattr(spec, spec.strength)))
    return spec.model_copy(update={spec.strength: words[min(now + len(specs) - 1, len(words) - 1)]})


class _Filled(dict[str, float]):
    """What was not drawn counts as 0: an injector that says nothing did nothing."""

    def __missing__(self, key: str) -> float:
        return 0.0


def _filled(realised: Mapping[str, float]) -> Mapping[str, float]:
    return _Filled(realised)
