"""The key of a task: SHA-256 of what is run, of the code that runs it, and of how it is told to.

Nothing of the clock, of the machine or of a task's place in a list goes into it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
from collections.abc import Iterable, Mapping
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

OURS = ("fusion", "scenarios", "simbench")
SOURCE = (".json", ".py", ".xml", ".yaml")
LIBRARIES = ("mujoco", "numba", "numpy", "opencv-python-headless", "scipy")


def task_key(*, case: Mapping[str, Any], config: Mapping[str, Any], code: str | None = None) -> str:
    """The key of plain data. case: what is run. config: how, with the files and pipelines that it names.
    code: None for that of this process."""
    content = {"case": case, "code": code or code_digest(), "config": config}
    return sha256_of([json.dumps(content, sort_keys=True, allow_nan=False).encode("utf-8")])


@lru_cache(maxsize=1)
def code_digest() -> str:
    """SHA-256 of the bench's own source and of the versions of the libraries that do its arithmetic."""
    parts = [part for name in OURS for part in files_of(_folder_of(name), SOURCE)]
    parts += [f"{name} {version(name)}".encode() for name in LIBRARIES]
    return sha256_of(parts)


def _folder_of(package: str) -> Path:
    spec = importlib.util.find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise PackageNotFoundError(package)
    return Path(next(iter(spec.submodule_search_locations)))


def files_of(folder: Path, suffixes: tuple[str, ...], besides: str = "") -> Iterable[bytes]:
    """Name and content of all files of some kinds, in the order of their names. besides: a folder of it that
    is left out."""
    for path in sorted(path for path in folder.rglob("*") if path.suffix in suffixes and path.is_file()):
        if path.is_relative_to(folder / besides) and besides:
            continue
        yield f"{folder.name}/{path.relative_to(folder).as_posix()}".encode()
        yield path.read_bytes()


def sha256_of(parts: Iterable[bytes]) -> str:
    """Of parts with their lengths, so that no two lists give the same bytes."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()
