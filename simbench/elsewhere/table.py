"""Positions in a CSV file: a header and a row each.

    stamp_ns,x_m,y_m,z_m[,track][,category][,confidence]

In any order of columns; positions in the ego frame, stamps on the sensors' clock of the recording. An empty
`track` is none.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from scenarios.errors import BadInput, Where, show
from simbench.elsewhere.outputs import text_lines
from simbench.elsewhere.positions import Position

NEEDED = ("stamp_ns", "x_m", "y_m", "z_m")
ALLOWED = (*NEEDED, "track", "category", "confidence")
LARGEST_FILE = 2**28
LONGEST_LINE = 2**16
MOST_POSITIONS = 1_000_000
FARTHEST_M = 1e7
LATEST_NS = 2**62
LONGEST_NAME = 200


def read_table(path: Path) -> tuple[Position, ...]:
    """The positions of a file. BadInput with file and line: it is malformed."""
    rows = _rows(path)
    _, header = next(rows, (1, []))
    where = Where(file=str(path))
    for column in header:
        if column not in ALLOWED:
            raise where.unknown("column", column, ALLOWED)
    for column in NEEDED:
        if column not in header:
            raise BadInput(f"there is no column {column}", file=str(path), line=1, allowed=",".join(ALLOWED))
    if len(set(header)) < len(header):
        raise BadInput("a column stands twice", file=str(path), line=1)
    found: list[Position] = []
    for line, row in rows:
        if len(found) == MOST_POSITIONS:
            raise BadInput(f"there are more than {MOST_POSITIONS} positions", file=str(path), line=line)
        if len(row) != len(header):
            raise BadInput(f"{len(row)} values under {len(header)} columns", file=str(path), line=line)
        found.append(_position(dict(zip(header, row, strict=True)), str(path), line))
    return tuple(found)


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Every row that is not empty, with the line that it ends in, one by one."""
    reader = csv.reader((line for _, line in text_lines(path, LARGEST_FILE, LONGEST_LINE)), strict=True)
    try:
        for row in reader:
            if row:
                yield reader.line_num, row
    except csv.Error as error:
        raise BadInput(f"it is no CSV: {error}", file=str(path), line=reader.line_num) from None


def _position(row: Mapping[str, str], file: str, line: int) -> Position:
    stamp = row["stamp_ns"].strip()
    if re.fullmatch("-?[0-9]{1,19}", stamp) is None or abs(int(stamp)) >= LATEST_NS:
        raise BadInput(f"{show(stamp)} is no whole number", file=file, line=line, field="stamp_ns")
    x, y, z = (_number(row[name], file, line, name) for name in ("x_m", "y_m", "z_m"))
    if max(abs(x), abs(y), abs(z)) > FARTHEST_M:
        raise BadInput(
            "a position lies too far away", file=file, line=line, allowed=f"up to {FARTHEST_M:g} m"
        )
    sure = _number(row["confidence"], file, line, "confidence") if row.get("confidence") else 1.0
    if not 0.0 <= sure <= 1.0:
        raise BadInput(f"is {sure:g}", file=file, line=line, field="confidence", allowed="0 to 1")
    return Position(
        where=f"line {line}", stamp_ns=int(stamp), position_ego_m=(x, y, z),
        track=row.get("track", "")[:LONGEST_NAME] or None, category=row.get("category", "")[:LONGEST_NAME],
        confidence=sure,
    )  # fmt: skip


def _number(text: str, file: str, line: int, field: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(f"{show(text)} is no finite number", file=file, line=line, field=field)
    return value
