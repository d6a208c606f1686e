"""The palette of materials, and which of them a part is made of."""

from __future__ import annotations

from functools import lru_cache
from typing import Any
from xml.etree import ElementTree

from scenarios.library import PACKAGE, find, shown
from scenarios.yaml_source import read_yaml

PALETTE = PACKAGE / "parts" / "materials.yaml"


@lru_cache(maxsize=1)
def palette() -> dict[str, dict[str, Any]]:
    """Every material by its name: colours, reflectivity and what else `parts/materials.yaml` says of it."""
    loaded: dict[str, dict[str, Any]] = read_yaml(PALETTE, shown(PALETTE)).data
    return loaded


@lru_cache(maxsize=64)
def materials_of(part: str) -> tuple[str, ...]:
    """Names of the materials that a part is made of, as its file lists them. BadInput: unknown part."""
    declared = ElementTree.parse(find("part", part)).getroot().iterfind("asset/material")
    return tuple(name for material in declared if (name := material.get("name")))
