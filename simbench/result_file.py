"""`result.json` as it is written: an entry a line, record by record, as a run may be larger than memory."""

from __future__ import annotations

import io
import json
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import Any, TypeAlias

from simbench.files import writing
from simbench.summaries import Summaries

SCHEMA = "simbench-result/1"
NAME = "result.json"
PARTS = ("rows", "cases", "timings")
IN_MEMORY = 4_000_000  # bytes of a part, beyond which it waits on the disk

Record = Mapping[str, Sequence[Mapping[str, Any]]]
"""What one recording adds: its `rows`, `cases` and `timings`."""
Spool: TypeAlias = "SpooledTemporaryFile[bytes]"


def write_result(
    folder: Path, records: Iterable[Record], environment: Mapping[str, object], **more: object
) -> Path:
    """Write `result.json` into a folder, and after the usual parts what `more` says; its path."""
    path = folder / NAME
    with writing(path) as file:
        _write(file, records, environment, more, str(folder))
    return path


def print_result(folder: Path) -> None:
    """The document of a folder on stdout."""
    with (folder / NAME).open(encoding="utf-8") as file:
        shutil.copyfileobj(file, sys.stdout)


def document(records: Iterable[Record], environment: Mapping[str, object]) -> dict[str, Any]:
    """The same as plain data."""
    file = io.BytesIO()
    _write(file, records, environment, {}, None)
    return dict(json.loads(file.getvalue()))


def _write(
    file: io.BufferedIOBase, records: Iterable[Record], environment: Mapping[str, object],
    more: Mapping[str, object], folder: str | None,
) -> None:  # fmt: skip
    """Parts wait beside each other until all records are read: they stand one after another."""
    summaries = Summaries()
    with ExitStack() as stack:
        waiting = {name: stack.enter_context(SpooledTemporaryFile(IN_MEMORY, dir=folder)) for name in PARTS}
        for record in records:
            for name, part in waiting.items():
                _add(part, record[name])
            summaries.add(record["rows"])
        waiting["summary"] = stack.enter_context(SpooledTemporaryFile(IN_MEMORY, dir=folder))
        _add(waiting["summary"], summaries.content())
        file.write(f'{{\n"schema": {_text(SCHEMA)}'.encode())
        for name in ("rows", "cases", "summary", "timings"):
            part = waiting[name]
            file.write(f',\n"{name}": ['.encode())
            part.seek(0)
            shutil.copyfileobj(part, file)
            file.write(b"\n]")
    for name, value in {"environment": dict(environment), **more}.items():
        file.write(f',\n"{name}": {_text(value)}'.encode())
    file.write(b"\n}\n")


def _add(part: Spool, entries: Iterable[Mapping[str, Any]]) -> None:
    for entry in entries:
        part.write((",\n" if part.tell() else "\n").encode() + _text(entry).encode())


def _text(value: object) -> str:
    return json.dumps(value, allow_nan=False)
