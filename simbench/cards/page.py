"""The card of a data set: what, how, statistics, and how it compares with recorded data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from simbench.cards.compare import Compared, compare
from simbench.cards.figures import comparisons, histograms
from simbench.cards.statistics import Sight, column
from simbench.files import write_text
from simbench.report import palette

NAME = "card.html"
NOT_COVERED = (
    "Rain, fog, spray, dust, dirt on a lens or window, sun into a lens, headlights at night.",
    "LiDAR effects beyond range noise, intensity, lost beams and false points: multiple returns, blooming of "
    "reflectors, crosstalk between LiDARs, glass and wet surfaces.",
    "Detectors: boxes come from a model of a detector's errors; no network has seen the pictures.",
    "Traffic: one overtaking and a few bystanders on a flat lot; no crossings, slopes, crowds, animals.",
    "Shapes: people, e-scooters, cars and vans in few variants; no bicycles, motorcycles, trucks, loads.",
    "Networks trained on these pictures or points: whether what they learn holds on the road was not tested.",
)
SHOWN = ("range_m", "points", "visible", "speed_mps", "height_px", "intensity", "noise_m")


@dataclass(frozen=True, kw_only=True)
class Made:
    """A recording of the set, or why it is not there. split: where it belongs ('': no splits)."""

    name: str
    status: str
    why: str | None
    scenario: str
    system: str
    seed: int
    split: str
    size_bytes: int


@dataclass(frozen=True, kw_only=True)
class Beside:
    """Recorded data to compare with: where from, what it is in words, and its sightings."""

    path: str
    words: str
    sights: tuple[Sight, ...]


def write_card(
    made: Sequence[Made], sights: Sequence[Sight], out: Path, *, title: str, command: str,
    required: Sequence[str] = (), beside: Beside | None = None,
) -> Path:  # fmt: skip
    """Write `out/card.html` and return its path. Same data, same bytes."""
    template = Environment(
        loader=PackageLoader("simbench.cards", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    ).get_template("card.html.j2")  # fmt: skip
    good = [row for row in made if row.status == "ok"]
    splits = [name for name in ("train", "val", "test") if any(row.split == name for row in good)]
    rows = tuple(sights)
    compared: tuple[Compared, ...] = () if beside is None else compare(rows, beside.sights)
    size = sum(row.size_bytes for row in good)
    page = template.render(
        title=title,
        sentence=f"{len(good)} recordings, {size / 1e6:.0f} MB.",
        bad=[row for row in made if row.status not in ("ok", "rejected")],
        rejected=[row for row in made if row.status == "rejected"],
        required=required,
        groups=_groups(good, splits),
        splits=splits,
        sightings=len(rows),
        histograms=histograms(rows),
        lines=_lines(rows),
        compared=[row for row in compared if row.known],
        unmatched=sorted({row.category for row in compared if row.unmatched}),
        is_beside=beside is not None,
        comparisons=() if beside is None else comparisons(rows, beside.sights),
        beside="" if beside is None else beside.path,
        beside_words="" if beside is None else beside.words,
        not_covered=NOT_COVERED,
        command=command,
        version=version("simbench"),
        c=palette,
    )
    path = out / NAME
    write_text(path, page)
    return path


def _groups(good: Sequence[Made], splits: Sequence[str]) -> list[dict[str, Any]]:
    found: dict[tuple[str, str], list[Made]] = {}
    for row in good:
        found.setdefault((row.scenario, row.system), []).append(row)
    return [
        {
            "scenario": scenario,
            "system": system,
            "seeds": _span([row.seed for row in rows]),
            "count": len(rows),
            "splits": [sum(row.split == name for row in rows) for name in splits],
            "mb": f"{sum(row.size_bytes for row in rows) / 1e6:.0f}",
        }
        for (scenario, system), rows in found.items()
    ]


def _span(seeds: Sequence[int]) -> str:
    low, high = min(seeds), max(seeds)
    return f"{low}" if low == high else f"{low} to {high}"


def _lines(rows: tuple[Sight, ...]) -> list[Mapping[str, Any]]:
    lines: list[Mapping[str, Any]] = []
    for category in sorted({row.category for row in rows}):
        mine = tuple(row for row in rows if row.category == category)
        lines.append(
            {
                "category": category,
                "objects": len({row.object for row in mine}),
                "count": len(mine),
                "cells": [_spread(column(mine, name)) for name in SHOWN],
            }
        )
    return lines


def _spread(values: np.ndarray) -> str:
    """Median [5th, 95th percentile]."""
    if not len(values):
        return "–"
    low, middle, high = np.percentile(values, [5.0, 50.0, 95.0])
    return f"{middle:.3g} [{low:.3g}, {high:.3g}]"
