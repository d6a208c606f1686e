"""Statistics as a CSV file in a recording's folder, and back."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from scenarios.errors import BadInput
from simbench.cards.statistics import COLUMNS, Sight
from simbench.files import write_text

NAME = "objects.csv"
WORDS = ("object", "category")
COUNTS = ("sweep", "points")
LARGEST = 2**28


def write_sights(rows: Sequence[Sight], folder: Path) -> None:
    """Write `objects.csv`; NaN stands empty."""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=COLUMNS, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _shown(value) for name, value in asdict(row).items()})
    write_text(folder / NAME, text.getvalue())


def read_sights(folder: Path) -> tuple[Sight, ...]:
    """The rows of a folder. BadInput: there are none, or they are malformed."""
    path = folder / NAME
    try:
        if path.stat().st_size > LARGEST:
            raise BadInput(f"is larger than {LARGEST >> 20} MB", file=str(path))
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.DictReader(file, strict=True)
            if tuple(reader.fieldnames or ()) != COLUMNS:
                raise BadInput("has other columns", file=str(path), line=1, allowed=",".join(COLUMNS))
            return tuple(_row(row, str(path), reader.line_num) for row in reader)
    except (OSError, csv.Error, UnicodeDecodeError) as error:
        raise BadInput(f"cannot be read: {error}", file=str(path)) from None


def _shown(value: object) -> object:
    if isinstance(value, float):
        return "" if value != value else f"{value:.6g}"
    return value


def _row(row: dict[str, str], file: str, line: int) -> Sight:
    try:
        return Sight(
            **{
                name: text if name in WORDS else int(text) if name in COUNTS else float(text or "nan")
                for name, text in row.items()
            }  # type: ignore[arg-type]
        )
    except (TypeError, ValueError):
        raise BadInput("is no row of statistics", file=file, line=line) from None
