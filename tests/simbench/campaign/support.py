"""A ledger's file, seen from outside."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from simbench.campaign.ledger import NAME


def rows_in(folder: Path) -> dict[str, tuple[str, str]]:
    """Status and value of all rows by key, in the order in which their tasks were given."""
    with closing(sqlite3.connect(folder / NAME)) as base:
        found = base.execute("SELECT key, status, value FROM rows ORDER BY place, rowid").fetchall()
    return {key: (status, value) for key, status, value in found}


def keep_first(folder: Path, count: int) -> None:
    """As if the run had been stopped after so many rows."""
    with closing(sqlite3.connect(folder / NAME)) as base, base:
        base.execute(
            "DELETE FROM rows WHERE rowid > (SELECT rowid FROM rows ORDER BY rowid LIMIT 1 OFFSET ?)",
            (count - 1,),
        )
