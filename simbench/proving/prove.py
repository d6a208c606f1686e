"""The proof of one fault: honest draws match, every mutant is caught, and a higher severity is more.

z of a receipt: (measured - realised) / the SD that its estimator is said to have by chance. One that counts
or reads off what it measures errs by rounding only, and says an SD of 0: it is `exact`. One of which a bound
on what is not chance is more than five SD is `bounded`: its errors lie within that, or it is a mismatch.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import pdtrik

from scenarios.errors import BadInput
from scenarios.faults import FAULTS, FaultSpec, RoadShake, Trace
from scenarios.severity import severe
from simbench.faults.receipt import MISMATCH, OK, Receipt
from simbench.proving.ground import a_trace, measured
from simbench.proving.mutants import Mutant, mutants
from simbench.proving.places import Proving, place_where
from simbench.proving.same import same

LEVEL = 4  # at which mutants are tried and honest draws made
FEW = 10  # draws of a mutant or of a severity, where one does not tell
BOUNDED = 5.0  # SD, beyond which what is not chance hides the chance
OFF_Z_SD, OFF_Z_MEAN = 0.2, 0.2  # from 1 and from 0, with any number of draws
CAUGHT, CRASHED, MISSED, SAME = "caught", "crashed", "missed", "same"


@dataclass(frozen=True, kw_only=True)
class Tried:
    """What became of a mutant. `same`: it did what the honest fault does, to the byte of what is looked at,
    as what is applied twice does where once is for good; there is nothing to catch."""

    kind: str
    name: str
    outcome: str


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """z of one quantity over n honest draws."""

    quantity: str
    n: int
    mean: float
    sd: float

    @property
    def holds(self) -> bool:
        """The mean is 0 and the SD is 1, within a fifth or 5 SD of what so many draws give: an estimator is
        neither worse nor better than it says."""
        apart = max(OFF_Z_MEAN, 5.0 * self.sd / np.sqrt(self.n))
        off = max(OFF_Z_SD, 5.0 / np.sqrt(2.0 * self.n))
        return bool(abs(self.mean) <= apart and abs(self.sd - 1.0) <= off)


@dataclass(frozen=True, kw_only=True)
class Proof:
    """Of one fault. errs: z of every quantity whose estimator errs by chance; bounded: how many others err by
    a bound that is not chance. z_mean, z_sd: of all z together; None where none errs by chance. bad: honest
    receipts that did not match. off_draw: quantities that are drawn otherwise than asked for. rises: None
    where a fault has no severities."""

    fault: str
    tried: tuple[Tried, ...]
    draws: int
    receipts: int
    verified: int
    bad: int
    off_draw: tuple[str, ...]
    errs: tuple[Scatter, ...]
    bounded: int
    effects: tuple[float | None, ...]
    rises: bool | None

    @property
    def missed(self) -> tuple[str, ...]:
        return tuple(f"{t.kind}: {t.name}" for t in self.tried if t.outcome == MISSED)

    @property
    def z_n(self) -> int:
        return sum(one.n for one in self.errs)

    @property
    def z_mean(self) -> float | None:
        return sum(one.n * one.mean for one in self.errs) / self.z_n if self.errs else None

    @property
    def z_sd(self) -> float | None:
        """About the mean of all."""
        if (mean := self.z_mean) is None:
            return None
        square = sum(one.n * (one.sd**2 + (one.mean - mean) ** 2) for one in self.errs) / self.z_n
        return float(np.sqrt(square))

    @property
    def z_holds(self) -> bool:
        """Of every quantity by itself: two that are wrong in opposite ways are not right together."""
        return all(one.holds for one in self.errs)

    @property
    def bad_by_chance(self) -> int:
        """So many honest receipts may not match: each draw strays beyond its interval once in a million, more
        of them come once in a thousand proofs."""
        return int(np.ceil(pdtrik(0.999, 1e-6 * max(self.receipts, 1))))

    @property
    def good(self) -> bool:
        """Everything holds."""
        effective = (
            self.bad <= self.bad_by_chance
            and self.verified > 0
            and not self.off_draw
            and self.rises is not False
        )
        return not self.missed and effective and self.z_holds


Drawn = tuple[Receipt, ...]
"""All receipts of one draw."""


@dataclass(frozen=True, kw_only=True)
class Trials:
    """What became of all mutants of a fault; the size of its effect, severity by severity."""

    tried: tuple[Tried, ...]
    effects: tuple[float | None, ...]
    rises: bool | None


def prove(fault: str, draws: int) -> Proof:
    """Prove one fault by its name with so many honest draws."""
    return proof_of(fault, trials(fault), honest_draws(fault, range(draws)))


def honest_draws(fault: str, seeds: range) -> tuple[Drawn, ...]:
    """What the receipts say of the fault as it is, seed by seed."""
    place, levels = place_where(FAULTS[fault]), levels_of(fault)
    return tuple(_honest(place, levels[min(LEVEL, len(levels)) - 1], seed) for seed in seeds)


def trials(fault: str) -> Trials:
    """All mutants of a fault, and all of its severities."""
    place, cameras = place_where(FAULTS[fault]), tuple(measured().staged.rig.cameras)
    levels = levels_of(fault)
    spec = levels[min(LEVEL, len(levels)) - 1]
    effects = _effects(place, levels, draws=1)
    if not _rises(effects):  # one draw of a rare thing may be less than another: then on average
        effects = _effects(place, levels, draws=FEW)
    return Trials(
        tried=tuple(
            _tried(place, mutant) for asked in _asked(spec, levels) for mutant in mutants(asked, cameras)
        ),
        effects=effects,
        rises=None if _words_mean_different_things(spec) else _rises(effects),
    )


def proof_of(fault: str, made: Trials, honest: Sequence[Drawn]) -> Proof:
    """The proof from its parts."""
    found = [receipt for drawn in honest for receipt in drawn]
    errs, bounded = scatters(found)
    return Proof(
        fault=fault,
        tried=made.tried,
        draws=len(honest),
        receipts=len(found),
        verified=sum(r.status == OK and r.requested != 0.0 for r in found),
        bad=sum(r.status == MISMATCH for r in found),
        off_draw=tuple(sorted(q for q in _off_draw(honest) if _varies(honest, q))),
        errs=errs,
        bounded=bounded,
        effects=made.effects,
        rises=made.rises,
    )


def levels_of(fault: str) -> tuple[FaultSpec, ...]:
    """Severities 1 to 5; of a fault without any, its words, or a recorded trace more and more."""
    spec = FAULTS[fault]
    if spec is Trace:
        return tuple(Trace(file=a_trace(), scale=scale) for scale in (0.25, 0.5, 1.0, 2.0, 4.0))
    try:
        return tuple(severe(fault, level) for level in range(1, 6))
    except BadInput:
        words = spec.strength_words()
        if not words:
            raise
        return tuple(spec.model_validate({spec.strength: word}) for word in words[1:])


def _words_mean_different_things(spec: FaultSpec) -> bool:
    """The words of a road are more and more of one thing; those of a mix-up are not."""
    return bool(spec.strength_words()) and not isinstance(spec, RoadShake)


def _asked(spec: FaultSpec, levels: tuple[FaultSpec, ...]) -> tuple[FaultSpec, ...]:
    """What mutants are made of: one severity, or every word where words mean different things."""
    return levels if _words_mean_different_things(spec) else (spec,)


def _honest(place: Proving, spec: FaultSpec, seed: int) -> tuple[Receipt, ...]:
    return place.look(spec, place.make((spec,), seed), seed)


def _tried(place: Proving, mutant: Mutant) -> Tried:
    """A mutant is caught when a receipt does not match, whether the wrong injector reports what it should
    have drawn or what it drew. What it drew may by chance be what was asked for; then several draws together
    tell. One that cannot act at all ends its run as an error, which is seen too."""
    honest = place.make((mutant.honest,), 0)
    try:
        wrong = place.make(mutant.specs, 0)
        if same(wrong.data, honest.data):
            outcome = SAME
        elif not _mismatch(place.look(mutant.honest, replace(wrong, realised=honest.realised), 0)):
            outcome = MISSED
        else:
            outcome = CAUGHT if _seen(place, mutant) else MISSED
    except Exception:  # a mutant may ask for anything: chances above 1, ranges below 0
        outcome = CRASHED
    return Tried(kind=mutant.kind, name=mutant.name, outcome=outcome)


def _seen(place: Proving, mutant: Mutant) -> bool:
    """Whether an injector that reports what it wrongly drew is seen, at once or in several draws."""
    found = []
    for seed in range(FEW):
        found.append(place.look(mutant.honest, place.make(mutant.specs, seed), seed))
        if _mismatch(found[-1]):
            return True
    honest = [_honest(place, mutant.honest, seed) for seed in range(FEW)]
    return bool(_off_draw(found) - _off_draw(honest))


def _mismatch(found: Iterable[Receipt]) -> bool:
    return any(receipt.status == MISMATCH for receipt in found)


def _off_draw(found: Sequence[Iterable[Receipt]]) -> frozenset[str]:
    """Quantities whose draws, taken together, are not what was asked for: the mean of realised - requested
    over n draws lies farther from 0 than one draw may over sqrt(n): `allowed`, or 5 SD of the draws where
    those are more. What is rounded to whole fixes or frames the same in every draw may be among them."""
    apart: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for drawn in found:
        for r in drawn:
            apart[r.quantity].append((r.realised - r.requested, r.allowed))
    table = {quantity: np.array(rows) for quantity, rows in apart.items()}
    return frozenset(
        quantity
        for quantity, rows in table.items()
        if abs(rows[:, 0].mean()) > max(rows[:, 1].mean(), 5.0 * rows[:, 0].std()) / np.sqrt(len(rows)) + 1e-9
    )


def _varies(found: Sequence[Iterable[Receipt]], quantity: str) -> bool:
    return len({r.realised for drawn in found for r in drawn if r.quantity == quantity}) > 1


def scatters(found: Iterable[Receipt]) -> tuple[tuple[Scatter, ...], int]:
    """z of all quantities whose estimator errs by chance, and how many quantities are bounded. What a fault
    must leave alone is told of the worst sensor only and has no z."""
    by_quantity: dict[str, list[Receipt]] = defaultdict(list)
    for r in found:
        if r.measured is not None and (r.requested, r.realised, r.allowed) != (0.0, 0.0, 0.0):
            by_quantity[r.quantity].append(r)
    errs, bounded = list[Scatter](), 0
    for quantity, rows in by_quantity.items():
        sd = np.array([r.estimator_sd for r in rows])
        most = np.array([r.systematic for r in rows])
        if not sd.all() or np.median(most / sd) > BOUNDED:
            bounded += bool(sd.any())
            continue
        z = np.array([float(r.measured or 0.0) - r.realised for r in rows]) / sd
        spread = float(z.std(ddof=1)) if len(z) > 1 else 1.0  # one draw does not scatter
        errs.append(Scatter(quantity=quantity, n=len(z), mean=float(z.mean()), sd=spread))
    return tuple(errs), bounded


def _effects(place: Proving, levels: Sequence[FaultSpec], draws: int) -> tuple[float | None, ...]:
    return tuple(_effect([_honest(place, level, seed) for seed in range(draws)]) for level in levels)


def _effect(found: Sequence[tuple[Receipt, ...]]) -> float | None:
    """The size of the first thing that was asked for, over some draws."""
    first = [next((r for r in drawn if r.requested != 0.0), None) for drawn in found]
    sizes = [abs(r.measured) for r in first if r is not None and r.measured is not None]
    return float(np.mean(sizes)) if len(sizes) == len(found) else None


def _rises(effects: tuple[float | None, ...]) -> bool:
    return all(
        weak is not None and strong is not None and weak < strong for weak, strong in pairwise(effects)
    )
