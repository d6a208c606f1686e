"""Sets of faults: as a scenario file holds them, as `--faults` changes them, and how the two combine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from scenarios.errors import BadInput, FieldPath, Where, show
from scenarios.faults import FAULTS, FaultSpec
from scenarios.faults.motion import SHAKERS
from scenarios.faults.spec import Profile
from scenarios.library import find, names, shown, user_file
from scenarios.validate import validate
from scenarios.yaml_source import parse_yaml, read_yaml

Kind = TypeVar("Kind", bound=FaultSpec)

NONE = "none"
OPTION = "--faults"


@dataclass(frozen=True, kw_only=True)
class FaultSet:
    """The faults of a run, ordered by name, none of them off. `label`: what rows and reports call the set."""

    specs: tuple[FaultSpec, ...] = ()
    label: str = field(default=NONE, compare=False)

    def __iter__(self) -> Iterator[FaultSpec]:
        return iter(self.specs)

    def __len__(self) -> int:
        return len(self.specs)

    def get(self, kind: type[Kind]) -> Kind | None:
        """The set's fault of this class, if it holds one."""
        return next((spec for spec in self.specs if isinstance(spec, kind)), None)

    def as_data(self) -> dict[str, dict[str, Any]]:
        """Plain data: fault name to all its fields."""
        return {spec.name: spec.model_dump(mode="json") for spec in self.specs}

    def override(self, change: FaultChange) -> FaultSet:
        """This set with the change's faults in place of its own of the same name, and the others added."""
        kept = {} if change.clears else {spec.name: spec for spec in self.specs}
        label = change.label if change.clears or change.specs else self.label
        return fault_set({**kept, **{spec.name: spec for spec in change.specs}}, label)

    def check(self, cameras: Sequence[str], where: Where) -> None:
        """BadInput: a fault names a camera that is not one of `cameras`, or two faults contradict."""
        shaking = [spec for spec in self.specs if isinstance(spec, SHAKERS)]
        if len(shaking) > 1:
            one, two = shaking[-2:]
            raise where.error(
                f"{one.name} and {two.name} both shake the body; switch one off, as in "
                f"{two.name}={two.off_words()}"
            )
        for spec in self.specs:
            for name in spec.named_cameras:
                if name not in cameras:
                    raise where.unknown("camera", name, cameras, (spec.name, "sensors"))


@dataclass(frozen=True, kw_only=True)
class FaultChange:
    """What `--faults` asks for. `specs` may be off: that removes the fault. `clears`: the others go first."""

    specs: tuple[FaultSpec, ...] = ()
    clears: bool = False
    label: str = NONE

    def then(self, later: FaultChange) -> FaultChange:
        """Both changes in one, `later` winning."""
        if later.clears or not (self.specs or self.clears):
            return later
        if not later.specs:
            return self
        specs = {spec.name: spec for spec in (*self.specs, *later.specs)}
        label = later.label if self.label == NONE else f"{self.label}+{later.label}"
        return FaultChange(
            specs=tuple(specs[name] for name in sorted(specs)), clears=self.clears, label=label
        )


def fault_set(specs: Mapping[str, FaultSpec], label: str) -> FaultSet:
    """The set of those specs that are not off, in the order of their names."""
    active = tuple(specs[name] for name in sorted(specs) if not specs[name].is_off)
    return FaultSet(specs=active, label=label if active else NONE)


def parse_faults(
    raw: Mapping[str, Any], where: Where, label: str = "scenario", drawn: Sequence[FieldPath] = ()
) -> FaultSet:
    """The faults of a plain mapping, e.g. `{"timing.trigger_offset_ms": 50}`.

    where: its place in a file. drawn: paths (within `raw`) that came from a distribution.
    BadInput: an unknown fault or field, a wrong type, a number out of range.
    """
    return fault_set(parse_specs(raw, where, drawn), label)


def parse_specs(raw: object, where: Where, drawn: Sequence[FieldPath] = ()) -> dict[str, FaultSpec]:
    """All specs of a plain mapping by name, those that are off included. BadInput as for `parse_faults`."""
    if not isinstance(raw, Mapping):
        raise where.error(f"must be a mapping of faults, is {show(raw)}")
    specs = {}
    for name, value in raw.items():
        kind = FAULTS.get(name)
        if kind is None:
            raise where.unknown("fault", name, FAULTS, (name,))
        inner = [path[1:] for path in drawn if path[0] == name]
        if isinstance(value, Mapping):
            specs[name] = validate(kind, dict(value), where.at(name), inner, DRAWN)
        elif value is None or isinstance(value, list | tuple | bool):
            words = kind.strength_words()
            what = f"one of {', '.join(words)}" if words else "a number"
            raise where.error(f"must be {what} or a mapping, is {show(value)}", (name,))
        else:
            inner = [(kind.strength,)] if () in inner else []
            specs[name] = validate(kind, {kind.strength: value}, where.at(name), inner, DRAWN)
    return specs


