"""Writing files so that a reader never sees a half-written one."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from scenarios.errors import BadInput


def prepare_folder(folder: Path) -> None:
    """Make an output folder, or say in one sentence why it cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".simbench-{os.getpid()}"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise BadInput(f"cannot write to {folder}: {error.strerror or error}") from error


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 under a temporary name, then rename."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, data: bytes) -> None:
    """Write under a temporary name, then rename. BadInput where the place cannot be written."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_bytes(data)
        temporary.replace(path)
    except OSError as error:
        with suppress(OSError):  # best effort: the first error is the one to tell
            temporary.unlink()
        raise BadInput(f"cannot write {path}: {error.strerror or error}") from error
