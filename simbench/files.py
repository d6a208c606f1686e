"""Writing files so that a reader never sees a half-written one."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader, BufferedWriter
from pathlib import Path

from scenarios.errors import BadInput


def open_plain(path: Path) -> BufferedReader:
    """A file for reading. BadInput: there is none, it cannot be read, or it is a pipe or a device, which
    might never answer, or never end."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            os.close(descriptor)
            raise BadInput("is no plain file", file=str(path))
        return os.fdopen(descriptor, "rb")
    except FileNotFoundError:
        raise BadInput("no such file", file=str(path)) from None
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror or error}", file=str(path)) from None


def read_plain(path: Path, most_bytes: int) -> bytes:
    """All of a file. BadInput as above, and where it is larger than allowed."""
    with open_plain(path) as file:
        try:
            size = os.fstat(file.fileno()).st_size  # `read` makes room for all that it is asked for
            content = file.read(min(size, most_bytes + 1))
        except OSError as error:
            raise BadInput(f"cannot be read: {error.strerror or error}", file=str(path)) from None
    if len(content) > most_bytes:
        raise BadInput(f"is larger than {most_bytes} bytes", file=str(path))
    return content


def prepare_folder(folder: Path) -> None:
    """Make an output folder, or say in one sentence why it cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".simbench-{os.getpid()}"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise BadInput(f"cannot write to {folder}: {error.strerror or error}") from error


def prepare_empty_folder(folder: Path) -> None:
    """`prepare_folder`, and BadInput where there is something in it already."""
    prepare_folder(folder)
    if next(folder.iterdir(), None) is not None:
        raise BadInput("there is something in it already", file=str(folder), allowed="an empty folder")


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 under a temporary name, then rename."""
    write_bytes(path, text.encode("utf-8"))


def write_artifact(path: Path, data: bytes) -> None:
    """`write_bytes`, and on the disk when it returns: after a power failure there is all of it or nothing."""
    write_bytes(path, data, durable=True)


def write_bytes(path: Path, data: bytes, *, durable: bool = False) -> None:
    """Write under a temporary name, then rename. BadInput where the place cannot be written."""
    with writing(path, durable=durable) as file:
        file.write(data)


@contextmanager
def writing(path: Path, *, durable: bool = False) -> Iterator[BufferedWriter]:
    """A file of a temporary name, which gets its own when all is written. BadInput where the place cannot be
    written; then, and when anything else is raised, nothing is left."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with temporary.open("wb") as file:
            yield file
            if durable:
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(path)
        if durable:
            _sync_folder(path.parent)
    except BaseException as error:
        with suppress(OSError):  # best effort: the first error is the one to tell
            temporary.unlink()
        if isinstance(error, OSError):
            raise BadInput(f"cannot write {path}: {error.strerror or error}") from error
        raise


def _sync_folder(folder: Path) -> None:
    """A name is on the disk once its folder is."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
