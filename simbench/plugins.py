"""Pipelines by name: an entry point of the group `simbench.pipelines`, `module:attribute`, or
`file.py:attribute`.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import traceback
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, cast

from fusion.pipeline import Pipeline
from scenarios.errors import BadInput, nearest

GROUP = "simbench.pipelines"
Factory = Callable[[], Pipeline]


def pipeline_names() -> tuple[str, ...]:
    """All pipelines that are installed by name."""
    return tuple(sorted({point.name for point in entry_points(group=GROUP)}))


def load_pipeline(name: str) -> Factory:
    """The factory behind a name. BadInput when there is none, or when it has not the three methods."""
    points = {point.name: point for point in entry_points(group=GROUP)}
    if name in points:
        factory = _imported(name, points[name].load)
    elif name.startswith("exec:"):
        raise BadInput(f"pipeline '{name}' is a program, and a Python pipeline is needed here")
    elif ":" in name:
        factory = _from_reference(name)
    else:
        raise BadInput(
            f"unknown pipeline '{name}'",
            allowed=", ".join([*sorted(points), "module:attribute", "file.py:attribute"]),
            hint=nearest(name, points),
        )
    missing = [m for m in ("reset", "update", "trajectories") if not callable(getattr(factory, m, None))]
    if isinstance(factory, type) and missing:
        raise BadInput(f"pipeline '{name}' has no method {missing[0]}", allowed="reset, update, trajectories")
    if not callable(factory):
        raise BadInput(f"pipeline '{name}' is not callable", allowed="a class, or a function that makes one")
    return cast(Factory, factory)


def last_line(error: BaseException) -> str:
    """What a pipeline raised and where, on one line."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text} (line {place.lineno} of {place.name})"


def _from_reference(reference: str) -> Any:
    where, _, attribute = reference.rpartition(":")
    if where.endswith(".py"):
        path = Path(where)
        if not path.is_file():
            raise BadInput(f"pipeline '{reference}': there is no file {where}")
        spec = importlib.util.spec_from_file_location(f"simbench_user_{path.stem}", path)
        if spec is None or spec.loader is None:
            raise BadInput(f"pipeline '{reference}': {where} is not a Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        load: Callable[[], Any] = lambda: spec.loader.exec_module(module)  # type: ignore[union-attr]  # noqa: E731
    else:
        load = lambda: importlib.import_module(where)  # noqa: E731
    loaded = _imported(reference, load)
    module = loaded if loaded is not None else module
    if not hasattr(module, attribute):
        public = [n for n in vars(module) if not n.startswith("_")]
        close = nearest(attribute, public)
        raise BadInput(f"pipeline '{reference}': {where} has no '{attribute}'", hint=close)
    return getattr(module, attribute)


def _imported(name: str, load: Callable[[], Any]) -> Any:
    """What `load` gives. BadInput with the reason where it raises, or where the module ends the program."""
    try:
        return load()
    except (Exception, SystemExit) as error:  # the user's module may raise anything at import
        why = " ".join(str(error).split())
        raise BadInput(f"pipeline '{name}' cannot be imported: {type(error).__name__}: {why}") from error
