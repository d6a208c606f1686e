"""What every pipeline is asked: the conformance kit, and relations between answers that need no threshold.

Each relation says what must stay the same when the question is put otherwise, so none needs to know what a
good answer is. Why each must hold, and to what tolerance, is said in its file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from fusion.check import check_pipeline
from simbench.checks import finer, mirror, offset, permute, retold, unseen
from simbench.checks.drives import recorded, told
from simbench.checks.finding import Finding, PipelineError, Story
from simbench.plugins import Factory

SEEDS, QUICK_SEEDS = tuple(range(12)), tuple(range(6))  # 6: the fewest that allow an interval


@dataclass(frozen=True, kw_only=True)
class Relation:
    """`says`: the claim in a few words. `find` asks a pipeline, with seeds for where one is too few.

    What the pipeline raises passes through `find` as `PipelineError`.
    """

    name: str
    says: str
    find: Callable[[Factory, Sequence[int]], Finding]


def conformance(factory: Factory, _: Sequence[int]) -> Finding:
    """The contract, by `fusion.check`."""
    failures = check_pipeline(factory)
    if not failures:
        return Finding(verdict="holds", why="no failure")
    return Finding(verdict="does not hold", why=f"{len(failures)} failures, first: {failures[0]}")


def _exact(find: Callable[[Factory, Story], Finding]) -> Callable[[Factory, Sequence[int]], Finding]:
    """A relation of one drive, exact up to rounding: more seeds would say no more."""
    return lambda factory, seeds: find(factory, told(recorded(seeds[0])))


def _actor(factory: Factory, seeds: Sequence[int]) -> Finding:
    return unseen.find_actor(factory, told(recorded(seeds[0])), told(recorded(seeds[0], unseen=True)))


RELATIONS: tuple[Relation, ...] = (
    Relation(name="conformance", says="the contract is kept", find=conformance),
    Relation(name="mirror", says="a mirrored scene gives a mirrored result", find=_exact(mirror.find)),
    Relation(name="unseen actor", says="an actor out of view changes nothing", find=_actor),
    Relation(name="blind camera", says="a box of nothing changes nothing", find=_exact(unseen.find_camera)),
    Relation(name="point order", says="permuted points are the same objects", find=_exact(permute.find)),
    Relation(
        name="LiDAR frame", says="a turned LiDAR frame changes nothing", find=_exact(retold.find_turned)
    ),
    Relation(name="time of day", says="an hour later changes nothing", find=_exact(retold.find_later)),
    Relation(name="finer scan", says="twice the columns lose no precision", find=finer.find),
    Relation(name="offset sign", says="opposite offsets shift oppositely", find=offset.find),
)


def check(factory: Factory, seeds: Sequence[int]) -> Iterator[tuple[Relation, Finding]]:
    """Every relation with what was found, one by one. A pipeline that raises does not hold."""
    for relation in RELATIONS:
        try:
            yield relation, relation.find(factory, seeds)
        except PipelineError as error:
            yield relation, Finding(verdict="does not hold", why=str(error))
