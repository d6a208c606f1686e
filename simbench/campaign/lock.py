"""One run in a folder at a time."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scenarios.errors import BadInput

NAME = ".simbench.lock"


@contextmanager
def only_one(folder: Path) -> Iterator[None]:
    """Hold the folder for the length of a block, however its process ends. BadInput: another run holds it."""
    try:
        descriptor = os.open(folder / NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise BadInput(f"cannot write to {folder}: {error.strerror or error}") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = os.pread(descriptor, 20, 0).decode("ascii", "replace").strip()
            raise BadInput(
                f"another run (process {holder or 'unknown'}) works in {folder}; wait for it, or give "
                f"another --out"
            ) from error
        except OSError as error:
            raise BadInput(f"{folder} cannot be locked: {error.strerror or error}") from error
        _write_pid(descriptor)
        yield
    finally:
        os.close(descriptor)


def _write_pid(descriptor: int) -> None:
    """Say who holds the folder; on a full disk the lock holds without."""
    try:
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode("ascii"), 0)
    except OSError:
        return
