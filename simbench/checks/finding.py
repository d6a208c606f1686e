"""What asking a pipeline gives: its answers or what it raised, and from them a finding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from fusion.messages import Calibration, Measurement
from simbench.drive import Driven, drive
from simbench.plugins import Factory
from simbench.stage import CATEGORIES

Verdict = Literal["holds", "does not hold", "cannot be said"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """`why`: the worst deviation and where, or why nothing can be said."""

    verdict: Verdict
    why: str


class PipelineError(Exception):
    """A pipeline that was asked raised something, or gave what is no answer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Story:
    """What a pipeline is told: a calibration, and messages in order of arrival."""

    calibration: Calibration
    messages: tuple[Measurement, ...]


def ask(factory: Factory, story: Story) -> Driven:
    """A new pipeline's answers to a story. PipelineError: there are none."""
    try:
        return drive(factory(), story.calibration, CATEGORIES, story.messages)
    except Exception as error:  # foreign code may raise anything
        raise raised(error) from error


def raised(error: Exception) -> PipelineError:
    """The same in words, as one line."""
    words = " ".join(f"{type(error).__name__}: {error}".split())
    return PipelineError(f"the pipeline raised {words}")


def said_nothing(driven: Sequence[Driven]) -> bool:
    """Whether there is no object in any of the answers: then no relation between them means anything."""
    return not any(output.objects for one in driven for output in one.outputs)


NOTHING = Finding(verdict="cannot be said", why="the pipeline found no object in any scan")
