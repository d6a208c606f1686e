"""A regression suite: which drives, errors and pipelines are run, what they must keep, what may get worse.

A suite file is a mapping of blocks; a block is scenarios x systems x fault sets x seeds x pipelines. What
a block does not say, it takes from the suite. Metrics are not known here: `simbench/suite` checks them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from scenarios.errors import BadInput, Where, show
from scenarios.library import find, names, shown, user_file
from scenarios.scenario import Name, Positive, Share, Spec, broken
from scenarios.seeding import seed_list
from scenarios.validate import validate
from scenarios.yaml_source import read_yaml

Word = Annotated[str, Field(min_length=1, max_length=400)]
Margins = Mapping[Word, Positive]
Limits = Mapping[Word, Word]
OWN = "own"


class Block(Spec):
    """Scenarios x systems x fault sets x seeds x pipelines, all held to the same limits.

    faults: each entry is what `--faults` takes, or a list of those, on top of the scenario's own; `own` is
    just these, `none` clears them. change: values of the scenario file, as `--set` takes them. seeds,
    pipelines: in place of the suite's; limits, margins: besides the suite's. failed_runs: the share of runs
    that may have a gross failure (off by more than 1 m, or no position).
    """

    scenarios: tuple[Word, ...] = Field(min_length=1)
    systems: tuple[Literal["car", "wearable"], ...] = Field(default=("car",), min_length=1)
    faults: tuple[Word | tuple[Word, ...], ...] = Field(default=("none",), min_length=1)
    change: tuple[Word, ...] = ()
    seeds: str | int | None = None
    pipelines: tuple[Word, ...] | None = Field(default=None, min_length=1)
    tags: tuple[Name, ...] = ()
    limits: Limits = Field(default_factory=dict)
    margins: Margins = Field(default_factory=dict)
    failed_runs: Share | None = None
    images: Literal["none", "raycast"] = "none"
    boxes: Literal["labels", "model"] | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Block:
        for field in ("scenarios", "systems", "faults", "pipelines", "tags"):
            values = getattr(self, field) or ()
            for i, value in enumerate(values):
                if value in values[:i]:
                    raise broken("stands here twice", field, i)
        _check_seeds(self.seeds)
        return self


class Suite(Spec):
    """A suite. metrics: those of which a baseline is asked whether they got worse, by more than `margin`
    (in the unit of the metric) or their own one of `margins`. canary: an error that is asked for and not
    injected, in a case that must fail."""

    name: Name
    description: Word
    seeds: str | int = "0-19"
    pipelines: tuple[Word, ...] = Field(default=("robust",), min_length=1)
    metrics: tuple[Word, ...] = Field(
        default=("precision", "recall", "coverage.smooth", "mae_m"), min_length=1
    )
    margin: Positive = 0.05
    margins: Margins = Field(default_factory=dict)
    limits: Limits = Field(default_factory=dict)
    failed_runs: Share | None = None
    canary: Word = "timing.clock_offset_ms=50"
    blocks: Mapping[Name, Block] = Field(min_length=1)

    @model_validator(mode="after")
    def _consistent(self) -> Suite:
        _check_seeds(self.seeds)
        return self


@dataclass(frozen=True, kw_only=True)
class SuiteFile:
    """A suite with the place it was read from."""

    suite: Suite
    where: Where
    path: Path


def list_suites() -> tuple[str, ...]:
    """Names of the suites that come with the package."""
    return names("suite")


def is_suite(name_or_path: str) -> bool:
    """Whether a target of `simbench run` is a suite: by its name, or a file that has blocks."""
    path = user_file(name_or_path, "suite")
    if path is None:
        return name_or_path in list_suites()
    return path.is_file() and _has_blocks(path, name_or_path)


def load_suite(name_or_path: str) -> SuiteFile:
    """The suite of a name, or of a path to a .yaml file. BadInput: unknown or malformed."""
    path = user_file(name_or_path, "suite")
    if path is None:
        document = read_yaml(path := find("suite", name_or_path), shown(path))
    else:
        document = read_yaml(path, name_or_path)
    if not isinstance(document.data, dict):
        raise document.where.error(f"a suite is a mapping, this file is {show(document.data)}")
    return SuiteFile(suite=validate(Suite, document.data, document.where), where=document.where, path=path)


def _check_seeds(text: str | int | None) -> None:
    if text is not None:
        try:
            seed_list(str(text))
        except ValueError as error:
            raise broken(str(error), "seeds") from None


def _has_blocks(path: Path, name: str) -> bool:
    try:
        data = read_yaml(path, name).data
    except BadInput:
        return False  # whoever reads it as a scenario says what is wrong
    return isinstance(data, dict) and "blocks" in data
