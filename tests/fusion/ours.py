"""Every pipeline that this project installs by name: what a law of all pipelines is asked of."""

from __future__ import annotations

import importlib
import tomllib
from collections.abc import Callable
from pathlib import Path

from fusion.pipeline import Pipeline

_PYPROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"


def _factories() -> dict[str, Callable[[], Pipeline]]:
    table = tomllib.loads(_PYPROJECT.read_text(encoding="utf-8"))
    found = {}
    for name, reference in table["project"]["entry-points"]["simbench.pipelines"].items():
        module, attribute = reference.split(":")
        found[name] = getattr(importlib.import_module(module), attribute)
    return found


OURS = _factories()
