"""Loading: a scenario file becomes a `Family`, and a seed makes a concrete `Scenario` of it.

    family = load_scenario("overtake-approach")
    scenario = family.resolve(seed=3)

A file is checked once for all seeds: with every distribution at its lowest and highest value and at each of
its choices. Whatever is wrong raises `BadInput`, with file, line and field.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarios.categories import SIZE_SPREAD
from scenarios.changes import changed
from scenarios.distributions import Distribution, Uniform, Value, corners, find_distributions, substitute
from scenarios.equipment import list_rigs, list_sensors, load_rig, load_sensor
from scenarios.errors import BadInput, FieldPath, Where, show
from scenarios.library import find, names, shown, user_file
from scenarios.seeding import LARGEST_SEED, stream
from scenarios.yaml_source import read_yaml

if TYPE_CHECKING:
    from scenarios.fault_set import FaultSet
    from scenarios.scenario import Rig, Scenario, Sensor, System

__all__ = [
    "BadInput",
    "Family",
    "list_rigs",
    "list_scenarios",
    "list_sensors",
    "load_rig",
    "load_scenario",
    "load_sensor",
]


@dataclass(frozen=True, kw_only=True)
class Family:
    """A scenario file: one concrete scenario per seed.

    tree: the file's plain data. where: its name and lines. beside: the folder of a user's own file, where its
    rigs and sensors may lie; None for the catalogue. distributions: what the seed decides, by path; among
    them the size of every actor without a `scale`, the ego excepted (uniform, ±8 %).
    """

    name: str
    description: str
    system_names: tuple[str, ...]
    tree: Mapping[str, Any]
    where: Where
    beside: Path | None
    distributions: Mapping[FieldPath, Distribution]

    def resolve(self, seed: int) -> Scenario:
        """The concrete scenario of a seed.

        BadInput: the seed is out of range, or the numbers it draws do not go together.
        """
        if not 0 <= seed <= LARGEST_SEED:
            raise BadInput(f"seed {show(seed)} is out of range", allowed="whole numbers from 0 to 2^63 - 1")
        values = {
            path: distribution.draw(stream(seed, "scenario", *path))
            for path, distribution in self.distributions.items()
        }
        return self._concrete(values, f"as seed {seed} draws it")

    def system(self, name: str, *, seed: int) -> System:
        """One system of the concrete scenario. BadInput: there is no such system."""
        if name not in self.system_names:
            raise self.where.unknown("system", name, self.system_names, ("systems",))
        return self.resolve(seed).system(name)

    def faults(self, seed: int) -> FaultSet:
        """The faults that the file itself asks for."""
        return self.fault_set(self.resolve(seed))

    def fault_set(self, scenario: Scenario) -> FaultSet:
        """The faults of one of this family's concrete scenarios."""
        from scenarios.fault_set import parse_faults

        return parse_faults(scenario.faults, self.where.at("faults"))

    def rig(self, name: str) -> Rig:
        """A rig that this family's systems may name."""
        return load_rig(name, self.beside)

    def sensor(self, name: str) -> Sensor:
        """A sensor that those rigs may name."""
        return load_sensor(name, self.beside)

    def check(self) -> None:
        """BadInput: with some distribution at an end, the file is no scenario."""
        for values in corners(self.distributions):
            self._concrete(values, "at an end of its distribution")

    def _concrete(self, values: Mapping[FieldPath, Value], when: str) -> Scenario:
        from scenarios.checks import check_scenario
        from scenarios.fault_set import parse_faults
        from scenarios.scenario import Scenario
        from scenarios.validate import validate

        scenario = validate(Scenario, substitute(self.tree, values), self.where, tuple(values), when)
        drawn = [path[1:] for path in values if path[0] == "faults"]
        faults = parse_faults(scenario.faults, self.where.at("faults"), drawn=drawn)
        check_scenario(scenario, faults, self.where, self.beside, f" {when}" if values else "")
        return scenario


def list_scenarios() -> tuple[str, ...]:
    """Names of the catalogue."""
    return names("scenario")


def load_scenario(name_or_path: str, changes: Sequence[str] = ()) -> Family:
    """The family of a catalogue name, or of a path to a .yaml file, with some values replaced (`changes.py`).
    BadInput: unknown or malformed.
    """
    path = user_file(name_or_path, "scenario")
    if path is None:
        document = read_yaml(ours := find("scenario", name_or_path), shown(ours))
    else:
        document = read_yaml(path, name_or_path)
    tree, where = document.data, document.where
    if not isinstance(tree, dict):
        raise where.error(f"a scenario file is a mapping, this one is {show(tree)}")
    if changes:
        tree = changed(tree, changes)
    distributions = find_distributions(tree, where)
    for key in ("name", "description", "systems"):
        if (key,) in distributions or () in distributions:
            raise where.error("must not be a distribution", (key,))
    distributions |= {path: size for path, size in _default_sizes(tree).items() if path not in distributions}
    family = Family(
        name=str(tree.get("name")),
        description=str(tree.get("description")),
        system_names=tuple(tree["systems"]) if isinstance(tree.get("systems"), dict) else (),
        tree=tree,
        where=where,
        beside=path.parent.resolve() if path else None,
        distributions=distributions,
    )
    family.check()
    return family


def _default_sizes(tree: Mapping[str, Any]) -> dict[FieldPath, Distribution]:
    """±8 % for every actor without a scale; the ego keeps its size, to which its rig was fitted."""
    sizes: dict[FieldPath, Distribution] = {}
    systems = tree.get("systems")
    for system_name, system in systems.items() if isinstance(systems, dict) else ():
        actors = system.get("actors") if isinstance(system, dict) else None
        for name, actor in actors.items() if isinstance(actors, dict) else ():
            if isinstance(actor, dict) and "scale" not in actor and name != system.get("ego"):
                path = ("systems", system_name, "actors", name, "scale")
                sizes[path] = Uniform(low=1.0 - SIZE_SPREAD, high=1.0 + SIZE_SPREAD)
    return sizes
