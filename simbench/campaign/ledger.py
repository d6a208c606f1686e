"""What a campaign has measured so far: an SQLite file in its folder that survives whatever ends the run.

One row per task, written whole or not at all (write-ahead log, `synchronous=FULL`) by one writer, the driver.
The first table says what is measured: the ledger of another campaign is refused, and so is a damaged one.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from scenarios.errors import BadInput, show

NAME = "ledger.sqlite"
SCHEMA = 1
Status = Literal["ok", "raised", "died", "timeout"]
TABLES = """
BEGIN;
CREATE TABLE about (text TEXT NOT NULL);
CREATE TABLE rows (
    key TEXT PRIMARY KEY, place INTEGER NOT NULL, status TEXT NOT NULL, value TEXT NOT NULL, sum TEXT NOT NULL
);
"""
FULL = ("SQLITE_FULL", "SQLITE_IOERR", "SQLITE_CANTOPEN", "SQLITE_READONLY", "SQLITE_PERM")


@dataclass(frozen=True, kw_only=True)
class Done:
    """A task that is over. value: the JSON text that the work gave; None where it gave none, and `failure`
    says why in a sentence. status: `ok`; the work `raised`; its worker `died` every time; `timeout`."""

    key: str
    value: str | None
    failure: str | None = None
    status: Status = "ok"


class Ledger:
    """The ledger in a folder, made if there is none. about: what is measured, as plain data. kind: what
    messages call it. BadInput: it belongs to another campaign, is damaged, or cannot be written.
    """

    def __init__(self, folder: Path, about: Mapping[str, Any], kind: str = "campaign") -> None:
        self.path = folder / NAME
        self._kind = kind
        text = json.dumps(about, sort_keys=True, allow_nan=False)
        with self._told():
            self._base = sqlite3.connect(self.path, isolation_level=None, timeout=5.0)
        try:
            with self._told():
                self._open(text)
        except BadInput:
            self.close()
            raise

    def _open(self, text: str) -> None:
        """Make the tables, or check those that are there."""
        (empty,) = self._base.execute("SELECT count(*) = 0 FROM sqlite_master").fetchone()
        (schema,) = self._base.execute("PRAGMA user_version").fetchone()
        if schema != SCHEMA and not empty:
            raise self._damaged(f"its schema is {schema}, this is {SCHEMA}")
        self._base.execute("PRAGMA journal_mode=WAL")
        self._base.execute("PRAGMA synchronous=FULL")
        if empty:
            insert = f"INSERT INTO about VALUES ({_quoted(text)}); PRAGMA user_version={SCHEMA}; COMMIT;"
            self._base.executescript(TABLES + insert)
            return
        found = self._base.execute("SELECT text FROM about").fetchall()
        if len(found) != 1:
            raise self._damaged("it does not say what it holds")
        if found[0][0] != text:
            raise BadInput(
                f"{self.path} holds another {self._kind}{_differences(found[0][0], text)}; give another "
                f"--out, or remove it to start anew"
            )
        (state,) = self._base.execute("PRAGMA quick_check(1)").fetchone()
        if state != "ok":
            raise self._damaged(str(state))
        for row in self._base.execute("SELECT key, place, status, value, sum FROM rows"):
            self._done(row)

    def __enter__(self) -> Ledger:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        self._base.close()

    def __len__(self) -> int:
        with self._told():
            (count,) = self._base.execute("SELECT count(*) FROM rows").fetchone()
        return int(count)

    def __contains__(self, key: str) -> bool:
        with self._told():
            return self._base.execute("SELECT 1 FROM rows WHERE key = ?", (key,)).fetchone() is not None

    def get(self, key: str) -> Done:
        """The row of a key. KeyError: there is none."""
        with self._told():
            row = self._base.execute(
                "SELECT key, place, status, value, sum FROM rows WHERE key = ?", (key,)
            ).fetchone()
        if row is None:
            raise KeyError(key)
        return self._done(row)

    def rows(self) -> Iterator[Done]:
        """All rows by place, then key: where its task was in the list with which it was measured."""
        with self._told():
            yield from map(
                self._done,
                self._base.execute("SELECT key, place, status, value, sum FROM rows ORDER BY place, key"),
            )

    def add(self, done: Done, place: int) -> None:
        """Keep a row: on the disk when this returns. BadInput: the disk is full or gone."""
        value = done.value if done.failure is None else json.dumps(done.failure)
        assert value is not None
        head = (done.key, place, done.status, value)
        with self._told():
            self._base.execute("INSERT INTO rows VALUES (?, ?, ?, ?, ?)", (*head, _sum(*head)))

    def _done(self, row: tuple[str, int, Status, str, str]) -> Done:
        key, place, status, value, total = row
        if total != _sum(key, place, status, value):
            raise self._damaged(f"the row {show(key)} is not what was written")
        if status == "ok":
            return Done(key=key, value=value)
        return Done(key=key, value=None, failure=str(json.loads(value)), status=status)

    def _damaged(self, why: str) -> BadInput:
        return BadInput(
            f"{self.path} is no ledger that can be read ({why}); put back a copy of it, or remove it to "
            f"start anew"
        )

    @contextmanager
    def _told(self) -> Iterator[None]:
        """What SQLite raises as one sentence."""
        try:
            yield
        except sqlite3.Error as error:
            name = getattr(error, "sqlite_errorname", "")
            if name.startswith(FULL):
                raise BadInput(
                    f"cannot write {self.path}: {error}; what it holds is kept, and the same command goes on "
                    f"from there"
                ) from error
            if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
                raise BadInput(f"{self.path} is held by another program: {error}") from error
            raise self._damaged(str(error)) from error


def _sum(key: str, place: int, status: str, value: str) -> str:
    """What shows that a row is as it was written."""
    return hashlib.sha256("\0".join((key, str(place), status, value)).encode("utf-8")).hexdigest()[:16]


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"


def _differences(had: str, asked: str) -> str:
    """Which words differ, where both are mappings."""
    try:
        before, now = json.loads(had), json.loads(asked)
    except ValueError:
        return ""
    if not isinstance(before, dict) or not isinstance(now, dict):
        return ""
    names = sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))
    return f" (other {', '.join(names)})" if names else ""
