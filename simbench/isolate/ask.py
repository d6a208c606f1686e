"""What the bench wants to know of a pipeline before it runs, without running a user's code in its process."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from scenarios.errors import BadInput
from simbench.isolate.limits import DEFAULT, Failed, Isolate
from simbench.isolate.reference import Command, command_of, is_ours, is_program
from simbench.isolate.session import Session
from simbench.plugins import load_pipeline, pipeline_names


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a pipeline says of itself."""

    reads_images: bool


def check_pipeline_name(name: str) -> None:
    """BadInput unless there is a pipeline of that name that can be loaded."""
    describe(name)


def reads_images(name: str) -> bool:
    """Whether a pipeline wants `CameraImage` messages: yes, unless it says `reads_images = False`. BadInput
    as above."""
    return describe(name).reads_images


def describe(name: str) -> Description:
    """A user's pipeline is loaded in a process of its own, ours in this one."""
    known = ":" in name or name in pipeline_names()
    if is_ours(name) or not known:
        return Description(reads_images=bool(getattr(load_pipeline(name), "reads_images", True)))
    return _asked(command_of(name), _age_ns(name))


def runs_apart(name: str, isolate: Isolate) -> bool:
    """Whether a pipeline runs in a process of its own."""
    return isolate == "all" or is_program(name) or (isolate == "users" and not is_ours(name))


@lru_cache(maxsize=64)
def _asked(command: Command, _: int) -> Description:
    try:
        with Session(command, DEFAULT) as session:
            return Description(reads_images=session.reads_images)
    except Failed as error:
        raise BadInput(f"pipeline '{command.name}' cannot be loaded: {error}") from error


def _age_ns(name: str) -> int:
    """When the file of a reference was last written; 0 where it is no file."""
    path = Path(name.rpartition(":")[0])
    return path.stat().st_mtime_ns if path.is_file() else 0
