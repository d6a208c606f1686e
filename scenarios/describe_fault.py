"""A fault in words: what goes wrong, its formula and source, its fields, and what severities 1 to 5 mean."""

from __future__ import annotations

import inspect
from collections.abc import Mapping

from scenarios.errors import BadInput, nearest
from scenarios.faults import FAULTS, FaultSpec
from scenarios.faults.spec import Level
from scenarios.severity import SEVERITIES


def describe_fault(name: str) -> str:
    """Several lines. BadInput: there is no such fault."""
    spec = FAULTS.get(name)
    if spec is None:
        raise BadInput(f"unknown fault '{name}'", hint=nearest(name, FAULTS), allowed=", ".join(FAULTS))
    lines = [name, "", *inspect.cleandoc(spec.__doc__ or "").splitlines(), "", "Fields:"]
    for field, info in spec.model_fields.items():
        mark = "  (a bare value sets this)" if field == spec.strength else ""
        lines.append(f"  {field} = {_shown(info.default)}{mark}")
    for severity in SEVERITIES:
        if severity.fault != name:
            continue
        body = "" if severity.profile is None else f" on the {severity.profile}"
        lines += ["", f"Severities{body} ({severity.source}):"]
        for level, value in enumerate(severity.values, start=1):
            lines.append(f"  {level}  {_argument(spec, value)}")
    return "\n".join(lines)


def _argument(spec: type[FaultSpec], value: Level) -> str:
    """What `--faults` takes for it."""
    if isinstance(value, Mapping):
        return f"{spec.name}={{" + ", ".join(f"{key}: {_shown(v)}" for key, v in value.items()) + "}"
    return f"{spec.name}={_shown(value)}"


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
