"""What a stress test varies: a field of a fault, or a value of the scenario file.

timing.trigger_offset_ms=0:150:7         seven values from 0 to 150, the ends among them
timing.trigger_offset_ms.jitter_ms=0:10  a field that is not the fault's strength; the count is the plan's
motion.road=A,B,C                        a list
systems.car.duration_s=3:6:4             a value of the scenario file
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from scenarios.errors import Where, show
from scenarios.faults import FAULTS
from scenarios.validate import validate
from scenarios.yaml_source import parse_yaml

OPTION = "--vary"
DEFAULT_COUNT = 5
MOST_VALUES = 1000

Value = float | str


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One thing that is varied. `fault` None: `path` leads through the scenario file; else it is a field.

    values: those of a grid, in order. spread: whether values in between make sense too (it was LOW:HIGH).
    """

    name: str
    fault: str | None
    path: str
    values: tuple[Value, ...]
    spread: bool

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value of a spread axis."""
        return float(self.values[0]), float(self.values[-1])


Point = tuple[Value, ...]
"""A value for every axis, in their order."""


def parse_axes(arguments: Sequence[str], option: str = OPTION) -> tuple[Axis, ...]:
    """The axes that the values of `--vary` ask for (of `option`, when it is another's). BadInput: malformed,
    unknown, out of range, or twice."""
    axes = tuple(_parse(argument.strip(), option) for argument in arguments)
    names = [axis.name for axis in axes]
    for name in names:
        if names.count(name) > 1:
            raise Where(file=option).error(f"{name} is varied twice")
    return axes


def _parse(argument: str, option: str) -> Axis:
    where = Where(file=option)
    name, equals, text = (part.strip() for part in argument.partition("="))
    if not equals or not name or not text:
        raise where.error(f"is NAME=LOW:HIGH:COUNT or NAME=A,B,C; this is {show(argument)}")
    fault, path = _what(name, where)
    values, spread = _values(name, text, where)
    if fault is not None:
        for value in values:
            validate(FAULTS[fault], {path: value}, where.at(fault))
    return Axis(name=name, fault=fault, path=path, values=values, spread=spread)


def _what(name: str, where: Where) -> tuple[str | None, str]:
    """The fault and its field, or None and a path in the scenario file."""
    if name in FAULTS:
        return name, FAULTS[name].strength
    fault, _, field = name.rpartition(".")
    if fault in FAULTS:
        if field not in FAULTS[fault].model_fields:
            raise where.unknown("field", field, tuple(FAULTS[fault].model_fields), (fault,))
        return fault, field
    family = name.partition(".")[0]
    if family in {known.partition(".")[0] for known in FAULTS}:
        raise where.unknown("fault", name, FAULTS)
    return None, name


def _values(name: str, text: str, where: Where) -> tuple[tuple[Value, ...], bool]:
    if ":" not in text:
        listed = tuple(_word(word, name, where) for word in text.split(","))
        if len(listed) < 2:
            raise where.error(f"{name} needs two values or more, or LOW:HIGH:COUNT; this is {show(text)}")
        return listed, False
    parts = [part.strip() for part in text.split(":")]
    if len(parts) not in (2, 3):
        raise where.error(f"{name} is LOW:HIGH:COUNT; this is {show(text)}")
    low, high = (_number(part, name, where) for part in parts[:2])
    if not low < high:
        raise where.error(f"{name}: {low:g} is not below {high:g}")
    if len(parts) == 3 and not (parts[2].isdecimal() and 2 <= int(parts[2]) <= MOST_VALUES):
        raise where.error(f"{name}: the count is {show(parts[2])}", allowed=f"2 to {MOST_VALUES}")
    count = int(parts[2]) if len(parts) == 3 else DEFAULT_COUNT
    return tuple(float(f"{value:.9g}") for value in np.linspace(low, high, count)), True


def _number(text: str, name: str, where: Where) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise where.error(f"{name}: {show(text)} is no number")
    return value


def _word(text: str, name: str, where: Where) -> Value:
    value = parse_yaml(text.strip(), f"{where.file} {name}").data
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise where.error(f"{name}: {show(value)} is neither a number nor a word")
    return value if isinstance(value, str) else float(value)


def fault_arguments(axes: Sequence[Axis], point: Point) -> tuple[str, ...]:
    """What `--faults` is given at a point: one argument a fault, with all of its varied fields."""
    fields: dict[str, dict[str, Value]] = {}
    for axis, value in zip(axes, point, strict=True):
        if axis.fault is not None:
            fields.setdefault(axis.fault, {})[axis.path] = value
    return tuple(f"{fault}={_flow(values)}" for fault, values in fields.items())


def scenario_changes(axes: Sequence[Axis], point: Point) -> tuple[str, ...]:
    """What `--set` is given at a point."""
    pairs = zip(axes, point, strict=True)
    return tuple(f"{axis.path}={shown(value)}" for axis, value in pairs if axis.fault is None)


def _flow(values: Mapping[str, Value]) -> str:
    return "{" + ", ".join(f"{key}: {shown(value)}" for key, value in values.items()) + "}"


def shown(value: Value) -> str:
    """A value as it stands in a command."""
    return value if isinstance(value, str) else f"{value:.9g}"
