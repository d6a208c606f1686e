"""The key of a job: its words, and the content of all files and pipelines that they name."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterable
from dataclasses import asdict
from functools import lru_cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from simbench.campaign.key import OURS, files_of, sha256_of, task_key
from simbench.case import Job
from simbench.formats.targets import is_recorded
from simbench.plugins import GROUP

SMALL_BYTES = 1_000_000
"""Of recorded data larger files are told apart by name and size."""


def job_key(job: Job, **more: Any) -> str:
    """The key of a job. more: what else tells its row from another, as plain data."""
    case = {**asdict(job), **more}
    names = case.pop("pipelines")
    config = {"pipelines": {name: pipeline_digest(name) for name in names}, "files": _files(job)}
    return task_key(case=case, config={**config, "order": list(names)})


@lru_cache(maxsize=256)
def pipeline_digest(name: str) -> str:
    """What stands behind a pipeline's name: the bytes of a user's file, or of all Python files of the package
    that a module is of. Our own packages are in `code_digest` already."""
    points = {point.name: point for point in entry_points(group=GROUP)}
    reference = points[name].value if name in points else name
    where = reference.rpartition(":")[0]
    if where.endswith(".py"):
        return sha256_of([reference.encode(), *_bytes(Path(where))])
    top = where.partition(".")[0]
    parts = [] if top in OURS or not top else list(_module(top))
    return sha256_of([reference.encode(), *parts])


def _module(top: str) -> Iterable[bytes]:
    try:
        spec = importlib.util.find_spec(top)
    except (ImportError, ValueError):
        return
    for place in (spec.submodule_search_locations or ()) if spec is not None else ():
        yield from files_of(Path(place), (".py",))
    if spec is not None and spec.submodule_search_locations is None and spec.origin is not None:
        yield from _bytes(Path(spec.origin))


def _files(job: Job) -> dict[str, str]:
    """Hashes by name of all files that a job's words name, and of what those name in turn."""
    if is_recorded(job.scenario):
        return {job.scenario: _recorded(Path(job.scenario.partition(":")[2]))}
    words = [job.scenario, job.found_in or "", job.calibration.partition(":")[2]]
    words += [part for text in (*job.faults, *job.changes) for part in (text, text.partition("=")[2])]
    found = {word: digest for word in words if (digest := _named(word))}
    if job.scenario in found:
        found["beside"] = _beside(Path(job.scenario).parent)
    return found


def _named(word: str) -> str | None:
    """Of a file; of a YAML file also of the tables that it names."""
    path = Path(word)
    if not word or len(word) > 4096 or "\0" in word or not path.is_file():
        return None
    parts = list(_bytes(path))
    if path.suffix in (".yaml", ".yml"):
        for name in sorted(set(re.findall(rb"[\w./~-]+\.csv", parts[0]))):
            parts += [name, *_bytes(Path(name.decode("ascii")))]
    return sha256_of(parts)


def _beside(folder: Path) -> str:
    """The rigs and sensors beside a user's scenario."""
    return sha256_of(part for name in ("rigs", "sensors") for part in files_of(folder / name, (".yaml",)))


@lru_cache(maxsize=8)
def _recorded(folder: Path) -> str:
    parts = []
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        size = path.stat().st_size
        parts.append(f"{path.relative_to(folder).as_posix()} {size}".encode())
        parts += _bytes(path) if size <= SMALL_BYTES else ()
    return sha256_of(parts)


def _bytes(path: Path) -> Iterable[bytes]:
    """The content, or that there is none."""
    try:
        return (path.read_bytes(),)
    except OSError:
        return (b"", b"cannot be read")