DRAWN = "at an end of its distribution"


def list_fault_sets() -> tuple[str, ...]:
    """Names of the package's fault sets."""
    return names("fault set")


def load_fault_set(name_or_path: str) -> FaultChange:
    """A fault set file by name or path: `description`, `faults`. BadInput: unknown or malformed."""
    path = user_file(name_or_path, "fault set")
    if path is None:
        if name_or_path in FAULTS:
            some = next(reversed(FAULTS[name_or_path].strength_words()), "1")
            raise BadInput(f"{OPTION} {name_or_path}: needs a value, as in {name_or_path}={some}")
        known = {*names("fault set"), NONE}
        if name_or_path not in known:
            raise Where(file=OPTION).unknown("fault set", name_or_path, known)
        path = find("fault set", name_or_path)
        document = read_yaml(path, shown(path))
    else:
        document = read_yaml(path, name_or_path)
    data, where = document.data, document.where
    if not isinstance(data, dict) or "faults" not in data:
        raise where.error("a fault set is a mapping with 'faults'", allowed="description, faults")
    for key in data:
        if key not in ("description", "faults"):
            raise where.unknown("key", key, ("description", "faults"), (key,))
    if not isinstance(data.get("description", ""), str):
        raise where.error(f"must be text, is {show(data['description'])}", ("description",))
    specs = parse_specs(data["faults"], where.at("faults"))
    return FaultChange(specs=_ordered(specs), label=path.stem)


def parse_fault_arguments(arguments: Sequence[str], profile: Profile = "car") -> FaultChange:
    """What the values of `--faults` ask for, later ones winning. Each is the name or path of a fault set,
    `none`, `fault=value` with a number or a mapping like `{offset_ms: 50, jitter_ms: 5}`, or `fault@3` for
    its severity 3 on the body of `profile`.

    BadInput: unknown or malformed.
    """
    change = FaultChange()
    for argument in arguments:
        change = change.then(_parse_argument(argument.strip(), profile))
    return change


def _parse_argument(argument: str, profile: Profile) -> FaultChange:
    if argument == NONE:
        return FaultChange(clears=True)
    if "=" not in argument:
        name, at, level = argument.partition("@")
        return _severe(name, level, profile) if at and "/" not in argument else load_fault_set(argument)
    name, text = argument.split("=", 1)
    where = Where(file=OPTION)
    if name not in FAULTS:
        raise where.unknown("fault", name, FAULTS)
    if not text.strip():
        raise where.error("needs a value", (name,))
    value = parse_yaml(text, f"{OPTION} {name}").data
    return FaultChange(specs=_ordered(parse_specs({name: value}, where)), label=argument)


def _severe(name: str, level: str, profile: Profile) -> FaultChange:
    from scenarios.severity import severe

    where = Where(file=OPTION)
    if name not in FAULTS:
        raise where.unknown("fault", name, FAULTS)
    if not level.isdecimal():
        raise where.error(f"severity must be a whole number, is {show(level)}", (name,), allowed="1 to 5")
    return FaultChange(specs=(severe(name, int(level), profile),), label=f"{name}@{level}")


def _ordered(specs: Mapping[str, FaultSpec]) -> tuple[FaultSpec, ...]:
    return tuple(specs[name] for name in sorted(specs))


def describe_faults() -> list[dict[str, Any]]:
    """What there is to inject, one row per fault.

    Keys: name, summary, unit, bare_number_sets, fields (name to default), severities (a list of
    profile, values, source).
    """
    from scenarios.severity import SEVERITIES

    return [
        {
            "name": name,
            "summary": (spec.__doc__ or "").partition("\n")[0],
            "unit": spec.unit,
            "bare_number_sets": spec.strength,
            "fields": {field: info.default for field, info in spec.model_fields.items()},
            "severities": [
                {"profile": severity.profile, "values": severity.values, "source": severity.source}
                for severity in SEVERITIES
                if severity.fault == name
            ],
        }
        for name, spec in sorted(FAULTS.items())
    ]
