"""A pipeline's name as a command that speaks the protocol, whatever folder it is started in."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

from scenarios.errors import BadInput
from simbench.plugins import GROUP

PROGRAM = "exec:"
OURS = "simbench"
ROOT = Path(__file__).resolve().parents[2]

# The host's code is the bench's own, even where another simbench is installed or the folder is another one.
_START = """
import sys
from importlib.util import find_spec
root, *words = sys.argv[1:]
spec = find_spec("simbench")
foreign = spec is None or not (spec.origin or "").startswith(root)
if foreign:
    sys.path.insert(0, root)
from simbench.isolate.host import main
if foreign:
    sys.path.remove(root)
main(*words)
"""


@dataclass(frozen=True, kw_only=True)
class Command:
    """`words` start the process of pipeline `name`; `environment` is all that it gets. is_host: a Python
    pipeline in our host, else a program that speaks the protocol itself."""

    name: str
    words: tuple[str, ...]
    is_host: bool
    environment: tuple[tuple[str, str], ...]


def is_ours(name: str) -> bool:
    """Whether a name is an entry point of simbench itself."""
    points = [point for point in entry_points(group=GROUP) if point.name == name]
    return any(point.dist is not None and point.dist.name == OURS for point in points)


def is_program(name: str) -> bool:
    """Whether a name is a program of any language: `exec:PROGRAM ARGS`."""
    return name.startswith(PROGRAM)


def command_of(name: str, folder: Path | None = None) -> Command:
    """The command of a pipeline. Paths are relative to `folder` (None: where we are). BadInput: a program
    that is not there."""
    here = (folder or Path.cwd()).resolve()
    words = _program(name, here) if is_program(name) else _host(name, here)
    return Command(
        name=name, words=tuple(words), is_host=not is_program(name), environment=_environment(here)
    )


def _host(name: str, here: Path) -> list[str]:
    # -P: the folder it is started in is not the user's
    return [sys.executable, "-P", "-c", _START, str(ROOT), name, str(here)]


def _program(name: str, here: Path) -> list[str]:
    try:
        words = shlex.split(name.removeprefix(PROGRAM))
    except ValueError as error:
        raise BadInput(f"pipeline '{name}' is no command line: {error}") from error
    if not words:
        raise BadInput(f"pipeline '{name}' names no program", allowed="exec:PROGRAM ARGS")
    program = shutil.which(str(here / words[0]) if "/" in words[0] else words[0])
    if program is None:
        raise BadInput(f"pipeline '{name}': there is no program {words[0]}")
    return [program, *(str(here / word) if word and (here / word).exists() else word for word in words[1:])]


def _environment(here: Path) -> tuple[tuple[str, str], ...]:
    """Ours, with PYTHONPATH that does not depend on the folder, and hashes that differ neither by run nor by
    what runs it: dask's workers have a seed of their own."""
    found = {**os.environ, "PYTHONHASHSEED": "0"}
    if path := found.get("PYTHONPATH"):
        found["PYTHONPATH"] = os.pathsep.join(str(here / entry) for entry in path.split(os.pathsep))
    return tuple(sorted(found.items()))
